"""`taxel flash --swd`: programs a blank board through its debug port."""

import shlex
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

from taxel.errors import TaxelError
from taxel_tools.cli_common import print_json
from taxel_tools.cli_flash_checks import require_file_signature
from taxel_tools.swd import (
    INSTALL_COMMANDS,
    INTERFACE,
    build_command,
    check_hex,
    find_tool,
    is_installed,
    run_command,
)


def flash_swd(
    files: Sequence[Path],
    tool: str | None,
    interface: str | None,
    trust: Sequence[Path],
    unsigned: bool,
    dry_run: bool,
    as_json: bool,
) -> None:
    """Program a blank board through its debug port. Raises `TaxelError` with a one-line message.

    tool, interface: program and its name of the debug probe; None for the defaults. trust: public key files in addition
    to the key folder. unsigned: the file needs no signature.
    """
    if len(files) != 1:
        found = ", ".join(map(str, files))
        raise TaxelError(f"flash: expected one .hex and no URL with --swd (a board has one debug port), found {found}")
    rows = check_hex(files[0])
    program = find_tool(tool, is_required=not dry_run)
    command = build_command(program, files[0], interface or INTERFACE)
    console = Console(stderr=True, soft_wrap=True)
    console.print(require_file_signature(files[0], files[0].read_bytes(), trust, unsigned))
    verb = "would be" if dry_run else "are"
    console.print(f"{len(rows)} rows, {rows[0]} to {rows[-1]}, {verb} programmed by SWD (not verified on hardware):")
    console.print(f"  {shlex.join(command)}", markup=False, highlight=False)
    if not is_installed(program):
        remedy = f"{program} is not on the PATH; install it before the board is programmed: {INSTALL_COMMANDS[program]}"
        console.print(f"note: {remedy}", markup=False, highlight=False)
    if not dry_run:
        run_command(command)
    if as_json:
        print_json({"command": command, "done": not dry_run})
    elif not dry_run:
        print("programmed; provision the board, then flash its application over the wire")
