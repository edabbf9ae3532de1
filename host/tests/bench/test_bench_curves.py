"""Drift, the loading curve, the smallest visible force, bits that stand still."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taxel_tools.bench.analysis.curve import Curve, first_visible, smallest_visible
from taxel_tools.bench.analysis.drift import drift_of
from taxel_tools.bench.capture import Capture, unwrapped
from taxel_tools.bench.phases.rest import stuck_bits

FORCE = 50.0 * (np.arange(13) / 12.0) ** 2


def curve(loading, unloading=None, taxels=10):
    up = np.tile(loading, (taxels, 1))
    return Curve(FORCE, up, up if unloading is None else np.tile(unloading, (taxels, 1)))


@pytest.mark.parametrize("slope", [-300.0, 0.0, 90.0])
def test_a_slope_is_recovered_and_a_taxel_that_goes_its_own_way_found(slope):
    rng = np.random.default_rng(1)
    time = np.arange(0.0, 13.0, 1.0 / 60.0)
    counts = 2400.0 + slope / 60.0 * time[:, None] + rng.normal(0.0, 4.0, (len(time), 27))
    counts[:, 11] += 5.0 * time
    drift = drift_of(counts.round().astype(np.uint16), time)
    assert drift.board == pytest.approx(slope, abs=4.0 * drift.error + 2.0)
    assert drift.error < 5.0
    assert (drift.worst_taxel, drift.worst) == (11, pytest.approx(300.0, rel=0.1))
    assert drift.change[-1] - drift.change[0] == pytest.approx(slope * 12.5 / 60.0, abs=4.0)


def test_slow_noise_makes_a_slope_less_sure_than_the_same_steps_in_any_order():
    rng = np.random.default_rng(3)
    steps = np.zeros(26)
    for at in range(1, 26):
        steps[at] = 0.9 * steps[at - 1] + rng.normal(0.0, 6.0)
    time = np.arange(0.0, 13.0, 1.0 / 60.0)

    def error(values):
        counts = 2400.0 + values[(time / 0.5).astype(int)]
        return drift_of(np.tile(counts[:, None], (1, 5)).round().astype(np.uint16), time).error

    assert error(steps) > 1.3 * np.median([error(rng.permutation(steps)) for _ in range(9)])


def test_drift_needs_two_seconds():
    with pytest.raises(ValueError, match=r"expected at least 2 s of frames, found 1\.5 s"):
        drift_of(np.zeros((10, 4), np.uint16), np.linspace(0.0, 1.6, 10))


def test_a_gap_in_the_frames_does_no_harm_to_a_slope():
    time = np.concatenate((np.arange(0.0, 4.0, 0.02), np.arange(9.0, 13.0, 0.02)))
    counts = np.repeat((2400.0 + 2.0 * time)[:, None], 5, axis=1).round().astype(np.uint16)
    assert drift_of(counts, time).board == pytest.approx(120.0, rel=0.02)


def test_an_ideal_curve_has_no_hysteresis_and_saturates():
    ideal = curve(1.0 - 0.6 * FORCE / (FORCE + 5.0))
    assert (ideal.hysteresis, ideal.area, ideal.spread) == (0.0, 0.0, pytest.approx(0.0, abs=1e-12))
    assert ideal.is_monotonic
    fall = 0.6 * 50.0 / 55.0
    assert ideal.saturation_n == pytest.approx(5.0 * 0.95 * fall / (0.6 - 0.95 * fall), rel=0.03)


def test_hysteresis_is_the_widest_gap_over_the_range():
    loading = 1.0 - FORCE / 100.0
    unloading = loading - 0.1 * (FORCE[6] == FORCE)
    assert curve(loading, unloading).hysteresis == pytest.approx(0.1 / 0.5)
    assert curve(loading, loading).area == 0.0
    assert not curve(loading[::-1]).is_monotonic


def test_a_taxel_that_does_not_move_has_no_curve():
    flat = curve(np.ones(13))
    assert np.isnan([flat.hysteresis, flat.area, flat.saturation_n]).all()
    assert np.isnan(curve(np.ones(13), taxels=1).spread)


@settings(max_examples=40, deadline=None)
@given(st.floats(100.0, 5000.0), st.floats(0.5, 20.0))
def test_the_smallest_visible_force_is_three_sigmas_over_the_slope(slope, sigma):
    forces = np.array([0.01, 0.02, 0.04, 0.06, 0.1])
    assert smallest_visible(forces, slope * forces, sigma) == pytest.approx(3.0 * sigma / slope)
    seen = first_visible(forces, slope * forces, sigma)
    assert np.isnan(seen) or (slope * seen > 3.0 * sigma)


def test_what_never_falls_is_never_visible():
    forces = np.array([0.01, 0.02])
    assert np.isnan(smallest_visible(forces, -forces, 1.0))
    assert np.isnan(first_visible(forces, 0.0 * forces, 1.0))
    assert first_visible(forces, np.array([9.0, 9.0]), 1.0) == 0.01


def counts_at_rest(rng, taxels=64, spread=180.0, noise=4.0, frames=200):
    level = 2440.0 + spread * rng.standard_normal(taxels)
    return (level + noise * rng.standard_normal((frames, taxels))).round().astype(np.uint16)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(("taxels", "spread"), [(64, 180.0), (27, 180.0), (27, 12.0), (64, 0.0), (6, 180.0)])
def test_no_bit_of_a_sound_board_is_stuck(seed, taxels, spread):
    assert stuck_bits(counts_at_rest(np.random.default_rng(seed), taxels, spread)) == []


def test_a_broken_line_is_no_stuck_bit():
    counts = counts_at_rest(np.random.default_rng(1))
    counts[:, :8] += 3800
    assert stuck_bits(counts) == []


@pytest.mark.parametrize("bit", range(8))
def test_a_stuck_bit_is_found_either_way(bit):
    counts = counts_at_rest(np.random.default_rng(1))
    assert stuck_bits(counts | np.uint16(1 << bit)) == [(bit, 1)]
    assert stuck_bits(counts & np.uint16(0xFFFF ^ (1 << bit))) == [(bit, 0)]


def test_a_board_that_stands_still_has_no_stuck_bits():
    assert stuck_bits(np.full((20, 30), 2440, np.uint16)) == []


def test_counters_lose_their_wraps():
    assert unwrapped(np.array([65534, 65535, 0, 2], np.uint16), 65536).tolist() == [65534, 65535, 65536, 65538]
    assert unwrapped(np.array([], np.uint16), 65536).tolist() == []


def test_a_capture_knows_its_rate_and_what_is_missing():
    sequence = np.array([3, 4, 7, 8])
    capture = Capture(np.zeros((4, 2), np.uint16), np.array([0.0, 0.1, 0.4, 0.5]), np.zeros(4), sequence)
    assert (capture.seconds, capture.rate_hz, capture.missed) == (0.5, 6.0, 2)
    empty = Capture(np.zeros((0, 2), np.uint16), np.zeros(0), np.zeros(0), np.zeros(0, np.int64))
    assert (empty.seconds, empty.rate_hz, empty.missed) == (0.0, 0.0, 0)
