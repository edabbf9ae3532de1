"""Drift, loading curve, smallest detectable force, stuck bits."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taxel_tools.bench.analysis.curve import Curve, extrapolate_detectable_force, find_first_detected_force
from taxel_tools.bench.analysis.drift import fit_drift
from taxel_tools.bench.capture import Capture, unwrap_counter
from taxel_tools.bench.phases.rest import find_stuck_bits

FORCE = 50.0 * (np.arange(13) / 12.0) ** 2


def make_curve(loading, unloading=None, taxels=10):
    """Create a loading curve with equal relative counts of all taxels; by default, unloading equals loading."""
    branch = np.tile(loading, (taxels, 1))
    return Curve(FORCE, branch, branch if unloading is None else np.tile(unloading, (taxels, 1)))


@pytest.mark.parametrize("slope", [-300.0, 0.0, 90.0])
def test_the_slope_of_the_board_and_the_deviating_taxel_are_recovered(slope):
    """slope: drift of all taxels, counts per minute. Taxel 11 drifts by 5 counts per second (300 per minute) more."""
    rng = np.random.default_rng(1)
    time = np.arange(0.0, 13.0, 1.0 / 60.0)
    counts = 2400.0 + slope / 60.0 * time[:, None] + rng.normal(0.0, 4.0, (len(time), 27))
    counts[:, 11] += 5.0 * time
    drift = fit_drift(counts.round().astype(np.uint16), time)
    assert drift.board == pytest.approx(slope, abs=4.0 * drift.error + 2.0)
    assert drift.error < 5.0
    assert (drift.worst_taxel, drift.worst) == (11, pytest.approx(300.0, rel=0.1))
    # The record of 13 s is averaged over steps of 0.5 s: first and last step are 12.5 s apart.
    assert drift.change[-1] - drift.change[0] == pytest.approx(slope * 12.5 / 60.0, abs=4.0)


def test_autocorrelation_increases_the_standard_error_of_a_slope():
    """Steps of 0.5 s, each correlated by 0.9 with the one before, are compared with the same steps in random order."""
    rng = np.random.default_rng(3)
    steps = np.zeros(26)
    for i in range(1, 26):
        steps[i] = 0.9 * steps[i - 1] + rng.normal(0.0, 6.0)
    time = np.arange(0.0, 13.0, 1.0 / 60.0)

    def compute_slope_error(values):
        counts = 2400.0 + values[(time / 0.5).astype(int)]
        return fit_drift(np.tile(counts[:, None], (1, 5)).round().astype(np.uint16), time).error

    assert compute_slope_error(steps) > 1.3 * np.median([compute_slope_error(rng.permutation(steps)) for _ in range(9)])


def test_drift_of_less_than_two_seconds_is_refused():
    with pytest.raises(ValueError, match=r"expected at least 2 s of frames, found 1\.5 s"):
        fit_drift(np.zeros((10, 4), np.uint16), np.linspace(0.0, 1.6, 10))


def test_a_gap_in_the_frames_does_not_change_the_slope():
    time = np.concatenate((np.arange(0.0, 4.0, 0.02), np.arange(9.0, 13.0, 0.02)))
    counts = np.repeat((2400.0 + 2.0 * time)[:, None], 5, axis=1).round().astype(np.uint16)
    assert fit_drift(counts, time).board == pytest.approx(120.0, rel=0.02)


def test_an_ideal_curve_is_monotonic_without_hysteresis_and_saturates_at_the_computed_force():
    ideal = make_curve(1.0 - 0.6 * FORCE / (FORCE + 5.0))  # relative count; half of the largest signal 0.6 at 5 N
    assert (ideal.hysteresis, ideal.area, ideal.spread) == (0.0, 0.0, pytest.approx(0.0, abs=1e-12))
    assert ideal.is_monotonic
    # The curve saturates at the force with 95 % of the signal at 50 N, the largest force.
    signal_at_50_n = 0.6 * 50.0 / 55.0
    assert ideal.saturation_n == pytest.approx(5.0 * 0.95 * signal_at_50_n / (0.6 - 0.95 * signal_at_50_n), rel=0.03)


def test_hysteresis_is_the_largest_distance_relative_to_the_range():
    loading = 1.0 - FORCE / 100.0
    unloading = loading - 0.1 * (FORCE[6] == FORCE)
    assert make_curve(loading, unloading).hysteresis == pytest.approx(0.1 / 0.5)


def test_a_curve_whose_counts_increase_with_the_force_is_not_monotonic():
    assert not make_curve(0.5 + FORCE / 100.0).is_monotonic


def test_hysteresis_area_and_saturation_of_a_constant_curve_are_not_defined():
    constant = make_curve(np.ones(13))
    assert np.isnan([constant.hysteresis, constant.area, constant.saturation_n]).all()


def test_the_spread_of_a_single_taxel_is_not_defined():
    assert np.isnan(make_curve(np.ones(13), taxels=1).spread)


@settings(max_examples=40, deadline=None)
@given(st.floats(100.0, 5000.0), st.floats(0.5, 20.0))
def test_the_smallest_detectable_force_is_three_sigmas_over_the_slope(slope, sigma):
    forces = np.array([0.01, 0.02, 0.04, 0.06, 0.1])
    assert extrapolate_detectable_force(forces, slope * forces, sigma) == pytest.approx(3.0 * sigma / slope)
    detected_n = find_first_detected_force(forces, slope * forces, sigma)
    assert np.isnan(detected_n) or (slope * detected_n > 3.0 * sigma)


def test_without_a_signal_no_force_is_detectable():
    forces = np.array([0.01, 0.02])
    assert np.isnan(extrapolate_detectable_force(forces, -forces, 1.0))
    assert np.isnan(find_first_detected_force(forces, 0.0 * forces, 1.0))


def test_the_smallest_force_is_detected_if_all_signals_exceed_three_sigmas():
    assert find_first_detected_force(np.array([0.01, 0.02]), np.array([9.0, 9.0]), 1.0) == 0.01


def sample_rest_counts(rng, taxels=64, spread=180.0, noise=4.0, frames=200):
    """Sample raw counts u16[frames, taxels] of an untouched board: a level per taxel, and white noise.

    spread: standard deviation of the levels between taxels; noise: standard deviation of the noise; both in counts.
    """
    level = 2440.0 + spread * rng.standard_normal(taxels)
    return (level + noise * rng.standard_normal((frames, taxels))).round().astype(np.uint16)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(("taxels", "spread"), [(64, 180.0), (27, 180.0), (27, 12.0), (64, 0.0), (6, 180.0)])
def test_a_healthy_board_has_no_stuck_bit(seed, taxels, spread):
    assert find_stuck_bits(sample_rest_counts(np.random.default_rng(seed), taxels, spread)) == []


def test_an_open_line_is_not_a_stuck_bit():
    counts = sample_rest_counts(np.random.default_rng(1))
    counts[:, :8] += 3800
    assert find_stuck_bits(counts) == []


@pytest.mark.parametrize("bit", range(8))
def test_a_stuck_bit_is_found_for_both_values(bit):
    counts = sample_rest_counts(np.random.default_rng(1))
    assert find_stuck_bits(counts | np.uint16(1 << bit)) == [(bit, 1)]
    assert find_stuck_bits(counts & np.uint16(0xFFFF ^ (1 << bit))) == [(bit, 0)]


def test_a_constant_board_has_no_stuck_bits():
    assert find_stuck_bits(np.full((20, 30), 2440, np.uint16)) == []


def test_wraps_of_a_counter_are_removed():
    assert unwrap_counter(np.array([65534, 65535, 0, 2], np.uint16), 65536).tolist() == [65534, 65535, 65536, 65538]
    assert unwrap_counter(np.array([], np.uint16), 65536).tolist() == []


def test_a_capture_has_a_rate_and_counts_missed_scans():
    sequence = np.array([3, 4, 7, 8])  # scans 5 and 6 are missing; the rate is that of the received frames
    capture = Capture(np.zeros((4, 2), np.uint16), np.array([0.0, 0.1, 0.4, 0.5]), np.zeros(4), sequence)
    assert (capture.seconds, capture.rate_hz, capture.missed_scans) == (0.5, 6.0, 2)
    empty = Capture(np.zeros((0, 2), np.uint16), np.zeros(0), np.zeros(0), np.zeros(0, np.int64))
    assert (empty.seconds, empty.rate_hz, empty.missed_scans) == (0.0, 0.0, 0)
