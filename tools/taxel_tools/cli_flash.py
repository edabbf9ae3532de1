"""`taxel flash`."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import TaskID

from taxel.errors import TaxelError
from taxel_tools.cli_flash_hub import check_hub_words, flash_hub
from taxel_tools.cli_flash_swd import flash_swd
from taxel_tools.cli_words import URL_HELP, address_of, boards, print_json, print_table, progress_bars
from taxel_tools.files import Firmware, load_firmware, slot_name
from taxel_tools.interleave import run_all
from taxel_tools.open_wire import open_wire
from taxel_tools.program import Outcome, Progress, dotted, update
from taxel_tools.scan import Found, scan
from taxel_tools.wires import BoardWire


def flash_command(
    url: Annotated[str, typer.Argument(help=URL_HELP + " With --swd: the .hex.")],
    files: Annotated[
        list[Path] | None, typer.Argument(help=".cyacd, .hex, .bin or a manifest; one file a slot.")
    ] = None,
    board: Annotated[list[str] | None, typer.Option(help="Address of a board; may be repeated.")] = None,
    every: Annotated[bool, typer.Option("--all", help="Every board on the bus that the file is for.")] = False,
    hub: Annotated[bool, typer.Option("--hub", help="The hub itself; the file says so too.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Write also where this very image runs already.")] = False,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Check files and boards, say what would be done.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    swd: Annotated[bool, typer.Option("--swd", help="A blank board, by its debug port; no URL.")] = False,
    swd_tool: Annotated[str | None, typer.Option(help="openocd or pyocd; else whichever is there.")] = None,
    swd_interface: Annotated[str | None, typer.Option(help="OpenOCD's name of the probe (cmsis-dap).")] = None,
) -> None:
    """Give boards new firmware, or the hub: many boards at once, read back, started, and seen to work.

    Only the slot that is not in use is written; what has a new image that does not confirm itself goes back to the old
    one by itself. An update that was cut off is resumed by running it again. A file for the hub goes to the hub, over
    its UART. --swd is for a board without a bootloader.

    Example: taxel flash serial:///dev/ttyUSB0 fingertip-a.cyacd fingertip-b.cyacd --all --dry-run
    """
    if swd:
        if board or every or hub or force:
            raise TaxelError(
                "flash: --swd programs the board on the probe; leave --board, --all, --hub and --force out"
            )
        flash_swd([Path(url), *(files or [])], swd_tool, swd_interface, dry_run, as_json)
        return
    if not files:
        raise TaxelError("flash: expected firmware files after the URL, found none; --swd FILE is for a blank board")
    if (bool(board) and every) or (hub and (board or every)):
        raise TaxelError("flash: expected one of --board ADDRESS (as often as wanted), --all and --hub")
    firmware = load_firmware(files)
    if check_hub_words(firmware, hub, board, every):
        flash_hub(url, firmware, force, dry_run, as_json)
        return
    if not (board or every):
        raise TaxelError("flash: expected either --board ADDRESS (as often as wanted) or --all")
    console = Console(stderr=True, soft_wrap=True)
    with open_wire(url) as wire:
        found = {one.address: one for one in scan(wire)}
        wanted = _chosen(firmware, found, board)
        _announce(console, firmware, wanted, found, dry_run)
        if dry_run:
            if as_json:
                print_json({"boards": [found[address] for address in wanted], "version": dotted(firmware.version)})
            return
        results = _run(wire, firmware, wanted, force, console)
    failed = {address: result for address, result in results.items() if isinstance(result, TaxelError)}
    done = [result for result in results.values() if not isinstance(result, TaxelError)]
    if as_json:
        print_json({"done": done, "failed": {f"0x{address:02X}": str(why) for address, why in failed.items()}})
    else:
        _print(done)
    if failed:
        lines = "; ".join(str(why) for why in failed.values())
        raise TaxelError(f"not updated: {len(failed)} of {boards(len(results))}: {lines}")


def _chosen(firmware: Firmware, found: dict[int, Found], board: list[str] | None) -> list[int]:
    """The boards that are meant. Raises `TaxelError` for one that is not there or of another kind."""
    if board is None:
        ours = [one for one in found.values() if one.runs in ("application", "bootloader")]
        wanted = [one.address for one in ours if not firmware.kind or one.kind in (0, firmware.kind)]
        if not wanted:
            raise TaxelError(
                f"{firmware.source}: no board on the bus is of kind {firmware.kind}; taxel scan shows them"
            )
        return wanted
    wanted = list(dict.fromkeys(address_of(text, "--board") for text in board))
    for address in wanted:
        one = found.get(address)
        if one is None or one.runs == "foreign":
            raise TaxelError(f"board 0x{address:02X}: does not answer; taxel scan shows who does")
        if one.runs == "shared":
            raise TaxelError(f"board 0x{address:02X}: several boards answer; renumber them with taxel provision")
        if firmware.kind and one.kind and one.kind != firmware.kind:
            raise TaxelError(
                f"board 0x{address:02X}: is of kind {one.kind}, but {firmware.source} is for kind {firmware.kind}; "
                "give the file of its kind"
            )
    return wanted


def _announce(console: Console, firmware: Firmware, wanted: list[int], found: dict[int, Found], dry_run: bool) -> None:
    slots = " and ".join(slot_name(image.slot) for image in firmware.images)
    rows = max(len(image.rows()) for image in firmware.images)
    verb = "would be written" if dry_run else "will be written"
    console.print(
        f"{boards(len(wanted))}: {rows} rows of version {dotted(firmware.version)} (slot {slots}) {verb} into each "
        "one's free slot; each restarts twice and does not measure meanwhile"
    )
    for address in wanted:
        console.print(f"  0x{address:02X}  {found[address].version or 'bootloader'} -> {dotted(firmware.version)}")


def _run(
    wire: BoardWire, firmware: Firmware, wanted: list[int], force: bool, console: Console
) -> dict[int, Outcome | TaxelError]:
    with progress_bars(console) as bars:
        tasks: dict[int, TaskID] = {
            address: bars.add_task(f"0x{address:02X} waiting", total=None) for address in wanted
        }

        def report(progress: Progress) -> None:
            task = tasks[progress.address]
            description = f"0x{progress.address:02X} {progress.stage}"
            bars.update(task, description=description, completed=progress.done, total=progress.total or None)

        talks = {address: update(address, firmware, wire.now_s, report, force) for address in wanted}
        return run_all(wire, talks)


def _print(done: list[Outcome]) -> None:
    rows = [
        (
            f"0x{one.address:02X}",
            dotted(one.before),
            dotted(one.after),
            slot_name(one.slot),
            str(one.rows_written),
            str(one.rows_kept),
            f"{one.seconds:.2f} s",
            "confirmed" if one.is_written else "ran it already",
        )
        for one in sorted(done, key=lambda one: one.address)
    ]
    if rows:
        print_table(("board", "from", "to", "slot", "written", "kept", "time", ""), rows)
