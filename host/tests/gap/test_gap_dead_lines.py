"""Detection of dead and shorted lines, and similar changes with other causes: saturation, exchange, wrap, drift."""

from __future__ import annotations

import numpy as np
import pytest

from taxel.gap.data.pair import read_pair
from taxel.gap.data.prepare import prepare_pair
from taxel.gap.diagnosis import diagnose
from taxel.gap.effects.dropout_inspection import find_defects
from taxel.gap.features.features import SessionMeans

ROWS, COLUMNS = 6, 5
BOARD = 0x20


def change_first_board(signal_counts, change):
    """Return a copy of the signal after `change` has modified the first board in place, an array [T, rows, columns] (T
    frames).
    """
    result = signal_counts.copy()
    grid = result[:, : ROWS * COLUMNS].reshape(-1, ROWS, COLUMNS)
    change(grid)
    return result


def short_lines(force, signal_counts):
    """Give the lines TX 2 and TX 3 of the first board the mean of both signals."""

    def join(grid):
        grid[:, 2] = grid[:, 3] = 0.5 * (grid[:, 2] + grid[:, 3])

    return change_first_board(signal_counts, join)


def make_clip(limit_counts):
    """Return an effect that clips the signal at a low level, so that lines are as similar as shorted lines."""

    def clip(force, signal_counts):
        return np.minimum(signal_counts, limit_counts)

    return clip


def exchange_lines(force, signal_counts):
    """Exchange the lines TX 1 and TX 4 of the first board."""

    def swap(grid):
        grid[:, [1, 4]] = grid[:, [4, 1]]

    return change_first_board(signal_counts, swap)


def get_dropout(report):
    return next(one for one in report["effects"] if one["name"] == "dropout")


@pytest.mark.slow
def test_shorted_lines_are_localised(write_world, tmp_path):
    report = diagnose(*write_world(tmp_path, effect=short_lines, sessions=4)).report
    assert report["verdict"]["effects"][:1] == ["dropout"]
    assert get_dropout(report)["where"]["lines"] == [[BOARD, "tx", 2], [BOARD, "tx", 3]]


@pytest.mark.slow
@pytest.mark.parametrize("limit_counts", [150.0, 300.0, 500.0])
def test_saturated_lines_are_not_reported_as_shorted(write_world, tmp_path, limit_counts):
    fit_data = prepare_pair(
        read_pair(*write_world(tmp_path, effect=make_clip(limit_counts), sessions=4, largest_force_n=3.0))
    )
    assert find_defects(fit_data.state, fit_data.sessions, fit_data.state.mean).shorts == ()


@pytest.mark.slow
def test_exchanged_lines_are_not_reported_as_dead(write_world, tmp_path):
    report = diagnose(*write_world(tmp_path, effect=exchange_lines, conditions=4, sessions=4)).report
    assert "unknown" in report["verdict"]["effects"]
    assert "dropout" not in report["verdict"]["effects"]


def vary_gains_and_cut_line(force, signal_counts):
    """Give each taxel its own gain, and remove the signal of the line TX 2 of the first board."""
    gains = np.exp(np.random.default_rng(3).normal(0.0, 0.35, signal_counts.shape[1]))

    def cut(grid):
        grid[:, 2] = 0.0

    return change_first_board(signal_counts * gains, cut)


@pytest.mark.slow
def test_an_open_line_is_found_beside_a_gain_for_each_taxel(write_world, tmp_path):
    report = diagnose(*write_world(tmp_path, effect=vary_gains_and_cut_line, conditions=6, sessions=4)).report
    assert "dropout" in report["verdict"]["effects"][:2]
    assert get_dropout(report)["where"]["lines"] == [[BOARD, "tx", 2]]
    named = set(report["verdict"]["effects"])
    assert named & {"gain_mismatch", "stiffness"}


def cut_line(force, signal_counts):
    """Remove the signal of the line TX 2 of the first board."""

    def cut(grid):
        grid[:, 2] = 0.0

    return change_first_board(signal_counts, cut)


@pytest.mark.slow
def test_lower_simulated_noise_is_not_reported_beside_an_open_line(write_world, tmp_path):
    report = diagnose(*write_world(tmp_path, effect=cut_line, conditions=6, sessions=4, noise_counts=2.0)).report
    assert report["verdict"]["effects"][0] == "dropout"
    assert "noise" not in report["verdict"]["effects"]


def test_taxels_with_wrapping_counts_are_not_dead(get_world_paths):
    """A signal above 400 counts appears 1600 counts smaller, as in a counter that overflows."""

    def wrap_counts(force, signal_counts):
        return np.where(signal_counts > 400.0, signal_counts - 1600.0, signal_counts)

    fit_data = prepare_pair(read_pair(*get_world_paths(effect=wrap_counts, sessions=4)))
    assert not find_defects(fit_data.state, fit_data.sessions, fit_data.state.mean).dead.any()


def test_drift_alone_is_not_a_response_of_dead_taxels(get_world_paths):
    """Dead taxels drift, too; the drift is a large share of a small expected signal."""
    drift_counts, dead = 60.0, np.arange(30).reshape(ROWS, COLUMNS)[1:4, 1:4].ravel()

    def kill_taxels_and_drift(force, signal_counts):
        signal_counts = signal_counts.copy()
        signal_counts[:, dead] = 0.0
        signal_counts[110:] += drift_counts  # after the baseline
        return signal_counts

    fit_data = prepare_pair(read_pair(*get_world_paths(effect=kill_taxels_and_drift, sessions=4, largest_force_n=0.15)))
    expected = fit_data.state.mean.copy()
    expected[:, : fit_data.layout.bins] += drift_counts
    assert set(np.flatnonzero(find_defects(fit_data.state, fit_data.sessions, expected).dead)) == set(dead)


@pytest.mark.slow
def test_frames_lost_in_every_fourth_grasp_are_named_as_dropout_only(write_world, tmp_path):
    class FrameLoss:
        grasps = 0

        def __call__(self, raw, valid, rng):
            """Mark the frames of the first board from hold on as lost in every fourth grasp."""
            self.grasps += 1
            if self.grasps % 4 == 0:
                valid = valid.copy()
                valid[130:, 0] = False
            return raw, valid

    report = diagnose(*write_world(tmp_path, sessions=3, repeats=1, session_std=0.1, raw_effect=FrameLoss())).report
    assert set(report["verdict"]["effects"]) <= {"dropout", "unknown"}
    assert get_dropout(report)["parameters"]["sensors"]["value"] == [BOARD]


def test_a_dead_taxel_with_negative_signals_is_found(get_world_paths):
    """The signals of the component of a vector taxel can have one sign only. Here all signals are negative."""
    dead = np.arange(30).reshape(ROWS, COLUMNS)[1:4, 1:4].ravel()

    def kill_taxels(force, signal_counts):
        signal_counts = signal_counts.copy()
        signal_counts[:, dead] = 0.0
        return signal_counts

    fit_data = prepare_pair(read_pair(*get_world_paths(effect=kill_taxels, sessions=4)))
    bins, sign = fit_data.layout.bins, np.ones(fit_data.layout.count)
    sign[:bins] = -1.0
    real = fit_data.sessions
    negative = SessionMeans(real.value * sign[:, None], real.count, real.repeat_variance)
    found = find_defects(fit_data.state, negative, fit_data.state.mean * sign[:, None])
    assert set(np.flatnonzero(found.dead)) == set(dead)
