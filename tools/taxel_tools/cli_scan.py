"""The command `taxel scan`."""

from typing import Annotated

import typer

from taxel_tools.cli_common import URL_HELP, count_boards, print_json, print_table
from taxel_tools.open_wire import open_wire
from taxel_tools.scan import scan_bus


def scan_command(
    url: Annotated[str, typer.Argument(help=URL_HELP)],
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """List the devices on the bus: addresses, kinds, firmware versions, unique ids, health.

    Writes nothing to a board: scan reads registers, and sends GET_INFO and SEARCH to bootloaders.

    Example: taxel scan emulator:?hand=rig4
    """
    with open_wire(url) as wire:
        devices = scan_bus(wire)
    if as_json:
        print_json(devices)
        return
    rows = [
        (
            f"0x{device.address:02X}",
            device.runs,
            str(device.kind or ""),
            device.version,
            str(device.taxels or ""),
            device.unique_id,
            "; ".join(device.notes) or "healthy",
        )
        for device in devices
    ]
    if not rows:
        print("no device answers on the bus; check power and wiring")
        raise typer.Exit(1)
    print_table(("address", "runs", "kind", "version", "taxels", "unique id", "health"), rows)
    taxel_boards = [device for device in devices if device.runs != "foreign"]
    print(f"{count_boards(len(taxel_boards))}, {sum(1 for device in taxel_boards if device.notes)} with notes")
