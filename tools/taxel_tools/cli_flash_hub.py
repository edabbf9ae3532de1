"""`taxel flash` for the hub."""

from rich.console import Console

from taxel.errors import TaxelError
from taxel_protocol.bootloader import HUBS
from taxel_tools.cli_common import count_boards, make_progress_bars, print_json, print_table
from taxel_tools.cli_flash_checks import confirm_downgrades
from taxel_tools.errors import HUB
from taxel_tools.files import Firmware, format_slot
from taxel_tools.firmware_update import Outcome, Progress, format_version, update_target
from taxel_tools.hub_target import HubTarget
from taxel_tools.open_wire import open_hub_link
from taxel_tools.scheduler import run


def flash_hub(
    url: str, firmware: Firmware, signature: str, force: bool, downgrade: bool, dry_run: bool, as_json: bool
) -> None:
    """Write firmware to the hub over its UART.

    signature: line that names the signer, which is printed. The flags are the options of `taxel flash`. Raises
    `TaxelError` with a one-line message.
    """
    console = Console(stderr=True, soft_wrap=True)
    with open_hub_link(url) as link:
        target = HubTarget(link)
        old_version = run(target.wire, target.read_version())
        before = format_version(old_version) if old_version else "bootloader"
        console.print(signature)
        _announce(console, firmware, before, len(target.polled_addresses), dry_run)
        if dry_run:
            if as_json:
                document = {"hub": format_version(old_version), "boards": target.polled_addresses}
                print_json(document | {"version": format_version(firmware.version)})
            return
        downgrade = confirm_downgrades(firmware, {"the hub": old_version}, downgrade)
        with make_progress_bars(console) as bars:
            task = bars.add_task("hub waiting", total=None)

            def report(progress: Progress) -> None:
                """Show the progress of the firmware update of the hub."""
                bars.update(
                    task, description=f"hub {progress.stage}", completed=progress.done, total=progress.total or None
                )

            try:
                outcome = run(target.wire, update_target(target, firmware, report, force, downgrade))
            except TaxelError as error:
                raise TaxelError(f"not updated: {error}") from None
    if as_json:
        print_json({"done": outcome, "boards": target.polled_addresses})
    else:
        _print_outcome(outcome, len(target.polled_addresses))


def is_hub_update(firmware: Firmware, hub: bool, board: list[str] | None, all_boards: bool) -> bool:
    """Return whether the file is for the hub.

    hub, board, all_boards: options of the command line. Raises `TaxelError` if file and options contradict each other.
    """
    is_for_hub = firmware.device in HUBS
    if hub and not is_for_hub:
        raise TaxelError(
            f"{firmware.source}: expected an image for the hub with --hub, found an image for sensor boards; leave "
            "--hub out"
        )
    if is_for_hub and (board or all_boards):
        raise TaxelError(
            f"{firmware.source}: expected an image for sensor boards, found an image for the hub; leave --board and "
            "--all out, and flash boards with a separate command"
        )
    return is_for_hub


def _announce(console: Console, firmware: Firmware, old_version: str, board_count: int, dry_run: bool) -> None:
    """Print which firmware will be written to the hub, the present version, and how many boards it polls."""
    slots = " and ".join(format_slot(image.slot) for image in firmware.images)
    rows = max(len(image.rows()) for image in firmware.images)
    verb = "would be written" if dry_run else "will be written"
    version = format_version(firmware.version)
    console.print(
        f"the hub: {rows} rows of version {version} (slot {slots}) {verb} to its free slot; the hub restarts three "
        "times and polls no board meanwhile"
    )
    console.print(f"  {old_version} -> {version}, {count_boards(board_count)} polled")


def _print_outcome(outcome: Outcome, board_count: int) -> None:
    """Print the versions, the slot and the written rows of the updated hub."""
    assert outcome.address == HUB
    row = (
        "hub",
        format_version(outcome.before),
        format_version(outcome.after),
        format_slot(outcome.slot),
        str(outcome.rows_written),
        str(outcome.rows_kept),
        f"{outcome.seconds:.2f} s",
        f"{'confirmed' if outcome.is_written else 'unchanged'}, {count_boards(board_count)} polled",
    )
    print_table(("", "from", "to", "slot", "written", "kept", "time", ""), [row])
