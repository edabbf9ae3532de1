"""Checks of `taxel flash` before it writes: signatures of the files, and confirmation of a downgrade."""

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from taxel.errors import TaxelError
from taxel_tools.files import Firmware
from taxel_tools.firmware_update import format_version, is_downgrade
from taxel_tools.procedure import Version
from taxel_tools.trust import EMULATOR_PREFIX, check_file, check_firmware, read_trusted_keys


def require_signature(url: str, firmware: Firmware, trust: Sequence[Path], unsigned: bool) -> str:
    """Return a line that names the signer of the firmware, or a warning with `unsigned`.

    url: connection to the device; emulated devices also accept the development key. trust: public key files in addition
    to the key folder. Raises `SignatureError` without a trusted signature.
    """
    if unsigned:
        return f"warning: {firmware.source} without a check of the signature (--unsigned)"
    return f"signature: valid, {check_firmware(firmware, read_trusted_keys(trust), url.startswith(EMULATOR_PREFIX))}"


def require_file_signature(path: Path, data: bytes, trust: Sequence[Path], unsigned: bool) -> str:
    """Return a line that names the signer of a file for a debug probe, or a warning with `unsigned`.

    data: content of the file. trust: public key files in addition to the key folder. Raises `SignatureError` without a
    trusted signature.
    """
    if unsigned:
        return f"warning: {path} without a check of the signature (--unsigned)"
    return f"signature: valid, {check_file(path, data, read_trusted_keys(trust))}"


def confirm_downgrades(firmware: Firmware, running: Mapping[str, Version | None], downgrade: bool) -> bool:
    """Return whether firmware may replace newer versions: `downgrade`, or the user's confirmation at the terminal.

    downgrade: whether the option --downgrade is given. running: running version by device name; None if unknown: this
    device is compared later in its bootloader. Raises `TaxelError` if a device runs a newer version, and neither the
    option nor the user permits the downgrade.
    """
    newer = {name: version for name, version in running.items() if version and is_downgrade(version, firmware.version)}
    if downgrade or not newer:
        return downgrade
    names = ", ".join(f"{name} ({format_version(version)})" for name, version in newer.items())
    text = f"{firmware.source}: version {format_version(firmware.version)} is older than the running version of {names}"
    if sys.stdin.isatty():
        print(f"{text}. Write the older version? [y/N] ", end="", file=sys.stderr, flush=True)
        if sys.stdin.readline().strip().lower() in ("y", "yes"):
            return True
    raise TaxelError(f"{text}; nothing is written; add --downgrade to return to the older version")
