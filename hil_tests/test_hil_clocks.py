"""Clocks of boards and hub that drift and wrap, and sequence numbers that wrap."""

import numpy as np
import pytest

from hil_tests.harness.frame_checks import KnownCounts, check_order, check_polls, get_address, read_frames
from hil_tests.harness.rig import Rig
from taxel.skin import Skin

WRAP_S = 2**32 / 1e6
"""Time after which a clock of 32 bits in microseconds wraps, seconds."""
CYCLE_AND_SCAN_S = 0.1
"""Largest difference between the host times of two frames of one cycle, seconds: the time of a cycle and a scan."""


def check_no_losses(skin: Skin) -> None:
    """Check that no frame was lost, no processor restarted, and the hub reported no fault."""
    check_polls(skin)
    assert skin.losses.lost_on_wire == 0
    assert skin.losses.restarts == 0
    assert all(count.missing == 0 for count in skin.losses.boards.values())
    assert not skin.hub.faults


@pytest.mark.needs("counts", "clocks")
@pytest.mark.world(lines=[f"clock_start {{{index}}} {WRAP_S - 1.0 - 0.05 * index!r}" for index in range(17)])
def test_wrap_of_the_board_clocks_loses_no_frame(rig: Rig, skin: Skin) -> None:
    """The boards' clocks wrap 1.0 to 1.8 s after power-up, each at another time, while frames are read."""
    read_frames(rig, skin, 0.2)
    counts = KnownCounts(rig)
    read_frames(rig, skin, 0.2)
    frames = read_frames(rig, skin, 1.5)
    for frame in frames:
        counts.check_frame(frame)
    times = np.array([frame.board_time_us for frame in frames if frame.address == get_address(rig.hand, 0)])
    assert (np.diff(times) < 0).sum() == 1  # the clock wrapped
    for board in rig.hand.boards:  # the host's times increase across the wrap
        assert (np.diff([frame.time_s for frame in frames if frame.address == board.address]) > 0).all()
    check_no_losses(skin)


@pytest.mark.needs("clocks")
@pytest.mark.world(lines=[f"hub_clock_start_us {2**32 - 900_000}"])
def test_wrap_of_the_hub_clock_loses_no_frame(rig: Rig, skin: Skin) -> None:
    """The 32-bit clock of the hub (us) wraps 0.9 s after power-up; the host's times increase across the wrap."""
    frames = read_frames(rig, skin, 2.0)
    times = np.array([frame.hub_time_us for frame in frames])
    assert (np.diff(times) < 0).sum() == 1
    assert (np.diff([frame.time_s for frame in frames if frame.address == get_address(rig.hand, 5)]) > 0).all()
    check_order(frames)
    check_no_losses(skin)


@pytest.mark.needs("hours")
@pytest.mark.world(only=[0], scan={"sub_conversions": 8}, scl_hz=1e6)
def test_wrap_of_the_scan_sequence_loses_no_frame(rig: Rig, skin: Skin) -> None:
    """One board with short scans performs 65,536 scans in a few hundred virtual seconds."""
    address = get_address(rig.hand, 0)
    skin.hub.set_rate(2.0)
    wraps, last = 0, None
    while wraps == 0 and rig.clock.now_s() < 2000.0:
        for frame in read_frames(rig, skin, 20.0):
            wraps += last is not None and frame.sequence < last
            last = frame.sequence
            assert frame.address == address
    assert wraps == 1
    read_frames(rig, skin, 2.0)
    check_no_losses(skin)


@pytest.mark.world(clock_spread_ppm=20000.0, hub_clock_ppm=15000.0)
def test_host_times_of_boards_with_different_clock_rates_agree(rig: Rig, skin: Skin) -> None:
    """Clocks that differ by up to 2 % (boards) and 1.5 % (hub) get common host times after 4 s of measurement."""
    frames = read_frames(rig, skin, 6.0)
    check_no_losses(skin)
    late_frames = [frame for frame in frames if frame.hub_time_us > 4e6]
    for board in rig.hand.boards:
        board_frames = [frame for frame in late_frames if frame.address == board.address]
        board_s = np.array([frame.board_time_us for frame in board_frames]) / 1e6
        host_s = np.array([frame.time_s for frame in board_frames])
        rate = np.polyfit(host_s, board_s, 1)[0]
        assert 0.975 < rate < 1.025
    for cycle in {frame.cycle for frame in late_frames}:  # frames of one cycle have similar host times
        times_s = [frame.time_s for frame in late_frames if frame.cycle == cycle]
        assert max(times_s) - min(times_s) < CYCLE_AND_SCAN_S
    assert skin.is_synchronised(get_address(rig.hand, 0))


@pytest.mark.world(effects=["clock wander ppm=5000 period=3"])
def test_drifting_board_clock_is_not_reported_as_a_restart(rig: Rig, skin: Skin) -> None:
    read_frames(rig, skin, 6.0)
    check_no_losses(skin)
