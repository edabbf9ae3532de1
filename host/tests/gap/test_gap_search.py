"""What a search makes of several causes, and of a cause that it has no name for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from host.tests.plugin_package import installed_package
from taxel.gap import rounds
from taxel.gap.catalogue import OWN_EFFECTS, chosen
from taxel.gap.chain import Chain
from taxel.gap.confounding import confounded_with
from taxel.gap.diagnosis import diagnose
from taxel.gap.effects.effect import OBJECT
from taxel.gap.effects.stiffness import Stiffness
from taxel.gap.fit import started
from taxel.gap.identify import likenesses
from taxel.gap.pair import read_pair
from taxel.gap.prepare import prepared
from taxel.gap.rounds import cross_validated, next_round, tried
from taxel.gap.score import Score
from taxel.gap.screen import screened
from taxel.gap.select import _realigned
from taxel.gap.standing import Standing
from taxel.gap.trial import Round

FIRST_BOARD, SECOND_BOARD = slice(0, 30), slice(30, 60)


def harder(force, drop):
    return 2000.0 * force / (force + 1.8 * 1.5)


def clipped(force, drop):
    return np.minimum(drop, 450.0)


def late_on_the_second(force, drop):
    late = drop.copy()
    late[4:, SECOND_BOARD] = drop[:-4, SECOND_BOARD]
    return late


def silent_first_board(raw, valid, rng):
    valid = valid.copy()
    valid[:, 0] = False
    return raw, valid


@pytest.fixture(scope="module")
def judge(written):
    return prepared(read_pair(*written(effect=harder))).judge


def test_an_effect_is_found_besides_a_silent_board(world, tmp_path):
    report = diagnose(*world(tmp_path, sessions=4, effect=clipped, after=silent_first_board)).report
    assert report["verdict"]["effects"][:2] == ["dropout", "saturation"]


def test_a_silent_board_alone_is_reported_only_as_dropout(world, tmp_path):
    report = diagnose(*world(tmp_path, sessions=4, after=silent_first_board)).report
    assert [name for name in report["verdict"]["effects"] if name != "unknown"] == ["dropout"]


def test_a_change_of_amplitude_without_its_effect_in_the_catalogue_is_unknown(world, tmp_path):
    paths = world(tmp_path, sessions=4, effect=harder, most=1.0)
    whole, without = (diagnose(*paths, without=names).report["verdict"] for names in ((), ("stiffness",)))
    named = whole["effects"][0]
    assert "stiffness" in {named, *whole["confounded_with"].get(named, [])}
    assert "unknown" in without["effects"]
    assert "stiffness" not in without["effects"]


PLUGIN = """
from taxel.gap.effects.stiffness import Stiffness

class OtherStiffness(Stiffness):
    name = "my_own"

