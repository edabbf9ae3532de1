"""A value for each taxel: only a taxel's other presses can say on left-out cells whether it is real."""

from __future__ import annotations

import numpy as np
import pytest

from taxel.gap.chain import Chain, FittedEffect
from taxel.gap.diagnosis import diagnose
from taxel.gap.dropped import find_dropped
from taxel.gap.effects.dropout import Dropout
from taxel.gap.effects.effect import BOARD
from taxel.gap.effects.gain_mismatch import GainMismatch
from taxel.gap.fit import started
from taxel.gap.pair import read_pair
from taxel.gap.prepare import prepared
from taxel.gap.rounds import cross_validated, tried
from taxel.gap.standing import Standing
from taxel.gap.told import amplitude_information, told_elsewhere, told_of
from taxel.gap.weighing import Weighed

N = 60


def etched(seed, std=0.2):
    """A gain of each taxel, the same in every press."""
    gains = np.exp(np.random.default_rng(seed).normal(0.0, std, N))

    def effect(force, drop):
        return drop * gains

    return effect


FIXED = etched(1)


def anew(force, drop):
    """A gain of each taxel that is another in every press."""
    pressed = np.flatnonzero(force.max(axis=0) > 0)
    rng = np.random.default_rng(pressed)
    return drop * np.exp(rng.normal(0.0, 0.25, N))


@pytest.fixture(scope="module")
def judge(written):
    return prepared(read_pair(*written(cells=6))).judge


def test_a_taxel_value_with_one_contact_is_not_cross_validated(judge):
    told = told_elsewhere(judge, 0.3)
    known = amplitude_information(judge)
    once = (known > 0.01 * known.max(axis=0)).sum(axis=0) == 1
    strongest = known.argmax(axis=0)
    assert once.any()
    assert not told[strongest[once], np.flatnonzero(once)].any()
    assert told.any()


def test_a_narrower_prior_makes_fewer_taxel_values_identifiable(judge):
    wide, narrow = told_elsewhere(judge, 0.3), told_elsewhere(judge, 0.01)
    assert not (narrow & ~wide).any()
    assert narrow.sum() < wide.sum()


@pytest.mark.parametrize("effect", [GainMismatch(BOARD, 0.5), Dropout], ids=["boards", "dropout"])
def test_effects_without_taxel_values_are_scored_on_all_features(judge, effect):
    if effect is Dropout:
        effect = Dropout(find_dropped(judge.state, judge.sessions, judge.state.mean))
    found = told_of(effect, judge)
    assert found.judge is judge
    assert found.share == 1.0


def test_taxel_gains_are_scored_on_the_identifiable_taxels(judge):
    found = told_of(GainMismatch(), judge)
    assert found.judge.is_partial
    assert 0.0 < found.share < 1.0


def test_conditions_without_information_on_a_gain_do_not_lower_its_score(written):
    """Of all features it takes little where it was left out, of those that other presses tell nearly everything."""
    standing = Standing.of(prepared(read_pair(*written(effect=FIXED, cells=4))).judge)
    link = started(standing.judge.state, GainMismatch())
    trial = cross_validated(standing.judge, tried(standing.judge, GainMismatch.name, Chain((link,))))
    weighed = Weighed(standing, trial)
    assert trial.held.gone_of(standing.base) < 0.6
    assert weighed.gone > 0.85
    assert weighed.does_most


def test_a_dead_taxel_does_not_improve_the_score_of_taxel_gains(written):
    """Where gains were left out they are predicted no better because something was found not to answer."""

    def effect(force, drop):
        drop = FIXED(force, drop)
        drop[:, 22] = 0.0
        return drop

    judge = prepared(read_pair(*written(effect=effect, cells=4))).judge
    gains = Chain((started(judge.state, GainMismatch()),))
    alone = cross_validated(judge, tried(judge, GainMismatch.name, gains))
    dropout = Dropout(find_dropped(judge.state, judge.sessions, alone.features))
    assert np.flatnonzero(dropout.dropped.dead).tolist() == [22]
    assert not dropout.dropped.evident
    found = alone.chain.with_link(FittedEffect(dropout, dropout.found_values(judge.state)))
    both = cross_validated(judge, tried(judge, Dropout.name, found))
    answers = judge.without(np.broadcast_to(dropout.dropped.dead, both.features.shape))
    assert answers.score(both.features).value < 0.1 * answers.score(alone.held_features).value
    assert answers.score(both.held_features).value > 0.9 * answers.score(alone.held_features).value


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_taxel_gains_are_named_with_half_of_the_taxels_in_contact_once(world, tmp_path, seed):
    verdict = diagnose(*world(tmp_path, effect=etched(seed), cells=8, seed=seed)).report["verdict"]
    assert verdict["effects"][:1] == ["gain_mismatch"]


@pytest.mark.slow
def test_gains_that_change_between_conditions_are_an_unknown_cause(world, tmp_path):
    verdict = diagnose(*world(tmp_path, effect=anew, cells=8)).report["verdict"]
    assert verdict["effects"] == ["unknown"]


@pytest.mark.slow
def test_taxel_gains_from_single_contacts_leave_an_unknown_cause(world, tmp_path):
    verdict = diagnose(*world(tmp_path, effect=etched(2), cells=4, seed=2)).report["verdict"]
    assert "unknown" in verdict["effects"]
