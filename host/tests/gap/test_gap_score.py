"""Whether one model is surely better than another: how often chance is taken for more, and what grasps add to
sessions.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import t as student

from taxel.gap.score import GRASPS_FREEDOM, Score, moderated_error

SEED = 20_261_124
TRIALS = 4000


def gains(rng: np.random.Generator, sessions: int, sizes: np.ndarray, together: float) -> np.ndarray:
    """Of a worthless effect, f64[TRIALS, S, C], by session and cell. sizes: what each cell scatters. together: share
    of the variance that all cells of a session have in common.
    """
    own = rng.normal(size=(TRIALS, sessions, len(sizes))) * np.sqrt(1.0 - together)
    return (own + np.sqrt(together) * rng.normal(size=(TRIALS, sessions, 1))) * sizes


def left_of(each: np.ndarray) -> np.ndarray:
    """Means f64[S, C] without each session."""
    return (each.sum(axis=0) - each) / (len(each) - 1)


def p_value(each: np.ndarray, together: float = 1.0) -> float:
    start = Score(0.0, np.zeros(each.shape), np.zeros(5), together)
    lower = Score(-float(each.mean(axis=0).sum()), -left_of(each), np.zeros(5), together)
    return lower.better_than(start)[1]


@pytest.mark.parametrize("sessions", [3, 4, 6])
@pytest.mark.parametrize("sizes", [np.ones(4), np.ones(24), np.exp(np.linspace(-1.2, 1.2, 8))], ids=len)
def test_the_false_positive_rate_of_the_score_test_is_at_its_level(sessions, sizes):
    print("seed", SEED)
    values = [p_value(each) for each in gains(np.random.default_rng(SEED), sessions, sizes, 0.0)]
    for level in (0.05, 0.01):
        assert np.mean(np.array(values) < level) < 1.25 * level + 2.0 * np.sqrt(level / TRIALS)


def test_the_score_test_accounts_for_variance_between_sessions():
    print("seed", SEED)
    drawn = gains(np.random.default_rng(SEED), 4, np.ones(8), 0.3)
    together = 1.0 + 0.3 * 7.0
    values = np.array([p_value(each, together) for each in drawn])
    assert np.mean(values < 0.01) < 0.0125 + 2.0 * np.sqrt(0.01 / TRIALS)
    blind = np.array([p_value(each) for each in drawn])
    assert np.mean(blind < 0.01) > 0.02  # as if presses scattered by themselves


def test_the_score_test_gains_power_from_many_conditions():
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    drawn = gains(rng, 4, np.ones(8), 0.0) + 0.8
    sums = drawn.sum(axis=2)
    alone = student.sf(sums.mean(axis=1) / (sums.std(axis=1, ddof=1) / 2.0), 3)
    values = np.array([p_value(each) for each in drawn])
    assert np.mean(values < 0.003) > 2.0 * np.mean(alone < 0.003)


def test_a_single_condition_has_the_degrees_of_freedom_of_its_sessions():
    left = np.random.default_rng(SEED).normal(size=(4, 1))
    error, freedom = moderated_error(left, 1.0)
    assert freedom == 3.0
    assert error == pytest.approx(np.sqrt(0.75 * np.sum((left - left.mean()) ** 2)))
    spread = np.random.default_rng(SEED).normal(size=(4, 40))
    assert moderated_error(spread, 1.0)[1] == 3.0 + GRASPS_FREEDOM


def test_two_sessions_give_a_p_value_of_one_half():
    start, lower = (Score(value, np.full((2, 5), value / 5.0), np.zeros(5)) for value in (10.0, 1.0))
    assert lower.better_than(start) == (9.0, 0.5)
