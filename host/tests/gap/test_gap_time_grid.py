"""Time bins of two datasets whose contacts have different durations."""

from __future__ import annotations

import h5py
import numpy as np
import pytest

from taxel.gap.data.pair import read_pair
from taxel.gap.data.time_grid import TimeGrid, choose_duration
from taxel.gap.diagnosis import diagnose
from taxel.recording.grasp_format import Phase

pytestmark = pytest.mark.slow

FAST_APPROACH = "press_2"


@pytest.mark.parametrize(
    ("durations", "compared_duration"),
    [
        ([1.0, 1.05, 1.1], 1.0),  # differences of one frame
        ([0.7, 1.0, 1.3], 1.3),
        ([0.9, 1.0, 1.0, 8.0], 1.5),  # one long contact must not widen the bins of all others
    ],
)
def test_the_compared_duration_of_a_phase_follows_the_majority_of_grasps(durations, compared_duration):
    assert choose_duration(np.array(durations)) == pytest.approx(compared_duration)


def test_features_after_the_end_of_a_phase_are_unknown():
    time_grid = TimeGrid.from_durations({Phase.CLOSING: 1.2, Phase.HOLD: 1.0}, 20.0)
    is_after_end = time_grid.find_nodes_beyond({Phase.CLOSING: np.array([1.2, 0.7]), Phase.HOLD: np.array([1.0, 1.0])})
    assert not is_after_end[0].any()
    closing = time_grid.phase == Phase.CLOSING
    # The bins of the closing phase end at 0.3, 0.6, 0.9 and 1.2 s. A closing of 0.7 s completes only the first two.
    assert (is_after_end[1, closing] == (time_grid.begin[closing] > 0.55)).all()
    assert not is_after_end[1, ~closing].any()


@pytest.fixture
def write_uneven_world(write_world, tmp_path):
    """Function that writes a world in which the contacts of one approach close in half the time."""

    def write(**changes):
        paths = write_world(tmp_path, **changes)
        for path in paths:
            with h5py.File(path, "r+") as file:
                for grasp in file["grasps"].values():
                    if grasp.attrs["approach"] == FAST_APPROACH:
                        phase = grasp["phase"][:]
                        phase[120:130] = Phase.HOLD
                        grasp["phase"][...] = phase
        return paths

    return write


def test_grasps_with_faster_closing_are_compared_while_they_close(write_uneven_world):
    pair = read_pair(*write_uneven_world())
    closing = pair.time_grid.phase == Phase.CLOSING
    assert pair.time_grid.end[closing].max() == pytest.approx(1.0, abs=0.06)
    faster = [name for _, name in pair.conditions].index(FAST_APPROACH)
    for one in (pair.real, pair.sim):
        known = np.isfinite(one.node_signal_counts[:, closing]).all(axis=2)
        assert known[one.condition != faster].all()
        assert known[one.condition == faster].any(axis=1).all()
        assert not known[one.condition == faster].all(axis=1).any()


def test_latency_of_a_board_is_found_despite_different_closing_speeds(write_uneven_world):
    def delay_second_board(force, signal_counts):
        delayed = signal_counts.copy()
        delayed[4:, 30:] = signal_counts[:-4, 30:]
        return delayed

    verdict = diagnose(*write_uneven_world(effect=delay_second_board)).report["verdict"]
    assert verdict["effects"][0] == "latency"
    assert verdict["status"] == "explained"


def test_different_closing_speeds_in_both_files_are_no_gap(write_uneven_world):
    assert diagnose(*write_uneven_world()).report["verdict"]["status"] == "no_gap"