effects = (OtherStiffness("hand"),)
"""


def test_an_effect_of_another_package_is_named(world, tmp_path):
    folder = tmp_path / "plugin"
    folder.mkdir()
    with installed_package(folder, "my_effect", PLUGIN, {"taxel.effects": {"my_own": "my_effect:effects"}}):
        verdict = diagnose(*world(tmp_path, effect=harder), without=("stiffness", "gain_mismatch")).report["verdict"]
    assert verdict["effects"][0] == "my_own"
    assert "my own" in verdict["one_line"]


def test_a_partly_fitted_out_of_catalogue_cause_is_not_explained(world, tmp_path):
    def swapped(force, drop):
        result = drop.reshape(len(drop), 2, 6, 5).copy()
        result[:, :, 2], result[:, :, 3] = 0.7 * result[:, :, 3], 0.7 * result[:, :, 2]
        return result.reshape(drop.shape)

    report = diagnose(*world(tmp_path, cells=4, sessions=4, effect=swapped)).report
    assert report["verdict"]["status"] in ("unknown", "partly_explained")
    assert "unknown" in report["verdict"]["effects"]


def test_a_parameter_of_one_condition_is_cross_validated_on_halves_of_the_condition(world, tmp_path):
    """Each object is pressed in one cell: nothing else tells a value of that object, and what nothing tells is 1."""

    class Expected(Stiffness):
        def own_parameters(self):
            return (replace(super().own_parameters()[0], prior=0.1),)

    judge = prepared(read_pair(*world(tmp_path, cells=2, effect=harder))).judge
    chain = Chain((started(judge.state, Expected(OBJECT)),))
    trial = cross_validated(judge, tried(judge, Expected.name, chain))
    assert trial.held.value < 0.1 * judge.score(judge.state.mean).value


def test_frames_are_realigned_after_an_effect_is_fitted(judge):
    """Before it is known its onset may be taken for a delay; here the frames are shifted by one on purpose."""
    frame_s = judge.state.pair.frame_s
    forms = {"stiffness": chosen()["stiffness"]}
    astray = Standing.of(judge.shifted(judge.state.shift_s + frame_s))
    found = next_round(astray, forms).best
    assert found is not None
    aligned = _realigned(astray.after(found), forms).judge.state.shift_s
    assert abs(aligned - judge.state.shift_s) < 0.2 * frame_s


def test_a_realignment_that_explains_less_is_rejected(judge, monkeypatch):
    """A shift is cut off where frames can lie no farther apart, and what is left of it may do harm."""
    forms = {"stiffness": chosen()["stiffness"]}
    found = next_round(Standing.of(judge), forms).best
    standing = Standing.of(judge).after(found)
    worse, better = (
        replace(found, inside=replace(found.inside, value=standing.fitted.value + more)) for more in (1.0, -1.0)
    )
    for trial, stays in ((worse, True), (better, False)):
        monkeypatch.setattr("taxel.gap.select._aligned", lambda *_, trial=trial: (judge.state.pair.frame_s, trial))
        assert (_realigned(standing, forms) is standing) == stays


def test_a_large_remaining_gap_is_searched_again_with_earlier_effects_refitted(judge, monkeypatch):
    looks = []

    def nothing(standing, forms, fixed):
        looks.append(fixed)
        return Round(standing.base, (), None, 0.0, 1.0, False)

    monkeypatch.setattr(rounds, "_round", nothing)
    started_with = {name: Chain((started(judge.state, chosen()[name][0]),)) for name in ("noise", "stiffness")}
    useless, right = (cross_validated(judge, tried(judge, name, chain)) for name, chain in started_with.items())
    for found in (useless, right):
        next_round(Standing.of(judge).after(found), chosen())
    assert looks == [("dropout", "noise"), ("dropout",), ("dropout", "stiffness")]
    next_round(Standing.of(judge), chosen())
    assert looks[3:] == [("dropout",)]


def test_excluded_features_do_not_change_a_score(judge):
    out = np.zeros(judge.weight.shape, bool)
    out[:, :, :5] = True
    partial = judge.without(out)
    moved = judge.state.mean.copy()
    moved[:, :, :5] += 100.0
    assert partial.is_partial
    assert not judge.is_partial
    assert partial.score(moved).value == partial.score(judge.state.mean).value
    assert partial.excess(moved) == partial.excess(judge.state.mean)
    assert judge.score(moved).value > judge.score(judge.state.mean).value


def test_a_feature_family_without_a_gap_has_no_explained_share():
    start, base, after = (
        Score(sum(each), np.zeros((4, 1)), np.array([*each, 0.0, 0.0, 0.0]))
        for each in ((3.0, 900.0), (3.0, 20.0), (1.0, 20.0))
    )
    assert after.share_of(start, base) == pytest.approx(2.0 / 3.0)
    assert after.share_of(start, base, np.array([5.0, 5.0, 0.0, 0.0, 0.0])) == 0.0


def test_the_linear_screen_puts_the_set_of_the_two_causes_first(world, tmp_path):
    def both(force, drop):
        return late_on_the_second(force, clipped(force, drop))

    paths = world(tmp_path, sessions=4, effect=both)
    found = screened(prepared(read_pair(*paths)).judge, {name: own for name, own in OWN_EFFECTS.items() if own})
    pairs = [one for one in found if len(one.names) == 2]
    assert pairs[0].names == {"latency", "saturation"}
    assert all(0.0 <= one.left <= 1.0 + 1e-9 for one in found)
    assert [one.left for one in found] == sorted(one.left for one in found)


def test_similarity_is_higher_for_effects_that_produce_similar_changes(judge):
    forms = {name: OWN_EFFECTS[name] for name in ("gain_mismatch", "stiffness", "noise", "latency")}
    rows = {(one.name, one.other): one for one in likenesses(judge, forms)}
    assert rows["gain_mismatch", "stiffness"].degrees < rows["gain_mismatch", "latency"].degrees
    assert not rows["gain_mismatch", "noise"].alike
    assert confounded_with(["noise"], {}, list(rows.values())) == {}


def test_a_board_without_a_baseline_is_excluded_from_its_grasp(world, tmp_path):
    spoilt = iter(range(10_000))

    def lossy(raw, valid, rng):
        valid = valid.copy()
        if next(spoilt) == 3:
            valid[:105, 1] = False
        return raw, valid

    report = diagnose(*world(tmp_path, cells=4, sessions=4, effect=clipped, after=lossy)).report
    assert report["verdict"]["effects"][0] == "saturation"
    assert any("1 of 32 grasps of the hand a board has no baseline" in loss for loss in report["losses"])
