"""`taxel flash` for the hub itself."""

from __future__ import annotations

from rich.console import Console

from taxel.errors import TaxelError
from taxel_protocol.bootloader import LAYOUTS, BootDevice
from taxel_tools.cli_words import boards, print_json, print_table, progress_bars
from taxel_tools.errors import HUB
from taxel_tools.files import Firmware, slot_name
from taxel_tools.hub_target import HubTarget
from taxel_tools.interleave import run
from taxel_tools.open_wire import open_hub_link
from taxel_tools.program import Outcome, Progress, dotted, update_target


def flash_hub(url: str, firmware: Firmware, force: bool, dry_run: bool, as_json: bool) -> None:
    """Give the hub new firmware over its UART. Raises `TaxelError` of one line."""
    console = Console(stderr=True, soft_wrap=True)
    with open_hub_link(url) as link:
        target = HubTarget(link)
        before = run(target.wire, target.version())
        _announce(console, firmware, dotted(before) if before else "bootloader", len(target.boards), dry_run)
        if dry_run:
            if as_json:
                print_json({"hub": dotted(before), "boards": target.boards, "version": dotted(firmware.version)})
            return
        with progress_bars(console) as bars:
            task = bars.add_task("hub waiting", total=None)

            def report(progress: Progress) -> None:
                bars.update(
                    task, description=f"hub {progress.stage}", completed=progress.done, total=progress.total or None
                )

            try:
                done = run(target.wire, update_target(target, firmware, report, force))
            except TaxelError as error:
                raise TaxelError(f"not updated: {error}") from None
    if as_json:
        print_json({"done": done, "boards": target.boards})
    else:
        _print(done, len(target.boards))


def check_hub_words(firmware: Firmware, hub: bool, board: list[str] | None, every: bool) -> bool:
    """Whether the hub is meant; raises `TaxelError` if file and options do not agree."""
    is_for_hub = firmware.device == BootDevice.HUB
    if hub and not is_for_hub:
        raise TaxelError(f"{firmware.source}: is an image for sensor boards; --hub takes one for the hub")
    if is_for_hub and (board or every):
        raise TaxelError(
            f"{firmware.source}: is an image for the hub; leave --board and --all out, and flash boards by themselves"
        )
    return is_for_hub


def _announce(console: Console, firmware: Firmware, before: str, polled: int, dry_run: bool) -> None:
    slots = " and ".join(slot_name(image.slot) for image in firmware.images)
    rows = max(len(image.rows()) for image in firmware.images)
    assert rows <= LAYOUTS[BootDevice.HUB].slot_rows
    verb = "would be written" if dry_run else "will be written"
    console.print(
        f"the hub: {rows} rows of version {dotted(firmware.version)} (slot {slots}) {verb} into its free slot; it "
        f"restarts three times and polls no board meanwhile"
    )
    console.print(f"  {before} -> {dotted(firmware.version)}, {boards(polled)} polled")


def _print(done: Outcome, polled: int) -> None:
    assert done.address == HUB
    row = (
        "hub",
        dotted(done.before),
        dotted(done.after),
        slot_name(done.slot),
        str(done.rows_written),
        str(done.rows_kept),
        f"{done.seconds:.2f} s",
        f"{'confirmed' if done.is_written else 'ran it already'}, {boards(polled)} polled",
    )
    print_table(("", "from", "to", "slot", "written", "kept", "time", ""), [row])
