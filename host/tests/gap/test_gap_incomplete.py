"""Files that lack something: sessions without some presses, too few sessions, holds that nobody knows."""

from __future__ import annotations

import numpy as np
import pytest

from taxel.gap.data.pair import read_pair
from taxel.gap.data.prepare import prepared
from taxel.gap.diagnosis import diagnose
from taxel.gap.features.metric import measure
from taxel.gap.fitting.judge import Judge

pytestmark = pytest.mark.slow


def clipped(force, signal_counts):
    return np.minimum(signal_counts, 300.0)


def judge_of(paths) -> Judge:
    return prepared(read_pair(*paths))


@pytest.mark.parametrize(
    "absent",
    [
        lambda session, condition: (session + condition) % 3 == 0,
        lambda session, condition: session % 2 != condition % 2,  # two sessions of each object
        lambda session, condition: session % 6 != condition,  # a session has one press, and no other has it
    ],
    ids=["some", "an object each", "a press each"],
)
def test_conditions_missing_in_a_session_do_not_change_the_score(world, tmp_path, absent):
    whole = judge_of(world(tmp_path, sessions=6, effect=clipped))
    (tmp_path / "part").mkdir()
    part = judge_of(world(tmp_path / "part", sessions=6, effect=clipped, absent=absent))
    expected = whole.excess(whole.state.mean)
    assert part.excess(part.state.mean) == pytest.approx(expected, rel=0.1)
    gap = measure(part.sessions, part.state.mean, part.layout)
    assert part.excess(part.state.mean) == pytest.approx(gap.excess.value, rel=0.1)


def test_a_cause_is_found_with_conditions_missing_in_every_session(world, tmp_path):
    paths = world(
        tmp_path, sessions=6, effect=clipped, absent=lambda session, condition: (session + condition) % 3 == 0
    )
    report = diagnose(*paths).report
    assert report["verdict"]["effects"][0] == "saturation"
    assert 0.8 < report["after"]["shrink"] <= 1.0
    assert report["after"]["reducible_shrink"] <= 1.1


def test_two_sessions_give_no_certain_verdict(world, tmp_path):
    verdict = diagnose(*world(tmp_path, sessions=2, repeats=3, effect=clipped)).report["verdict"]
    assert verdict["status"] in ("unknown", "partly_explained")
    assert "too few sessions for a verdict: 2 recorded, needs 3" in [verdict["one_line"], *verdict["reasons"]][1]
    assert verdict["probabilities"]["saturation"] == max(verdict["probabilities"].values())
