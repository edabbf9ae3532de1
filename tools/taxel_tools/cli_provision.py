"""The command `taxel provision`."""

from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

from taxel.errors import TaxelError
from taxel_protocol.bootloader import BOOT_DEFAULT_ADDRESS
from taxel_tools.cli_common import URL_HELP, count_boards, parse_address, print_json, print_table
from taxel_tools.open_wire import open_wire, reject_original_hub
from taxel_tools.provision import Candidate, Change, provision
from taxel_tools.provisioning_plan import Entry, read_plan, validate_entry


def provision_command(
    url: Annotated[str, typer.Argument(help=URL_HELP)],
    board: Annotated[
        list[str] | None, typer.Option(help="Present address of the boards; may be repeated. 0x77: blank boards.")
    ] = None,
    unique_id: Annotated[str | None, typer.Option("--id", help="Unique id of the board to configure.")] = None,
    new_address: Annotated[str | None, typer.Option(help="New I2C address.")] = None,
    kind: Annotated[int | None, typer.Option(help="Code of the board kind.")] = None,
    serial: Annotated[str | None, typer.Option(help="Serial number, up to 16 characters.")] = None,
    idac: Annotated[str | None, typer.Option(help="Calibrated current code of each RX line: 16,16,17 ...")] = None,
    plan: Annotated[Path | None, typer.Option(help="Provisioning plan (TOML) for several boards.")] = None,
    search: Annotated[bool, typer.Option("--search", help="List the boards at the address; change nothing.")] = False,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Print the changes; write nothing.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Assign address, kind, serial number and calibration to boards, selected by unique id.

    The configuration survives firmware updates. Boards at the given addresses are restarted into their bootloaders and
    distinguished there by unique id, also if several share one address. Blank boards receive their first address in
    this way, and boards with duplicate addresses receive new ones. Values that are not given stay unchanged.

    Example: taxel provision "emulator:?hand=rig4&word=blank 0x50" --new-address 0x50 --kind 1 --serial FT-0007
    """
    reject_original_hub(url)
    present_addresses = [parse_address(text, "--board") for text in board] if board else [BOOT_DEFAULT_ADDRESS]
    entries = _build_entries(unique_id, new_address, kind, serial, idac, plan)
    if not entries and not search:
        values = "--new-address, --kind, --serial, --idac or --plan"
        raise TaxelError(f"provision: expected values to write ({values}) or --search, found none")
    console = Console(stderr=True, soft_wrap=True)

    def announce(change: Change) -> None:
        """Print one configuration before it is written, or that it would be written in a dry run."""
        console.print(f"  {_describe_change(change)} {'would be written' if dry_run else 'is written'}")

    with open_wire(url) as wire:
        console.print(
            f"boards at {', '.join(f'0x{address:02X}' for address in present_addresses)} restart into their bootloaders"
        )
        candidates, changes = provision(wire, present_addresses, [] if search else entries, announce, not dry_run)
    _print_result(candidates, changes, search, dry_run, as_json)


def _build_entries(
    unique_id: str | None,
    new_address: str | None,
    kind: int | None,
    serial: str | None,
    idac: str | None,
    plan: Path | None,
) -> list[Entry]:
    """Build the configurations requested on the command line: those of the plan file, or one from the options.

    Returns [] if no value is given. Raises `TaxelError` for invalid values, and for values in addition to a plan.
    """
    values = (new_address, kind, serial, idac)
    if plan is not None:
        if unique_id is not None or any(value is not None for value in values):
            raise TaxelError(
                "--plan: expected no other values, found some on the command line; write them into the plan"
            )
        return read_plan(plan)
    if all(value is None for value in values):
        return []
    codes = None if idac is None else [_parse_code(code) for code in idac.split(",")]
    address = None if new_address is None else parse_address(new_address, "--new-address")
    return [validate_entry("provision", "--", unique_id, address, kind, serial, codes)]


def _parse_code(text: str) -> int | str:
    """Parse a code of the current source from the command line: a number, or a string that is checked later."""
    return int(text) if text.strip().isdecimal() else text


def _decode_serial(configuration: dict[str, Any] | None) -> str:
    """Return the serial number in the configuration of a board; "" for a board without a configuration."""
    return configuration["serial_number"].rstrip(b"\0").decode("ascii", "replace") if configuration else ""


def _describe_change(change: Change) -> str:
    """Format a planned configuration of a board: its unique id, present and new address, kind and serial number."""
    board, new = change.candidate, change.configuration
    addresses = f"{board.unique_id.hex()} at 0x{board.address:02X} -> 0x{new['address']:02X}"
    return f"{addresses}, kind {new['kind']}, serial '{_decode_serial(new)}'"


def _print_result(
    candidates: list[Candidate], changes: list[Change], search: bool, dry_run: bool, as_json: bool
) -> None:
    """Print the boards with their new configurations, as a table or as JSON."""
    if as_json:
        print_json({"found": candidates, "changes": changes, "written": not (search or dry_run)})
        return
    by_id = {change.candidate.unique_id: change for change in changes}
    rows = []
    for candidate in candidates:
        change = by_id.get(candidate.unique_id)
        new = change.configuration if change else candidate.configuration
        rows.append(
            (
                candidate.unique_id.hex(),
                f"0x{candidate.address:02X}",
                f"0x{new['address']:02X}" if new else "blank",
                str(new["kind"]) if new else "",
                _decode_serial(new),
                " ".join(str(code) for code in new["idac_codes"].rstrip(b"\0")) if new else "",
                ("would be written" if dry_run else "written") if change else "unchanged",
            )
        )
    print_table(("unique id", "answered at", "address", "kind", "serial", "idac", ""), rows)
    print(f"{count_boards(len(candidates))} found, {len(changes)} {'would be changed' if dry_run else 'changed'}")
