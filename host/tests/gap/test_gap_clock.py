"""Times at which two files are looked at, where presses do not last equally long."""

from __future__ import annotations

import h5py
import numpy as np
import pytest

from taxel.gap.data.clock import Clock, usual_duration
from taxel.gap.data.pair import read_pair
from taxel.gap.diagnosis import diagnose
from taxel.recording.grasp_format import Phase

pytestmark = pytest.mark.slow

LATE = "press_2"


@pytest.mark.parametrize(
    ("lasts", "looked_at"),
    [
        ([1.0, 1.05, 1.1], 1.0),  # a frame more or less
        ([0.7, 1.0, 1.3], 1.3),
        ([0.9, 1.0, 1.0, 8.0], 1.5),  # one press that lasts must not widen the bins of all others
    ],
)
def test_the_compared_duration_of_a_phase_follows_the_majority_of_grasps(lasts, looked_at):
    assert usual_duration(np.array(lasts)) == pytest.approx(looked_at)


def test_features_after_the_end_of_a_phase_are_unknown():
    clock = Clock.of({Phase.CLOSING: 1.2, Phase.HOLD: 1.0}, 20.0)
    beyond = clock.beyond({Phase.CLOSING: np.array([1.2, 0.7]), Phase.HOLD: np.array([1.0, 1.0])})
    assert not beyond[0].any()
    closing = clock.phase == Phase.CLOSING
    assert (beyond[1, closing] == (clock.begin[closing] > 0.55)).all()
    assert not beyond[1, ~closing].any()


@pytest.fixture
def uneven(world, tmp_path):
    """Two files in which one press closes in half the time."""

    def make(**changes):
        paths = world(tmp_path, **changes)
        for path in paths:
            with h5py.File(path, "r+") as file:
                for grasp in file["grasps"].values():
                    if grasp.attrs["approach"] == LATE:
                        phase = grasp["phase"][:]
                        phase[120:130] = Phase.HOLD
                        grasp["phase"][...] = phase
        return paths

    return make


def test_grasps_with_faster_closing_are_compared_while_they_close(uneven):
    pair = read_pair(*uneven())
    closing = pair.clock.phase == Phase.CLOSING
    assert pair.clock.end[closing].max() == pytest.approx(1.0, abs=0.06)
    faster = [name for _, name in pair.conditions].index(LATE)
    for one in (pair.real, pair.sim):
        known = np.isfinite(one.nodes[:, closing]).all(axis=2)
        assert known[one.condition != faster].all()
        assert known[one.condition == faster].any(axis=1).all()
        assert not known[one.condition == faster].all(axis=1).any()


def test_latency_of_a_board_is_found_despite_different_closing_speeds(uneven):
    def late(force, signal_counts):
        moved = signal_counts.copy()
        moved[4:, 30:] = signal_counts[:-4, 30:]
        return moved

    verdict = diagnose(*uneven(effect=late)).report["verdict"]
    assert verdict["effects"][0] == "latency"
    assert verdict["status"] == "explained"


def test_different_closing_speeds_in_both_files_are_no_gap(uneven):
    assert diagnose(*uneven()).report["verdict"]["status"] == "no_gap"
