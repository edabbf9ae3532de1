"""Clocks that drift apart and wrap, sequences that wrap."""

import numpy as np
import pytest

from hil_tests.harness.rig import Rig
from hil_tests.harness.watching import KnownCounts, board_at, check_order, check_polls, watch
from taxel.skin import Skin

WRAP_S = 2**32 / 1e6
CYCLE_AND_SCAN_S = 0.1


def check_nothing_was_lost(skin: Skin) -> None:
    check_polls(skin)
    assert skin.losses.lost_on_wire == 0
    assert skin.losses.restarts == 0
    assert all(count.missing == 0 for count in skin.losses.boards.values())
    assert not skin.hub.faults


@pytest.mark.needs("counts", "clocks")
@pytest.mark.world(lines=[f"clock_start {{{place}}} {WRAP_S - 1.0 - 0.05 * place!r}" for place in range(17)])
def test_board_clocks_that_wrap_cost_nothing(rig: Rig, skin: Skin) -> None:
    watch(rig, skin, 0.2)
    counts = KnownCounts(rig)
    watch(rig, skin, 0.2)
    frames = watch(rig, skin, 1.5)
    for frame in frames:
        counts.check(frame)
    times = np.array([frame.board_time_us for frame in frames if frame.address == board_at(rig.hand, 0)])
    assert (np.diff(times) < 0).sum() == 1  # it did wrap
    for board in rig.hand.boards:  # and the host's times did not
        assert (np.diff([frame.time_s for frame in frames if frame.address == board.address]) > 0).all()
    check_nothing_was_lost(skin)


@pytest.mark.needs("clocks")
@pytest.mark.world(lines=[f"hub_clock_start_us {2**32 - 900_000}"])
def test_a_hub_clock_that_wraps_costs_nothing(rig: Rig, skin: Skin) -> None:
    frames = watch(rig, skin, 2.0)
    times = np.array([frame.hub_time_us for frame in frames])
    assert (np.diff(times) < 0).sum() == 1
    assert (np.diff([frame.time_s for frame in frames if frame.address == board_at(rig.hand, 5)]) > 0).all()
    check_order(frames)
    check_nothing_was_lost(skin)


@pytest.mark.needs("hours")
@pytest.mark.world(only=[0], scan={"sub_conversions": 8}, scl_hz=1e6)
def test_sequences_of_scans_that_wrap_cost_nothing(rig: Rig, skin: Skin) -> None:
    """One board with short scans: 65,536 of them in a few hundred virtual seconds."""
    address = board_at(rig.hand, 0)
    skin.hub.set_rate(2.0)
    wraps, last = 0, None
    while wraps == 0 and rig.clock.now_s() < 2000.0:
        for frame in watch(rig, skin, 20.0):
            wraps += last is not None and frame.sequence < last
            last = frame.sequence
            assert frame.address == address
    assert wraps == 1
    watch(rig, skin, 2.0)
    check_nothing_was_lost(skin)


@pytest.mark.world(clock_spread_ppm=20000.0, hub_clock_ppm=15000.0)
def test_boards_whose_clocks_drift_apart_stay_on_one_time(rig: Rig, skin: Skin) -> None:
    frames = watch(rig, skin, 6.0)
    check_nothing_was_lost(skin)
    late = [frame for frame in frames if frame.hub_time_us > 4e6]
    for board in rig.hand.boards:
        own = [frame for frame in late if frame.address == board.address]
        board_s = np.array([frame.board_time_us for frame in own]) / 1e6
        host_s = np.array([frame.time_s for frame in own])
        rate = np.polyfit(host_s, board_s, 1)[0]
        assert 0.975 < rate < 1.025
    for cycle in {frame.cycle for frame in late}:  # the skin at one time
        begun_s = [frame.time_s for frame in late if frame.cycle == cycle]
        assert max(begun_s) - min(begun_s) < CYCLE_AND_SCAN_S
    assert skin.is_synchronised(board_at(rig.hand, 0))


@pytest.mark.world(effects=["clock wander ppm=5000 period=3"])
def test_a_clock_that_wanders_is_no_restart(rig: Rig, skin: Skin) -> None:
    watch(rig, skin, 6.0)
    check_nothing_was_lost(skin)
