"""Intervals hold the truth as often as they say, however their errors are made up."""

from __future__ import annotations

import numpy as np
import pytest

from taxel.gap.features.metric import Interval, jackknife, together

TRIALS = 4000


def estimated(rng, parts, error):
    """The jackknife of a mean of so many parts, whose standard error is `error`, about a true 0."""
    values = rng.normal(0.0, error * np.sqrt(parts), parts)
    left = (values.sum() - values) / (parts - 1)
    return jackknife(left, float(values.mean()))


@pytest.mark.parametrize(
    ("sessions", "presses", "besides"),
    [(1.0, 0.0, 0.0), (0.3, 1.0, 0.0), (1.0, 1.0, 0.0), (1.0, 0.3, 1.0), (1.0, 1.0, 3.0)],
)
def test_combined_confidence_intervals_have_their_nominal_coverage(sessions, contacts, besides):
    rng = np.random.default_rng(5)
    in_sample = 0
    for _ in range(TRIALS):
        first, other = estimated(rng, 4, sessions), estimated(rng, 16, contacts)
        value = first.value + other.value + rng.normal(0.0, besides)
        moved = Interval(value, value, value, first.error, first.degrees_of_freedom)
        found = together(moved, other, besides)
        in_sample += found.low <= 0.0 <= found.high
    assert 0.935 < in_sample / TRIALS < 0.975


def test_combining_with_an_estimate_without_error_changes_no_interval():
    alone = estimated(np.random.default_rng(1), 4, 1.0)
    assert together(alone, Interval(0.0, None, None, None)).ci95 == pytest.approx(alone.ci95)


def test_below_three_sessions_there_is_no_interval():
    assert together(Interval(1.0, None, None, None), Interval(1.0, 0.0, 2.0, 0.5)).ci95 is None


def test_constant_estimates_have_an_interval_of_zero_width():
    never = Interval(2.0, 2.0, 2.0, 0.0, 3)
    assert together(never, never).ci95 == [2.0, 2.0]


def test_an_interval_is_widened_to_the_quantiles_of_the_posterior_samples():
    interval = Interval(1.0, 0.5, 1.5, 0.25)
    draws = np.linspace(0.2, 1.2, 101)
    wider = interval.at_least(draws)
    assert wider.low == pytest.approx(np.quantile(draws, 0.025))
    assert wider.high == 1.5
    assert interval.at_least(np.linspace(0.9, 1.1, 101)).ci95 == interval.ci95
    assert interval.at_least(np.zeros(0)) == interval
