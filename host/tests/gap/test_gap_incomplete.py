"""Diagnosis of incomplete datasets: conditions that sessions lack, and too few sessions."""

from __future__ import annotations

import numpy as np
import pytest

from taxel.gap.data.pair import read_pair
from taxel.gap.data.prepare import prepare_pair
from taxel.gap.diagnosis import diagnose
from taxel.gap.features.metric import measure_gap
from taxel.gap.fitting.fit_data import FitData

pytestmark = pytest.mark.slow


def clip_signal(force, signal_counts):
    return np.minimum(signal_counts, 300.0)


def make_fit_data(paths) -> FitData:
    return prepare_pair(read_pair(*paths))


@pytest.mark.parametrize(
    "is_absent",
    [
        lambda session, condition: (session + condition) % 3 == 0,
        lambda session, condition: session % 2 != condition % 2,  # two sessions of each object
        lambda session, condition: session % 6 != condition,  # each session has one condition of its own
    ],
    ids=["some", "an object each", "a condition each"],
)
def test_conditions_missing_in_sessions_do_not_change_the_excess(write_world, tmp_path, is_absent):
    """The excess (squared gap minus squared floor) agrees within 10 % with the excess of complete sessions."""
    complete = make_fit_data(write_world(tmp_path, sessions=6, effect=clip_signal))
    (tmp_path / "part").mkdir()
    incomplete = make_fit_data(write_world(tmp_path / "part", sessions=6, effect=clip_signal, is_absent=is_absent))
    expected = complete.compute_excess(complete.state.mean)
    assert incomplete.compute_excess(incomplete.state.mean) == pytest.approx(expected, rel=0.1)
    gap = measure_gap(incomplete.sessions, incomplete.state.mean, incomplete.layout)
    assert incomplete.compute_excess(incomplete.state.mean) == pytest.approx(gap.excess.value, rel=0.1)


def test_a_cause_is_found_with_conditions_missing_in_every_session(write_world, tmp_path):
    paths = write_world(
        tmp_path, sessions=6, effect=clip_signal, is_absent=lambda session, condition: (session + condition) % 3 == 0
    )
    report = diagnose(*paths).report
    assert report["verdict"]["effects"][0] == "saturation"
    # Relative reductions of the gap and of the excess (squared gap minus squared floor). The reduction of the excess is
    # above 1 if the remaining gap is below the floor.
    assert 0.8 < report["after"]["shrink"] <= 1.0
    assert report["after"]["reducible_shrink"] <= 1.1


def test_two_sessions_give_no_certain_verdict(write_world, tmp_path):
    verdict = diagnose(*write_world(tmp_path, sessions=2, repeats=3, effect=clip_signal)).report["verdict"]
    assert verdict["status"] in ("unknown", "partly_explained")
    # Element 1 of the list is the first reason.
    assert "too few sessions for a verdict: 2 recorded, needs 3" in [verdict["one_line"], *verdict["reasons"]][1]
    assert verdict["probabilities"]["saturation"] == max(verdict["probabilities"].values())
