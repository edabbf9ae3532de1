"""`taxel scan`."""

from typing import Annotated

import typer

from taxel_tools.cli_words import URL_HELP, boards, print_json, print_table
from taxel_tools.open_wire import open_wire
from taxel_tools.scan import scan


def scan_command(
    url: Annotated[str, typer.Argument(help=URL_HELP)],
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Show what is on the bus: addresses, kinds, firmware versions, unique ids, health.

    Changes nothing: it reads registers, and asks bootloaders who they are.

    Example: taxel scan emulator:?hand=rig4
    """
    with open_wire(url) as wire:
        found = scan(wire)
    if as_json:
        print_json(found)
        return
    rows = [
        (
            f"0x{one.address:02X}",
            one.runs,
            str(one.kind or ""),
            one.version,
            str(one.taxels or ""),
            one.unique_id,
            "; ".join(one.notes) or "well",
        )
        for one in found
    ]
    if not rows:
        print("nothing answers on the bus: check power and wiring")
        raise typer.Exit(1)
    print_table(("address", "runs", "kind", "version", "taxels", "unique id", "health"), rows)
    ours = [one for one in found if one.runs != "foreign"]
    print(f"{boards(len(ours))}, {sum(1 for one in ours if one.notes)} with notes")
