"""The estimator on synthetic frames of a target at known distances."""

import numpy as np
import pytest

from taxel.proximity import BoardEstimator
from taxel.proximity.estimator import BASELINE_FRAMES
from taxel.proximity.watch import HORIZON_S, WARNING_PROBABILITY

START_S = 4.0
"""Time at which an approach begins: after the frames of the baseline."""

START_M = 0.04
"""Distance from which a target approaches."""

FAR_M = 1.0
"""Distance without influence on the signals."""


def approach(speed_m_s, stop_m=-0.001):
    """Return the distance over time of a target that approaches at a constant speed and stops at `stop_m`.

    A negative distance is a contact.
    """
    return lambda times: np.maximum(START_M - speed_m_s * np.maximum(times - START_S, 0.0), stop_m)


def run(hand, board, calibration, frames):
    """Return the estimates of all frames, given as times and raw counts."""
    estimator = BoardEstimator(hand, board, calibration, HORIZON_S)
    return [estimator.update(float(time), raw) for time, raw in zip(*frames, strict=True)]


@pytest.mark.parametrize("held_mm", [0.5, 1.0, 2.0, 3.5, 5.0])
def test_distance_of_a_resting_target_is_estimated_within_half_a_millimetre_and_in_its_interval(
    hand, board, calibration, make_frames, held_mm
):
    path = approach(0.03, stop_m=1e-3 * held_mm)
    last = run(hand, board, calibration, make_frames(path, 8.0))[-1]
    assert last.distance_m is not None
    assert abs(1e3 * last.distance_m.median - held_mm) < 0.5
    assert 1e3 * last.distance_m.low <= held_mm <= 1e3 * last.distance_m.high


def test_speed_of_a_resting_target_is_below_5_mm_s(hand, board, calibration, make_frames):
    last = run(hand, board, calibration, make_frames(approach(0.03, stop_m=0.002), 8.0))[-1]
    assert abs(last.speed_m_s.median) < 0.005


@pytest.mark.parametrize("speed_mm_s", [20.0, 50.0])
def test_interval_of_the_speed_shortly_before_contact_contains_the_speed(
    hand, board, calibration, make_frames, speed_mm_s
):
    path = approach(1e-3 * speed_mm_s)
    frames = make_frames(path, START_S + 39.0 / speed_mm_s)  # the target is then 1 mm away
    near = run(hand, board, calibration, frames)[-1]
    assert near.speed_m_s is not None
    assert 1e3 * near.speed_m_s.low <= speed_mm_s <= 1e3 * near.speed_m_s.high


@pytest.mark.parametrize("seed", range(5))
def test_contact_at_50_mm_s_is_predicted_80_to_500_ms_ahead(hand, board, calibration, make_frames, seed):
    frames = make_frames(approach(0.05), 6.0, seed=seed)
    contact_s = START_S + START_M / 0.05
    warned = [each.time_s for each in run(hand, board, calibration, frames) if each.contact_soon > WARNING_PROBABILITY]
    assert 0.08 <= contact_s - warned[0] < 0.5, f"seed {seed}"


@pytest.mark.parametrize("drift", [-2.0, 0.0, 2.0])
def test_drift_without_a_target_is_reported_neither_as_a_target_nor_as_a_coming_contact(
    hand, board, calibration, make_frames, drift
):
    frames = make_frames(lambda times: np.full(len(times), FAR_M), 30.0, drift=drift)
    estimates = run(hand, board, calibration, frames)
    assert max(each.contact_soon for each in estimates) < 0.1
    assert all(each.distance_m is None for each in estimates)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_drift_of_a_warm_up_neither_biases_the_distance_nor_remains_as_a_target(
    hand, board, calibration, make_frames, sign
):
    def path(times):
        """Hold the target at 2 mm from 20 s to 40 s."""
        return np.where((times > 20.0) & (times < 40.0), 0.002, 0.05)

    times, raw = make_frames(path, 60.0)
    # Drift of 120 counts in all, with a time constant of 180 s.
    warm_up = 120.0 * sign * -np.expm1(-times / 180.0)
    estimates = run(hand, board, calibration, (times, np.round(raw + warm_up[:, None])))
    near = [each for each in estimates if 36.0 < each.time_s < 39.5]
    assert all(each.distance_m.low < 0.002 < each.distance_m.high for each in near)
    assert all(each.distance_m is None for each in estimates if each.time_s > 45.0)


def test_target_that_stops_2_mm_before_the_skin_is_reported_without_contact(hand, board, calibration, make_frames):
    last = run(hand, board, calibration, make_frames(approach(0.05, stop_m=0.002), 9.0))[-1]
    assert last.contact < 0.01
    assert last.contact_soon < 0.5


def test_grounded_target_is_distinguished_from_acrylic_by_its_sign(hand, board, calibration, make_frames):
    last = run(hand, board, calibration, make_frames(approach(0.03, stop_m=0.001), 8.0))[-1]
    assert last.target == "grounded"


def test_target_is_not_identifiable_with_a_single_calibrated_target(hand, board, calibration, make_frames):
    del calibration.targets["acrylic"]
    last = run(hand, board, calibration, make_frames(approach(0.03, stop_m=0.001), 8.0))[-1]
    assert last.target == "not identifiable"


def test_response_that_fits_no_calibrated_target_is_never_named(hand, board, calibration, make_frames):
    del calibration.targets["acrylic"]
    # A positive signal, while the only calibrated target has a negative one.
    frames = make_frames(approach(0.03, stop_m=0.001), 8.0, law=lambda gap: 120.0 * np.exp(-gap / 0.003))
    estimates = run(hand, board, calibration, frames)[-10:]
    assert all(each.target in ("unknown", None) for each in estimates)


def test_first_forty_frames_are_the_baseline_and_give_no_distance(hand, board, calibration, make_frames):
    estimates = run(hand, board, calibration, make_frames(lambda times: np.full(len(times), FAR_M), 3.0))
    assert [each.is_ready for each in estimates].index(True) == BASELINE_FRAMES - 1
    assert all(each.as_dict()["distance_mm"] is None for each in estimates[:BASELINE_FRAMES])
