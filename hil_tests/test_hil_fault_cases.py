"""Whatever goes wrong on the wires: every delivered count is right, every poll is counted, and frames flow again."""

import pytest

from hil_tests.harness.fault_cases import CASES, FaultCase
from hil_tests.harness.rig import Rig
from hil_tests.harness.watching import (
    KnownCounts,
    board_at,
    check_order,
    check_polls,
    counters_of,
    cycles_until,
    watch,
)
from taxel.skin import Skin

STRUCK = 4  # the hand's board number
AT_MOST_CYCLES = 2
ERRORS = ("nacks", "timeouts", "crc_errors", "bus_errors", "dropped", "retries")


@pytest.mark.needs("faults", "counts")
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_a_fault_never_makes_a_wrong_count_and_is_over_when_it_is_over(rig: Rig, skin: Skin, case: FaultCase) -> None:
    address = board_at(rig.hand, STRUCK)
    counts = KnownCounts(rig)
    watch(rig, skin, 0.3)
    before = counters_of(skin, address)
    others_before = {board.address: counters_of(skin, board.address) for board in rig.hand.boards[:2]}
    frames = watch(rig, skin, 0.05)
    counts.go_on()
    last_step_s = case.inject(rig, skin, address)
    frames += watch(rig, skin, 0.5)
    counts.go_on()
    frames += watch(rig, skin, 1.0)
    for frame in frames:
        if frame.hub_time_us > 0.4e6 or not case.restarts:
            counts.check(frame)
    if not case.restarts:
        check_order(frames)
    after = counters_of(skin, address)
    if case.restarts:
        assert skin.losses.restarts == 1
    else:
        check_polls(skin)
        risen = {name for name in ERRORS if after[name] > before[name]}
        assert risen <= set(case.counters), f"of {address:#x} rose {risen}"
        if not case.is_bus_wide:
            for other, counted in others_before.items():
                now = counters_of(skin, other)
                assert {name: now[name] for name in ERRORS} == {name: counted[name] for name in ERRORS}
    assert (skin.losses.lost_on_wire > 0) == case.loses_on_wire
    assert skin.losses.boards[address].missing <= case.costs
    assert {frame.address for frame in frames[-40:]} == {board.address for board in rig.hand.boards}
    if not (case.restarts or case.is_bus_wide):
        assert rig.faults is not None
        over_s = max(last_step_s, *(strike.time_s for strike in rig.faults.strikes())) + case.ends_s
        assert cycles_until(frames, address, 1e6 * over_s) <= AT_MOST_CYCLES
