"""The command `taxel flash`."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import TaskID

from taxel.errors import TaxelError
from taxel_tools.cli_common import URL_HELP, count_boards, make_progress_bars, parse_address, print_json, print_table
from taxel_tools.cli_flash_checks import confirm_downgrades, require_signature
from taxel_tools.cli_flash_hub import flash_hub, is_hub_update
from taxel_tools.cli_flash_swd import flash_swd
from taxel_tools.files import Firmware, format_slot, load_firmware
from taxel_tools.firmware_update import Outcome, Progress, format_version, has_one_slot, parse_version, update_board
from taxel_tools.open_wire import open_wire, reject_original_hub
from taxel_tools.scan import BusDevice, scan_bus
from taxel_tools.scheduler import run_all
from taxel_tools.wires import BoardWire


def flash_command(
    url: Annotated[str, typer.Argument(help=URL_HELP + " With --swd: the .hex file.")],
    files: Annotated[
        list[Path] | None, typer.Argument(help=".cyacd, .hex, .bin or a manifest; one file for each slot.")
    ] = None,
    board: Annotated[list[str] | None, typer.Option(help="Address of a board; may be repeated.")] = None,
    all_boards: Annotated[bool, typer.Option("--all", help="Every board on the bus of the file's kind.")] = False,
    hub: Annotated[bool, typer.Option("--hub", help="The hub; optional, as the file states its device.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Write even if the board runs this image already.")] = False,
    downgrade: Annotated[bool, typer.Option("--downgrade", help="Replace a newer version by an older one.")] = False,
    trust: Annotated[
        list[Path] | None, typer.Option(help="Public key (.pub) of a trusted signer; may be repeated.")
    ] = None,
    unsigned: Annotated[bool, typer.Option("--unsigned", help="Write files without a trusted signature.")] = False,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Check files and boards; write nothing.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    swd: Annotated[bool, typer.Option("--swd", help="Program a blank board through its debug port; no URL.")] = False,
    swd_tool: Annotated[str | None, typer.Option(help="openocd or pyocd; default: the first on the PATH.")] = None,
    swd_interface: Annotated[str | None, typer.Option(help="OpenOCD's name of the probe; default: cmsis-dap.")] = None,
) -> None:
    """Write firmware to boards or to the hub: several boards at once, read back, started and confirmed.

    On a device with two slots, only the slot that is not in use is written, and a device whose new image does not
    confirm itself returns to the previous image. A board with 16 KiB of flash has one slot: the update overwrites the
    image in use. An interrupted update is resumed by running the command again. A file for the hub is written to the
    hub over its UART. Use --swd for a board without a bootloader. Each file needs a signature of a trusted key in a
    file with the suffix .sig beside it (taxel sign); emulated boards also accept the development key.

    Example: taxel flash serial:///dev/ttyUSB0 fingertip-a.cyacd fingertip-b.cyacd --all --dry-run
    """
    if swd:
        if board or all_boards or hub or force:
            raise TaxelError(
                "flash: --swd programs the board on the probe; leave --board, --all, --hub and --force out"
            )
        flash_swd([Path(url), *(files or [])], swd_tool, swd_interface, trust or [], unsigned, dry_run, as_json)
        return
    reject_original_hub(url)
    if not files:
        raise TaxelError("flash: expected firmware files after the URL, found none; use --swd FILE for a blank board")
    if (bool(board) and all_boards) or (hub and (board or all_boards)):
        raise TaxelError("flash: expected one of --board ADDRESS (repeatable), --all and --hub, found several")
    firmware = load_firmware(files)
    is_for_hub = is_hub_update(firmware, hub, board, all_boards)
    if not (is_for_hub or board or all_boards):
        raise TaxelError("flash: expected --board ADDRESS (repeatable) or --all, found neither")
    console = Console(stderr=True, soft_wrap=True)
    signature = require_signature(url, firmware, trust or [], unsigned)
    if is_for_hub:
        flash_hub(url, firmware, signature, force, downgrade, dry_run, as_json)
        return
    with open_wire(url) as wire:
        devices = {device.address: device for device in scan_bus(wire)}
        addresses = _select_boards(firmware, devices, board)
        console.print(signature)
        _announce(console, firmware, addresses, devices, dry_run)
        if dry_run:
            if as_json:
                boards = [devices[address] for address in addresses]
                print_json({"boards": boards, "version": format_version(firmware.version)})
            return
        running = {f"0x{address:02X}": parse_version(devices[address].version) for address in addresses}
        downgrade = confirm_downgrades(firmware, running, downgrade)
        results = _run_updates(wire, firmware, addresses, force, downgrade, console)
    failed = {address: result for address, result in results.items() if isinstance(result, TaxelError)}
    outcomes = [result for result in results.values() if not isinstance(result, TaxelError)]
    if as_json:
        print_json({"done": outcomes, "failed": {f"0x{address:02X}": str(error) for address, error in failed.items()}})
    else:
        _print_outcomes(outcomes)
    if failed:
        lines = "; ".join(str(error) for error in failed.values())
        raise TaxelError(f"not updated: {len(failed)} of {count_boards(len(results))}: {lines}")


def _select_boards(firmware: Firmware, devices: dict[int, BusDevice], board: list[str] | None) -> list[int]:
    """Select the I2C addresses of the boards to update.

    devices: devices found on the bus, by address. board: addresses from the command line; None selects all boards for
    which the firmware is made. Raises `TaxelError` for a missing board or a board of another kind.
    """
    if board is None:
        boards = [device for device in devices.values() if device.runs in ("application", "bootloader")]
        addresses = [board.address for board in boards if not firmware.kind or board.kind in (0, firmware.kind)]
        if not addresses:
            raise TaxelError(
                f"{firmware.source}: expected a board of kind {firmware.kind} on the bus, found none; run taxel scan"
            )
        return addresses
    addresses = list(dict.fromkeys(parse_address(text, "--board") for text in board))
    for address in addresses:
        device = devices.get(address)
        if device is None or device.runs == "foreign":
            raise TaxelError(f"board 0x{address:02X}: does not answer; run taxel scan to list the boards")
        if device.runs == "shared":
            raise TaxelError(
                f"board 0x{address:02X}: several boards answer; assign different addresses with taxel provision"
            )
        if firmware.kind and device.kind and device.kind != firmware.kind:
            raise TaxelError(
                f"board 0x{address:02X}: the board is of kind {device.kind}, but {firmware.source} is for kind "
                f"{firmware.kind}; use the file for this kind"
            )
    return addresses


def _announce(
    console: Console, firmware: Firmware, addresses: list[int], devices: dict[int, BusDevice], dry_run: bool
) -> None:
    """Print which firmware will be written, and the present and new version of each board."""
    slots = " and ".join(format_slot(image.slot) for image in firmware.images)
    rows = max(len(image.rows()) for image in firmware.images)
    version = format_version(firmware.version)
    verb = "would be written" if dry_run else "will be written"
    target = "over the only image" if has_one_slot(firmware.device) else "to the free slot"
    console.print(
        f"{count_boards(len(addresses))}: {rows} rows of version {version} (slot {slots}) {verb} {target} of "
        "each board; each board restarts twice and does not measure meanwhile"
    )
    if has_one_slot(firmware.device):
        console.print(
            "keep the power on: a board whose update is interrupted has no application until the command is repeated"
        )
    for address in addresses:
        console.print(f"  0x{address:02X}  {devices[address].version or 'bootloader'} -> {version}")


def _run_updates(
    wire: BoardWire, firmware: Firmware, addresses: list[int], force: bool, downgrade: bool, console: Console
) -> dict[int, Outcome | TaxelError]:
    """Update all boards at once with progress bars; return the outcome or the error of each board, by address."""
    with make_progress_bars(console) as bars:
        tasks: dict[int, TaskID] = {
            address: bars.add_task(f"0x{address:02X} waiting", total=None) for address in addresses
        }

        def report(progress: Progress) -> None:
            """Show the progress of the firmware update of one board."""
            task = tasks[progress.address]
            description = f"0x{progress.address:02X} {progress.stage}"
            bars.update(task, description=description, completed=progress.done, total=progress.total or None)

        procedures = {
            address: update_board(address, firmware, wire.now_s, report, force, downgrade) for address in addresses
        }
        return run_all(wire, procedures)


def _print_outcomes(outcomes: list[Outcome]) -> None:
    """Print one row for each updated board."""
    rows = [
        (
            f"0x{outcome.address:02X}",
            format_version(outcome.before),
            format_version(outcome.after),
            format_slot(outcome.slot),
            str(outcome.rows_written),
            str(outcome.rows_kept),
            f"{outcome.seconds:.2f} s",
            "confirmed" if outcome.is_written else "unchanged",
        )
        for outcome in sorted(outcomes, key=lambda outcome: outcome.address)
    ]
    if rows:
        print_table(("board", "from", "to", "slot", "written", "kept", "time", ""), rows)
