"""Measure each fault case on the virtual rig and write docs/faults-on-the-wires.md."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from taxel.output import write_whole

REPOSITORY = Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(REPOSITORY))

from hil_tests.harness.fault_cases import CASES, FaultCase  # noqa: E402
from hil_tests.harness.frame_checks import (  # noqa: E402
    OUTCOMES,
    KnownCounts,
    get_address,
    read_counters,
    read_frames,
)
from hil_tests.harness.rig import open_rig  # noqa: E402
from hil_tests.harness.rig_file import load_rig  # noqa: E402
from hil_tests.harness.virtual.world import WorldBuild  # noqa: E402
from taxel.skin import Skin  # noqa: E402
from taxel.stream import TaxelFrame  # noqa: E402

TEMPLATE = Path(__file__).with_name("faults-on-the-wires.template.md")
PAGE = REPOSITORY / "docs" / "faults-on-the-wires.md"
BOARD_INDEX = 4
"""The board of the hand that has the fault."""
COUNTERS = (*(name for name in OUTCOMES if name not in {"forwarded", "repeated"}), "retries")


def measure_row(case: FaultCase) -> str:
    """Inject a fault case on the virtual rig and return its row of the Markdown table.

    The row states the reaction of hub and host, the counters that increase, the number of missing frames of the board,
    and the recovery time.
    """
    build = WorldBuild(has_known_counts=True)
    with open_rig(load_rig("virtual"), build) as rig, Skin(rig.uart.open_link(), rig.hand) as skin:
        address = get_address(rig.hand, BOARD_INDEX)
        read_frames(rig, skin, 0.3)
        KnownCounts(rig)  # sets distinct counts on all taxels, so that every damaged count is detected
        counters_before = read_counters(skin, address)
        read_frames(rig, skin, 0.05)
        last_step_s = case.inject(rig, skin, address)
        frames = read_frames(rig, skin, 2.5)
        counters_after = read_counters(skin, address)
        assert rig.faults is not None
        effect_s = max(last_step_s, *(event.time_s for event in rig.faults.read_events()))
        missing = skin.losses.boards[address].missing
        counted = "the counters restart at 0" if case.restarts else _format_increases(counters_before, counters_after)
        if skin.losses.lost_on_wire:
            counted = ", ".join(filter(None, [counted, f"lost on the wire {skin.losses.lost_on_wire}"]))
        recovery = _measure_recovery(case, frames, address, effect_s)
    return f"| {case.name} | {case.hub} | {case.host} | {counted or 'nothing'} | {missing} | {recovery} |\n"


def _format_increases(before: dict[str, int], after: dict[str, int]) -> str:
    """Return the hub's counters that have increased, and by how much, as a text; "" if there are none.

    before, after: counters by name.
    """
    return ", ".join(f"{name} {after[name] - before[name]}" for name in COUNTERS if after[name] > before[name])


def _measure_recovery(case: FaultCase, frames: Sequence[TaxelFrame], address: int, effect_s: float) -> str:
    """Return the time in milliseconds from the end of a fault to the board's next frame, as a text.

    After a restart of the hub it is the time from power-on to the first frame. effect_s: time in seconds at which the
    fault took effect.
    """
    own_frames = [frame for frame in frames if frame.address == address]
    if case.restarts:  # the hub's clock restarted at 0
        times_us = [frame.hub_time_us for frame in own_frames]
        return f"{min(times_us) / 1e3:.0f} after power-on"
    end_s = effect_s + case.ends_s
    times_s = [frame.hub_time_us / 1e6 for frame in own_frames]
    return f"{1e3 * min(time_s - end_s for time_s in times_s if time_s >= end_s):.0f}"


def main() -> int:
    """Measure all fault cases on the virtual rig and write docs/faults-on-the-wires.md."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=PAGE)
    options = parser.parse_args()
    rows = "".join(measure_row(case) for case in CASES)
    write_whole(options.out, TEMPLATE.read_text().replace("{rows}", rows))
    print(options.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
