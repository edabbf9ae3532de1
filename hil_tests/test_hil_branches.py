"""Faults of one branch of the wiring: its boards stop together, the other branches stream, and all boards return."""

import pytest

from hil_tests.harness.frame_checks import KnownCounts, check_polls, read_frames
from hil_tests.harness.rig import Rig
from taxel.hand.branches import find_silent_branches, format_silent_boards
from taxel.skin import Skin

BRANCH = "index"
WHOLE_CABLE, SCL, SDA, SUPPLY = 0, 1, 2, 3
"""Codes of the conductor to which a fault of a branch applies."""
RETURN_S = 2.0
"""Longest time until all boards stream after the end of the fault: the hub searches lost boards once a second."""

SLOW_PF = 100.0
"""Additional capacitance of the slow branch, picofarads: rise time 302 ns, above the limit of 300 ns at 400 kHz."""

LOCAL_FAULTS = [
    ("branch_open", WHOLE_CABLE, 0.0),
    ("branch_open", SCL, 0.0),
    ("branch_open", SDA, 0.0),
    ("branch_open", SUPPLY, 0.0),
    ("branch_resistance", WHOLE_CABLE, 10e3),
]
SHORTS = [(name, line, 0.0) for name in ("branch_short_ground", "branch_short_supply") for line in (SCL, SDA)]


def inject(rig: Rig, name: str, selection: int = 0, ohm: float = 0.0) -> None:
    """Inject a fault of the branch `BRANCH`, which the address of one of its boards selects."""
    assert rig.faults is not None
    rig.faults.inject(name, rig.hand.find_branch(BRANCH)[0].address, selection, ohm)


def read_streaming_addresses(rig: Rig, skin: Skin, seconds: float) -> set[int]:
    """Return the addresses of the boards whose frames arrive in the second half of the next `seconds`."""
    read_frames(rig, skin, seconds / 2)
    return {frame.address for frame in read_frames(rig, skin, seconds / 2)}


@pytest.mark.needs("faults", "counts")
@pytest.mark.parametrize(("name", "selection", "ohm"), LOCAL_FAULTS)
def test_fault_of_a_branch_stops_only_its_boards_and_they_stream_again_after_its_end(
    rig: Rig, skin: Skin, name: str, selection: int, ohm: float
) -> None:
    counts = KnownCounts(rig)
    all_addresses = {board.address for board in rig.hand.boards}
    branch_addresses = {board.address for board in rig.hand.find_branch(BRANCH)}
    assert read_streaming_addresses(rig, skin, 0.4) == all_addresses
    counts.advance()
    inject(rig, name, selection, ohm)
    streaming = read_streaming_addresses(rig, skin, 0.6)
    assert streaming == all_addresses - branch_addresses
    silent = find_silent_branches(rig.hand, all_addresses - streaming)
    assert silent.branches == (BRANCH,)
    assert f"branch {BRANCH} (all {len(branch_addresses)} boards" in format_silent_boards(rig.hand, silent)
    inject(rig, "branch_restore")
    read_frames(rig, skin, RETURN_S)
    for frame in read_frames(rig, skin, 0.3):
        counts.check_frame(frame)
    assert read_streaming_addresses(rig, skin, 0.4) == all_addresses
    check_polls(skin)


@pytest.mark.needs("faults", "counts")
@pytest.mark.parametrize(("name", "selection", "ohm"), SHORTS)
def test_short_circuit_of_a_branch_stops_all_boards_of_a_passive_star_until_its_end(
    rig: Rig, skin: Skin, name: str, selection: int, ohm: float
) -> None:
    """In a passive star all branches share SCL and SDA, so a shorted line of one branch stops all boards. The hub still
    reports to the host.
    """
    all_addresses = {board.address for board in rig.hand.boards}
    read_frames(rig, skin, 0.3)
    inject(rig, name, selection, ohm)
    assert read_streaming_addresses(rig, skin, 0.6) == set()
    assert skin.hub.seconds_since_message < 2.0
    silent = find_silent_branches(rig.hand, all_addresses)
    assert "disconnect the branches one at a time" in format_silent_boards(rig.hand, silent)
    inject(rig, "branch_restore")
    read_frames(rig, skin, RETURN_S)
    assert read_streaming_addresses(rig, skin, 0.4) == all_addresses


@pytest.mark.needs("faults", "counts")
@pytest.mark.world(wiring="buffered")
@pytest.mark.parametrize(("name", "selection", "ohm"), SHORTS)
def test_short_circuit_of_a_buffered_branch_stops_only_its_boards_until_its_end(
    rig: Rig, skin: Skin, name: str, selection: int, ohm: float
) -> None:
    """A buffer between the hub and each branch separates a shorted branch from the other branches."""
    all_addresses = {board.address for board in rig.hand.boards}
    branch_addresses = {board.address for board in rig.hand.find_branch(BRANCH)}
    read_frames(rig, skin, 0.3)
    inject(rig, name, selection, ohm)
    assert read_streaming_addresses(rig, skin, 0.6) == all_addresses - branch_addresses
    inject(rig, "branch_restore")
    read_frames(rig, skin, RETURN_S)
    assert read_streaming_addresses(rig, skin, 0.4) == all_addresses


@pytest.mark.needs("faults", "counts")
@pytest.mark.world(slow_branch=(BRANCH, SLOW_PF), scl_hz=400e3)
def test_slow_branch_loses_polls_at_400_khz_and_delivers_no_wrong_count(rig: Rig, skin: Skin) -> None:
    """The additional capacitance `SLOW_PF` makes the edges of one branch too slow for 400 kHz: bits are misread, so the
    CRC rejects snapshots. Other branches, such as the palm, lose no poll.
    """
    counts = KnownCounts(rig)
    read_frames(rig, skin, 0.3)
    for frame in read_frames(rig, skin, 1.0):
        counts.check_frame(frame)
    failed = read_failed_polls(rig, skin)
    assert failed[BRANCH] > 0
    assert failed["palm"] == 0


@pytest.mark.needs("faults", "counts")
@pytest.mark.world(slow_branch=(BRANCH, SLOW_PF), scl_hz=100e3)
def test_slow_branch_loses_no_poll_at_100_khz(rig: Rig, skin: Skin) -> None:
    """The rise time of the slow branch (302 ns) is within the limit of 100 kHz (1000 ns), so no bit is misread."""
    counts = KnownCounts(rig)
    read_frames(rig, skin, 0.3)
    for frame in read_frames(rig, skin, 1.0):
        counts.check_frame(frame)
    assert set(read_failed_polls(rig, skin).values()) == {0}


def read_failed_polls(rig: Rig, skin: Skin) -> dict[str, int]:
    """Return the number of failed polls of each branch: NACKs, CRC errors and timeouts."""
    skin.hub.read_status()
    failed = dict.fromkeys(rig.hand.branches, 0)
    for board in rig.hand.boards:
        status = skin.hub.board_status[board.address]
        failed[str(board.branch)] += sum(status[name] for name in ("nacks", "crc_errors", "timeouts"))
    return failed
