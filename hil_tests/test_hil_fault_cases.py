"""Each fault of the wires: delivered counts are correct, all polls are counted, and streaming resumes."""

import pytest

from hil_tests.harness.fault_cases import CASES, FaultCase
from hil_tests.harness.frame_checks import (
    KnownCounts,
    check_order,
    check_polls,
    count_cycles_until_frame,
    get_address,
    read_counters,
    read_frames,
)
from hil_tests.harness.rig import Rig
from taxel.skin import Skin

BOARD_INDEX = 4  # the board of the hand that has the fault
RECOVERY_CYCLES = 2
ERRORS = ("nacks", "timeouts", "crc_errors", "bus_errors", "dropped", "retries")

PARAMETERS = [
    pytest.param(case, id=case.name, marks=[pytest.mark.needs("uart_faults")] if case.is_of_uart else [])
    for case in CASES
]


@pytest.mark.needs("faults", "counts")
@pytest.mark.parametrize("case", PARAMETERS)
def test_fault_causes_no_wrong_count_and_streaming_resumes_after_its_end(rig: Rig, skin: Skin, case: FaultCase) -> None:
    """While a fault of one board or wire is active, every delivered frame has counts that the test set.

    Only the counters of `case` increase, only at the board with the fault, and at most `case.max_missing` frames are
    lost. After the end of the fault, the board streams again within `RECOVERY_CYCLES` poll cycles. Exceptions: a
    restart of the hub resets its counters and its clock; a fault of the whole bus also affects other boards.
    """
    address = get_address(rig.hand, BOARD_INDEX)
    counts = KnownCounts(rig)
    read_frames(rig, skin, 0.3)
    before = read_counters(skin, address)
    others_before = {board.address: read_counters(skin, board.address) for board in rig.hand.boards[:2]}
    frames = read_frames(rig, skin, 0.05)
    counts.advance()
    last_step_s = case.inject(rig, skin, address)
    frames += read_frames(rig, skin, 0.5)
    counts.advance()
    frames += read_frames(rig, skin, 1.0)
    for frame in frames:
        # The clock of a restarted hub begins at 0: frames of a hub's first 0.4 s are not checked.
        if frame.hub_time_us > 0.4e6 or not case.restarts:
            counts.check_frame(frame)
    if not case.restarts:
        check_order(frames)
    after = read_counters(skin, address)
    if case.restarts:
        assert skin.losses.restarts == 1
    else:
        check_polls(skin)
        increased = {name for name in ERRORS if after[name] > before[name]}
        assert increased <= set(case.counters), f"board {address:#x}: {increased} increased"
        if not case.is_bus_wide:
            for other_address, counters_before in others_before.items():
                counters = read_counters(skin, other_address)
                assert all(counters[name] == counters_before[name] for name in ERRORS)
    assert (skin.losses.lost_on_wire > 0) == case.loses_on_wire
    assert skin.losses.boards[address].missing <= case.max_missing
    assert {frame.address for frame in frames[-40:]} == {board.address for board in rig.hand.boards}
    if not (case.restarts or case.is_bus_wide):
        assert rig.faults is not None
        end_s = max(last_step_s, *(event.time_s for event in rig.faults.read_events())) + case.ends_s
        assert count_cycles_until_frame(frames, address, 1e6 * end_s) <= RECOVERY_CYCLES
