"""The command `taxel scan`."""

from typing import Annotated

import typer

from taxel.hand import load_hand
from taxel.hand.branches import find_silent_branches, format_silent_boards
from taxel_tools.cli_common import URL_HELP, count_boards, print_json, print_table
from taxel_tools.open_wire import open_wire
from taxel_tools.scan import scan_bus
from taxel_tools.wires import HubWire


def scan_command(
    url: Annotated[str, typer.Argument(help=URL_HELP)],
    hand: Annotated[
        str | None, typer.Option("--hand", help="Hand description; names silent boards and faulty branches.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """List the devices on the bus: addresses, kinds, firmware versions, unique ids, health.

    Writes nothing to a board: scan reads registers, and sends GET_INFO and SEARCH to bootloaders.

    With --hand, the command also reports boards of the hand that do not answer, and branches of the wiring of which no
    board answers; the exit status is then 1.

    Example: taxel scan emulator:?hand=rig4
    """
    description = None if hand is None else load_hand(hand)
    with open_wire(url) as wire:
        devices = scan_bus(wire)
        fault = wire.hub.read_fault() if isinstance(wire, HubWire) else None
    present = {device.address for device in devices if device.runs != "foreign"}
    silent = [] if description is None else [each.address for each in description.boards if each.address not in present]
    if as_json:
        print_json(devices)
        raise typer.Exit(1 if silent else 0)
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
    if fault is not None:
        print(f"the hub: {fault.describe()}")
    if not rows and description is None:
        print("no device answers on the bus; check power and wiring")
        raise typer.Exit(1)
    print_table(("address", "runs", "kind", "version", "taxels", "unique id", "health"), rows)
    taxel_boards = [device for device in devices if device.runs != "foreign"]
    print(f"{count_boards(len(taxel_boards))}, {sum(1 for device in taxel_boards if device.notes)} with notes")
    if description is not None and silent:
        print(format_silent_boards(description, find_silent_branches(description, silent)))
        raise typer.Exit(1)
