"""Files that lack something: sessions without some presses, too few sessions, holds that nobody knows."""

from __future__ import annotations

import json

import numpy as np
import pytest

from taxel.gap.catalogue import OWN_EFFECTS
from taxel.gap.diagnosis import diagnose
from taxel.gap.effects.layer_law import law_of
from taxel.gap.judge import Judge
from taxel.gap.metric import measure
from taxel.gap.pair import read_pair
from taxel.gap.prepare import prepared
from taxel.gap.state import Signal

pytestmark = pytest.mark.slow


def clipped(force, drop):
    return np.minimum(drop, 300.0)


def judge_of(paths) -> Judge:
    return prepared(read_pair(*paths)).judge


@pytest.mark.parametrize(
    "absent",
    [
        lambda session, cell: (session + cell) % 3 == 0,
        lambda session, cell: session % 2 != cell % 2,  # two sessions of each object
        lambda session, cell: session % 6 != cell,  # a session has one press, and no other has it
    ],
    ids=["some", "an object each", "a press each"],
)
def test_conditions_missing_in_a_session_do_not_change_the_score(world, tmp_path, absent):
    whole = judge_of(world(tmp_path, sessions=6, effect=clipped))
    (tmp_path / "part").mkdir()
    part = judge_of(world(tmp_path / "part", sessions=6, effect=clipped, absent=absent))
    assert not part.sessions.is_complete
    expected = whole.excess(whole.state.mean)
    assert part.excess(part.state.mean) == pytest.approx(expected, rel=0.1)
    assert part.score(part.state.mean).value == pytest.approx(whole.score(whole.state.mean).value, rel=0.25)
    gap = measure(part.sessions, part.state.mean, part.layout)
    assert part.excess(part.state.mean) == pytest.approx(gap.excess.value, rel=0.1)


def test_complete_and_incomplete_scoring_agree_for_complete_sessions(world, tmp_path):
    judge = judge_of(world(tmp_path, effect=clipped))
    one, other = judge.score(judge.state.mean), judge._score_of_some(judge.state.mean, judge.weight)
    assert other.value == pytest.approx(one.value)
    np.testing.assert_allclose(other.left, one.left)
    np.testing.assert_allclose(other.families, one.families)


def test_a_cause_is_found_with_conditions_missing_in_every_session(world, tmp_path):
    paths = world(tmp_path, sessions=6, effect=clipped, absent=lambda session, cell: (session + cell) % 3 == 0)
    report = diagnose(*paths).report
    assert report["verdict"]["effects"][0] == "saturation"
    assert 0.8 < report["after"]["shrink"] <= 1.0
    assert report["after"]["reducible_shrink"] <= 1.1


def test_two_sessions_give_a_gap_without_a_named_cause(world, tmp_path):
    verdict = diagnose(*world(tmp_path, sessions=2, repeats=3, effect=clipped)).report["verdict"]
    assert (verdict["status"], verdict["effects"]) == ("unknown", ["unknown"])
    assert "fewer than three sessions" in verdict["one_line"]
    assert "the most similar effect is saturation" in verdict["one_line"]


def test_without_a_gap_no_effect_is_in_the_verdict(world, tmp_path):
    report = diagnose(*world(tmp_path, seed=3)).report
    assert report["verdict"]["status"] == "no_gap"
    assert not any(entry["in_verdict"] for entry in report["effects"])
    assert report["after"]["value"] == report["after"]["before"]
    assert report["waterfall"] == []


def test_drift_features_of_untouched_taxels_need_no_simulated_noise(world, tmp_path):
    state = judge_of(world(tmp_path, noise=0.0)).state
    form = next(one for one in OWN_EFFECTS["baseline_drift"] if one.scope == "hand")
    moved = form.features(state, state.mean, np.array([[0.0], [60.0]]))
    wander = state.layout.wander
    assert state.untouched.any()
    np.testing.assert_allclose(moved[:, wander][state.untouched], 60.0)
    np.testing.assert_array_equal(moved[:, wander][~state.untouched], state.mean[:, wander][~state.untouched])


def test_an_approach_without_hold_frames_gives_no_point_cloud(world, tmp_path):
    """Of one approach no frame of hold has arrived, in any session."""
    dropped = []

    def lost(raw, valid, rng):
        hardest = int(raw[140].argmin())
        dropped.append(hardest)
        valid = valid.copy()
        if hardest == dropped[0]:
            valid[130:154] = False
        return raw, valid

    report = diagnose(*world(tmp_path, after=lost)).report
    assert 1 <= dropped.count(dropped[0]) < len(dropped)
    assert report["gap"]["mm"]["value"] > 0.0
    json.dumps(report, allow_nan=False)


def test_a_rigid_simulated_contact_gives_a_finite_force_law(world, tmp_path):
    """Depths of a hundredth of a micrometre, as of a simulator whose contact does not give way."""
    judge = judge_of(world(tmp_path))
    state = judge.state
    assert state.base.force is not None
    base = Signal(state.base.force, np.where(state.base.force > 0, -1e-8, 0.002), None)
    law = law_of(type(state)(state.pair, state.layout, state.clock, state.cell, base, state.mean))
    assert np.isfinite(law.force(np.array([0.0, 1e-8, 1e-3]))).all()
