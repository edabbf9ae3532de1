"""The first firmware of a blank board, through its debug port (SWD) by OpenOCD or pyOCD. Not verified on hardware.

OpenOCD has a flash driver for PSoC 4 (`target/psoc4.cfg`), so it comes first. pyOCD knows these processors from a CMSIS
pack only (`pyocd pack install CY8C4245AXI-483`), and its issue 1728 tells of packs whose target does not halt.
"""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from taxel.errors import TaxelError
from taxel_protocol.bootloader import BOOT_BOOTLOADER_ROWS
from taxel_tools.errors import FirmwareFileError
from taxel_tools.files.intel_hex import rows_of_intel_hex

PYOCD_TARGET: Final = "cy8c4245axi-483"
INTERFACE: Final = "cmsis-dap"
"""OpenOCD's file for the probe: KitProg, MiniProg4, DAPLink and their like."""
PATIENCE_S: Final = 180.0
INSTALL: Final = {"openocd": "sudo apt install openocd", "pyocd": "pip install pyocd"}
TCL_WORDS: Final = set('{}[]"\\$;\n')
"""What would end a word in a script of OpenOCD."""


def find_tool(wanted: str | None) -> str:
    """The wanted tool, or whichever is on the PATH, OpenOCD first. Raises `TaxelError` that says how to install one."""
    if wanted is not None and wanted not in INSTALL:
        raise TaxelError(f"--swd-tool: expected openocd or pyocd, found '{wanted}'")
    for tool in [wanted] if wanted else list(INSTALL):
        if shutil.which(tool):
            return tool
    if wanted:
        raise TaxelError(f"--swd-tool: {wanted} is not on the PATH; install it: {INSTALL[wanted]}")
    raise TaxelError(f"--swd: neither openocd nor pyocd is on the PATH; install one: {INSTALL['openocd']}")


def check_hex(path: Path) -> list[int]:
    """The flash rows that the file sets; it must bring a bootloader. Raises `FirmwareFileError`, OSError."""
    source = str(path)
    if path.suffix not in {".hex", ".ihex"}:
        raise FirmwareFileError(source, "file name", ".hex", repr(path.suffix), "give the bootloader as Intel HEX")
    try:
        text = path.read_bytes().decode("ascii")
    except UnicodeDecodeError:
        raise FirmwareFileError(source, "file", "ASCII text", "other bytes", "the file is damaged; copy it") from None
    rows = sorted(rows_of_intel_hex(text, source))
    if not rows or rows[0] != 0:
        found = f"row {rows[0]} first" if rows else "none"
        remedy = "give the bootloader's file; images go over the wire, without --swd"
        raise FirmwareFileError(
            source, "rows", f"a bootloader, from row 0 to {BOOT_BOOTLOADER_ROWS - 1}", found, remedy
        )
    return rows


def command_for(tool: str, path: Path, interface: str = INTERFACE) -> list[str]:
    """The command, word by word, that programs the file, verifies it and starts the board. Raises `TaxelError`."""
    if tool == "pyocd":
        return ["pyocd", "load", "--target", PYOCD_TARGET, str(path)]
    if not re.fullmatch(r"[A-Za-z0-9_-]+(/[A-Za-z0-9_-]+)*", interface):
        raise TaxelError(f"--swd-interface: expected a name such as cmsis-dap or jlink, found '{interface}'")
    if TCL_WORDS & set(str(path)):
        raise TaxelError(f"{path}: openocd takes no braces, quotes, $ or backslashes in a file name; rename the file")
    script = f"program {{{path}}} verify reset exit"
    return [
        *("openocd", "-f", f"interface/{interface}.cfg", "-c", "transport select swd"),
        *("-f", "target/psoc4.cfg", "-c", script),
    ]


def carry_out(command: Sequence[str]) -> None:
    """Run it without a shell. Raises `TaxelError` with its last words."""
    try:
        done = subprocess.run(
            command, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=PATIENCE_S, check=False
        )
    except subprocess.TimeoutExpired:
        raise TaxelError(f"{command[0]}: has not ended in {PATIENCE_S:g} s; check probe and power") from None
    except OSError as error:
        raise TaxelError(f"{command[0]}: cannot be started ({error.strerror})") from None
    if done.returncode:
        lines = [line.strip() for line in (done.stdout + done.stderr).splitlines() if line.strip()]
        last = lines[-1] if lines else "it said nothing"
        raise TaxelError(f"{command[0]}: ended with status {done.returncode}: {last}; check probe, wires and power")
