"""What does not answer, and what only seems not to: shorted lines, lines that were exchanged, values that stick."""

from __future__ import annotations

import numpy as np
import pytest

from taxel.gap.data.pair import read_pair
from taxel.gap.data.prepare import prepared
from taxel.gap.diagnosis import diagnose
from taxel.gap.effects.dropped import find_dropped

ROWS, COLUMNS = 6, 5
BOARD = 0x20


def on_rows(signal_counts, change):
    """`change` of the first board's drops, [T, rows, columns]."""
    result = signal_counts.copy()
    grid = result[:, : ROWS * COLUMNS].reshape(-1, ROWS, COLUMNS)
    change(grid)
    return result


def shorted(force, signal_counts):
    def join(grid):
        grid[:, 2] = grid[:, 3] = 0.5 * (grid[:, 2] + grid[:, 3])

    return on_rows(signal_counts, join)


def ended(at):
    """Counts that end where a press hardly begins: lines of the board are then as alike as if they touched."""

    def end(force, signal_counts):
        return np.minimum(signal_counts, at)

    return end


def exchanged(force, signal_counts):
    def swap(grid):
        grid[:, [1, 4]] = grid[:, [4, 1]]

    return on_rows(signal_counts, swap)


def dropout_of(report):
    return next(one for one in report["effects"] if one["name"] == "dropout")


@pytest.mark.slow
def test_shorted_lines_are_localised(world, tmp_path):
    report = diagnose(*world(tmp_path, effect=shorted, sessions=4)).report
    assert report["verdict"]["effects"][:1] == ["dropout"]
    assert dropout_of(report)["where"]["lines"] == [[BOARD, "tx", 2], [BOARD, "tx", 3]]


@pytest.mark.slow
@pytest.mark.parametrize("at", [150.0, 300.0, 500.0])
def test_saturated_lines_are_not_reported_as_shorted(world, tmp_path, at):
    judge = prepared(read_pair(*world(tmp_path, effect=ended(at), sessions=4, most=3.0)))
    assert find_dropped(judge.state, judge.sessions, judge.state.mean).shorts == ()


@pytest.mark.slow
def test_exchanged_lines_are_not_reported_as_dead(world, tmp_path):
    report = diagnose(*world(tmp_path, effect=exchanged, conditions=4, sessions=4)).report
    assert "unknown" in report["verdict"]["effects"]
    assert "dropout" not in report["verdict"]["effects"]


def broken_beside_own_gains(force, signal_counts):
    """Every taxel has a gain of its own, and a line of the first board shows nothing."""
    gains = np.exp(np.random.default_rng(3).normal(0.0, 0.35, signal_counts.shape[1]))

    def cut(grid):
        grid[:, 2] = 0.0

    return on_rows(signal_counts * gains, cut)


@pytest.mark.slow
def test_an_open_line_is_found_besides_a_gain_for_each_taxel(world, tmp_path):
    report = diagnose(*world(tmp_path, effect=broken_beside_own_gains, conditions=6, sessions=4)).report
    assert "dropout" in report["verdict"]["effects"][:2]
    assert dropout_of(report)["where"]["lines"] == [[BOARD, "tx", 2]]
    named = set(report["verdict"]["effects"])
    assert named & {"gain_mismatch", "stiffness"}


def cut_line(force, signal_counts):
    def cut(grid):
        grid[:, 2] = 0.0

    return on_rows(signal_counts, cut)


@pytest.mark.slow
def test_lower_simulated_noise_is_not_reported_besides_an_open_line(world, tmp_path):
    report = diagnose(*world(tmp_path, effect=cut_line, conditions=6, sessions=4, noise=2.0)).report
    assert report["verdict"]["effects"][0] == "dropout"
    assert "noise" not in report["verdict"]["effects"]


def test_taxels_with_wrapping_counts_are_not_dead(written):
    def wraps(force, signal_counts):
        return np.where(signal_counts > 400.0, signal_counts - 1600.0, signal_counts)

    judge = prepared(read_pair(*written(effect=wraps, sessions=4)))
    assert not find_dropped(judge.state, judge.sessions, judge.state.mean).dead.any()


def test_drift_alone_does_not_count_as_a_response(written):
    """It is on dead taxels too; where little is expected of them it is much of that."""
    drifted, dead = 60.0, np.arange(30).reshape(ROWS, COLUMNS)[1:4, 1:4].ravel()

    def worn(force, signal_counts):
        signal_counts = signal_counts.copy()
        signal_counts[:, dead] = 0.0
        signal_counts[110:] += drifted  # once the baseline is known
        return signal_counts

    judge = prepared(read_pair(*written(effect=worn, sessions=4, most=0.15)))
    expected = judge.state.mean.copy()
    expected[:, : judge.layout.bins] += drifted
    assert set(np.flatnonzero(find_dropped(judge.state, judge.sessions, expected).dead)) == set(dead)


@pytest.mark.slow
def test_lost_frames_of_a_single_condition_are_no_other_cause(world, tmp_path):
    class Fails:
        contacts = 0

        def __call__(self, raw, valid, rng):
            self.contacts += 1
            if self.contacts % 4 == 0:
                valid = valid.copy()
                valid[130:, 0] = False
            return raw, valid

    report = diagnose(*world(tmp_path, sessions=3, repeats=1, session_scatter=0.1, after=Fails())).report
    assert set(report["verdict"]["effects"]) <= {"dropout", "unknown"}
    assert dropout_of(report)["parameters"]["sensors"]["value"] == [BOARD]
