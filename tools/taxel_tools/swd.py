"""Programming of a blank board through its debug port (SWD) with OpenOCD or pyOCD. Not verified on hardware.

OpenOCD has a flash driver for PSoC 4 (`target/psoc4.cfg`) and is therefore preferred. pyOCD supports these processors
only with a CMSIS pack (`pyocd pack install CY8C4245AXI-483`), and pyOCD issue 1728 reports packs whose target does not
halt.
"""

import re
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from taxel.errors import TaxelError
from taxel_tools.errors import FirmwareFileError
from taxel_tools.files.intel_hex import read_intel_hex_rows
from taxel_tools.files.manifest import read_firmware_bytes

PYOCD_TARGET: Final = "cy8c4245axi-483"
INTERFACE: Final = "cmsis-dap"
"""OpenOCD's configuration file for CMSIS-DAP probes: KitProg, MiniProg4, DAPLink."""
TIMEOUT_S: Final = 180.0
INSTALL_COMMANDS: Final = {"openocd": "sudo apt install openocd", "pyocd": "pip install pyocd"}
TCL_SPECIAL: Final = set('{}[]"\\$;\n')
"""Characters that would end or change a word in an OpenOCD (Tcl) script."""


def is_installed(tool: str) -> bool:
    """Return whether the program is on the PATH."""
    return shutil.which(tool) is not None


def find_tool(requested: str | None, is_required: bool = True) -> str:
    """Return the name of the program for the debug port: the requested one, or the first installed.

    OpenOCD comes before pyOCD. is_required: whether the program must be installed; otherwise the name of a missing
    program is returned, too. Raises `TaxelError` with the installation command.
    """
    if requested is not None and requested not in INSTALL_COMMANDS:
        raise TaxelError(f"--swd-tool: expected openocd or pyocd, found '{requested}'")
    for tool in [requested] if requested else list(INSTALL_COMMANDS):
        if is_installed(tool):
            return tool
    if not is_required:
        return requested or next(iter(INSTALL_COMMANDS))
    if requested:
        raise TaxelError(f"--swd-tool: {requested} is not on the PATH; install it: {INSTALL_COMMANDS[requested]}")
    raise TaxelError(f"--swd: neither openocd nor pyocd is on the PATH; install one: {INSTALL_COMMANDS['openocd']}")


def check_hex(path: Path) -> list[int]:
    """Check an Intel HEX file for a blank board, which must contain a bootloader. Returns its flash rows.

    Raises `FirmwareFileError`, OSError.
    """
    source = str(path)
    if path.suffix not in {".hex", ".ihex"}:
        raise FirmwareFileError(source, "file name", ".hex", repr(path.suffix), "provide the bootloader as Intel HEX")
    try:
        text = read_firmware_bytes(path).decode("ascii")
    except UnicodeDecodeError:
        raise FirmwareFileError(
            source, "file", "ASCII text", "other bytes", "the file is damaged; copy it again"
        ) from None
    rows = sorted(read_intel_hex_rows(text, source))
    if not rows or rows[0] != 0:
        found = f"row {rows[0]} first" if rows else "none"
        remedy = "use the bootloader's file; write images without --swd"
        raise FirmwareFileError(source, "rows", "a bootloader, from row 0 on", found, remedy)
    return rows


def build_command(tool: str, path: Path, interface: str = INTERFACE) -> list[str]:
    """Build the argument list of the command that programs and verifies the file and starts the board.

    tool: "openocd" or "pyocd". interface: OpenOCD's name of the debug probe. Raises `TaxelError` for a name that the
    OpenOCD script cannot contain.
    """
    if tool == "pyocd":
        return ["pyocd", "load", "--target", PYOCD_TARGET, str(path)]
    if not re.fullmatch(r"[A-Za-z0-9_-]+(/[A-Za-z0-9_-]+)*", interface):
        raise TaxelError(f"--swd-interface: expected a name such as cmsis-dap or jlink, found '{interface}'")
    if TCL_SPECIAL & set(str(path)):
        raise TaxelError(f"{path}: openocd accepts no braces, quotes, $ or backslashes in a file name; rename the file")
    script = f"program {{{path}}} verify reset exit"
    return [
        *("openocd", "-f", f"interface/{interface}.cfg", "-c", "transport select swd"),
        *("-f", "target/psoc4.cfg", "-c", script),
    ]


def run_command(command: Sequence[str]) -> None:
    """Run a command without a shell. Raises `TaxelError` with the last line of its output."""
    try:
        completed = subprocess.run(
            command, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=TIMEOUT_S, check=False
        )
    except subprocess.TimeoutExpired:
        raise TaxelError(f"{command[0]}: did not end within {TIMEOUT_S:g} s; check probe and power") from None
    except OSError as error:
        raise TaxelError(f"{command[0]}: cannot be started ({error.strerror})") from None
    if completed.returncode:
        lines = [line.strip() for line in (completed.stdout + completed.stderr).splitlines() if line.strip()]
        last = lines[-1] if lines else "no output"
        raise TaxelError(
            f"{command[0]}: ended with status {completed.returncode}: {last}; check probe, wires and power"
        )
