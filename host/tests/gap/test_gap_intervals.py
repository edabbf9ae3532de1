"""Confidence intervals have their nominal coverage, for one error source or several."""

from __future__ import annotations

import numpy as np
import pytest

from taxel.gap.features.metric import Interval, combine_errors, compute_jackknife_interval

N_INTERVALS = 4000
"""Number of sampled intervals. The shares of 0.935 and 0.975 are four and seven standard errors from 0.95."""


def sample_interval(rng, n_samples, error):
    """Sample n_samples values whose mean has this standard error about 0, and return the mean with its jackknife
    interval.
    """
    values = rng.normal(0.0, error * np.sqrt(n_samples), n_samples)
    replicates = (values.sum() - values) / (n_samples - 1)
    return compute_jackknife_interval(replicates, float(values.mean()))


@pytest.mark.parametrize(
    ("session_error", "contact_error", "bias_std"),
    [(1.0, 0.0, 0.0), (0.3, 1.0, 0.0), (1.0, 1.0, 0.0), (1.0, 0.3, 1.0), (1.0, 1.0, 3.0)],
)
def test_combined_confidence_intervals_have_their_nominal_coverage(session_error, contact_error, bias_std):
    """The true value is 0. The estimate has errors of 4 sessions and of 16 contacts, and a bias.

    `combine_errors` includes the bias through its standard deviation, `bias_std`.
    """
    rng = np.random.default_rng(5)
    n_covered = 0
    for _ in range(N_INTERVALS):
        first, other = sample_interval(rng, 4, session_error), sample_interval(rng, 16, contact_error)
        value = first.value + other.value + rng.normal(0.0, bias_std)
        shifted = Interval(value, value, value, first.error, first.degrees_of_freedom)
        found = combine_errors(shifted, other, bias_std)
        n_covered += found.low <= 0.0 <= found.high
    assert 0.935 < n_covered / N_INTERVALS < 0.975  # nominal 0.95, with a tolerance for the sampling


def test_combining_with_an_estimate_without_error_changes_no_interval():
    alone = sample_interval(np.random.default_rng(1), 4, 1.0)
    assert combine_errors(alone, Interval(0.0, None, None, None)).ci95 == pytest.approx(alone.ci95)


def test_a_value_without_an_error_keeps_no_interval_if_an_error_is_added():
    assert combine_errors(Interval(1.0, None, None, None), Interval(1.0, 0.0, 2.0, 0.5)).ci95 is None


def test_constant_estimates_have_an_interval_of_zero_width():
    constant = Interval(2.0, 2.0, 2.0, 0.0, 3)
    assert combine_errors(constant, constant).ci95 == [2.0, 2.0]


def test_an_interval_is_widened_to_the_quantiles_of_the_posterior_samples():
    interval = Interval(1.0, 0.5, 1.5, 0.25)
    samples = np.linspace(0.2, 1.2, 101)
    wider = interval.widen_to_samples(samples)
    assert wider.low == pytest.approx(np.quantile(samples, 0.025))
    assert wider.high == 1.5
    assert interval.widen_to_samples(np.linspace(0.9, 1.1, 101)).ci95 == interval.ci95
    assert interval.widen_to_samples(np.zeros(0)) == interval
