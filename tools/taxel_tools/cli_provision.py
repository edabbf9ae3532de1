"""`taxel provision`."""

from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

from taxel.errors import TaxelError
from taxel_protocol.bootloader import BOOT_DEFAULT_ADDRESS
from taxel_tools.cli_words import URL_HELP, address_of, boards, print_json, print_table
from taxel_tools.open_wire import open_wire
from taxel_tools.plan import Entry, checked, read_plan
from taxel_tools.provision import Candidate, Change, provision


def provision_command(
    url: Annotated[str, typer.Argument(help=URL_HELP)],
    at: Annotated[
        list[str] | None, typer.Option(help="Where the boards answer now; may be repeated. 0x77: blank.")
    ] = None,
    unique_id: Annotated[str | None, typer.Option("--id", help="Unique id of the board that is meant.")] = None,
    address: Annotated[str | None, typer.Option(help="Its new address.")] = None,
    kind: Annotated[int | None, typer.Option(help="Its design: code of its kind.")] = None,
    serial: Annotated[str | None, typer.Option(help="Its serial number, up to 16 characters.")] = None,
    idac: Annotated[str | None, typer.Option(help="Calibrated current of each RX line: 16,16,17 ...")] = None,
    plan: Annotated[Path | None, typer.Option(help="A plan (TOML) for many boards at once.")] = None,
    search: Annotated[bool, typer.Option("--search", help="List the boards there, change nothing.")] = False,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Say what would be written, write nothing.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Give boards address, kind, serial number and calibration, by unique id; they survive firmware updates.

    Boards at the given addresses are restarted into their bootloaders and told apart there, also if several share one
    address: so blank boards get their first address, and duplicates another one. What is not given stays as it is.

    Example: taxel provision "emulator:?hand=rig4&word=blank 0x50" --address 0x50 --kind 1 --serial FT-0007
    """
    places = [address_of(text, "--at") for text in at] if at else [BOOT_DEFAULT_ADDRESS]
    entries = _entries(unique_id, address, kind, serial, idac, plan)
    if not entries and not search:
        raise TaxelError("provision: say what to write (--address, --kind, --serial, --idac or --plan), or --search")
    console = Console(stderr=True, soft_wrap=True)

    def tell(change: Change) -> None:
        console.print(f"  {_told(change)} {'would be written' if dry_run else 'is written'}")

    with open_wire(url) as wire:
        console.print(f"boards at {', '.join(f'0x{place:02X}' for place in places)} restart into their bootloaders")
        candidates, changes = provision(wire, places, [] if search else entries, tell, not dry_run)
    _print(candidates, changes, search, dry_run, as_json)


def _entries(
    unique_id: str | None,
    address: str | None,
    kind: int | None,
    serial: str | None,
    idac: str | None,
    plan: Path | None,
) -> list[Entry]:
    values = (address, kind, serial, idac)
    if plan is not None:
        if unique_id is not None or any(value is not None for value in values):
            raise TaxelError("--plan: expected alone, found other values beside it; write them into the plan")
        return read_plan(plan)
    if all(value is None for value in values):
        return []
    codes = None if idac is None else [_number(code) for code in idac.split(",")]
    wanted = None if address is None else address_of(address, "--address")
    return [checked("provision", "--", unique_id, wanted, kind, serial, codes)]


def _number(text: str) -> int | str:
    return int(text) if text.strip().isdecimal() else text


def _serial(configuration: dict[str, Any] | None) -> str:
    return configuration["serial_number"].rstrip(b"\0").decode("ascii", "replace") if configuration else ""


def _told(change: Change) -> str:
    one, new = change.candidate, change.configuration
    place = f"{one.unique_id.hex()} at 0x{one.address:02X} -> 0x{new['address']:02X}"
    return f"{place}, kind {new['kind']}, serial '{_serial(new)}'"


def _print(candidates: list[Candidate], changes: list[Change], search: bool, dry_run: bool, as_json: bool) -> None:
    if as_json:
        print_json({"found": candidates, "changes": changes, "written": not (search or dry_run)})
        return
    by_id = {change.candidate.unique_id: change for change in changes}
    rows = []
    for one in candidates:
        change = by_id.get(one.unique_id)
        new = change.configuration if change else one.configuration
        rows.append(
            (
                one.unique_id.hex(),
                f"0x{one.address:02X}",
                f"0x{new['address']:02X}" if new else "blank",
                str(new["kind"]) if new else "",
                _serial(new),
                " ".join(str(code) for code in new["idac_codes"].rstrip(b"\0")) if new else "",
                ("would be written" if dry_run else "written") if change else "as it was",
            )
        )
    print_table(("unique id", "answered at", "address", "kind", "serial", "idac", ""), rows)
    print(f"{boards(len(candidates))} found, {len(changes)} {'would be changed' if dry_run else 'changed'}")
