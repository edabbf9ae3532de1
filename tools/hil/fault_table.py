"""Write docs/faults-on-the-wires.md from measurements on the virtual rig: `python tools/hil/fault_table.py`."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(REPOSITORY))

from hil_tests.harness.fault_cases import CASES, FaultCase  # noqa: E402
from hil_tests.harness.rig import opened  # noqa: E402
from hil_tests.harness.rig_file import load_rig  # noqa: E402
from hil_tests.harness.watching import OUTCOMES, KnownCounts, board_at, counters_of, watch  # noqa: E402
from taxel.skin import Skin  # noqa: E402
from taxel.stream import TaxelFrame  # noqa: E402

TEMPLATE = Path(__file__).with_name("faults-on-the-wires.template.md")
PAGE = REPOSITORY / "docs" / "faults-on-the-wires.md"
BOARD_NUMBER = 4
COUNTERS = (*(name for name in OUTCOMES if name not in {"forwarded", "repeated"}), "retries")


def row(case: FaultCase) -> str:
    """Measured row of the table."""
    with opened(load_rig("virtual"), {}, counts=True) as rig, Skin(rig.uart.link(), rig.hand) as skin:
        address = board_at(rig.hand, BOARD_NUMBER)
        watch(rig, skin, 0.3)
        KnownCounts(rig)
        before = counters_of(skin, address)
        watch(rig, skin, 0.05)
        last_step_s = case.inject(rig, skin, address)
        frames = watch(rig, skin, 2.5)
        after = counters_of(skin, address)
        assert rig.faults is not None
        fault_end_s = max(last_step_s, *(strike.time_s for strike in rig.faults.strikes()))
        missing = skin.losses.boards[address].missing
        counted = "the counters restart at 0" if case.restarts else _increments(before, after)
        if skin.losses.lost_on_wire:
            counted = ", ".join(filter(None, [counted, f"lost on the wire {skin.losses.lost_on_wire}"]))
        recovery = _recovery_ms(case, frames, address, fault_end_s)
    return f"| {case.name} | {case.hub} | {case.host} | {counted or 'nothing'} | {missing} | {recovery} |\n"


def _increments(before: dict[str, int], after: dict[str, int]) -> str:
    return ", ".join(f"{name} {after[name] - before[name]}" for name in COUNTERS if after[name] > before[name])


def _recovery_ms(case: FaultCase, frames: Sequence[TaxelFrame], address: int, fault_end_s: float) -> str:
    own = [frame for frame in frames if frame.address == address]
    if case.restarts:  # the clock of the hub restarts with its power
        own = own[[frame.hub_time_us for frame in own].index(min(frame.hub_time_us for frame in own)) :]
        return f"{own[0].hub_time_us / 1e3:.0f} after power-on"
    recovery_start_s = fault_end_s + case.ends_s
    times_s = [frame.hub_time_us / 1e6 for frame in own]
    return f"{1e3 * (min(time_s for time_s in times_s if time_s >= recovery_start_s) - recovery_start_s):.0f}"


def main() -> int:
    """Write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=PAGE)
    options = parser.parse_args()
    rows = "".join(row(case) for case in CASES)
    options.out.write_text(TEMPLATE.read_text().replace("{rows}", rows))
    print(options.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
