"""The estimator on synthetic frames with a known distance."""

import numpy as np
import pytest

from taxel.proximity import BoardEstimator
from taxel.proximity.watch import HORIZON_S, WARNING_PROBABILITY

START_S = 4.0


def approach(speed_m_s, stop_m=-0.001, start_m=0.04):
    return lambda times: np.maximum(start_m - speed_m_s * np.maximum(times - START_S, 0.0), stop_m)


def run(hand, board, calibration, frames):
    estimator = BoardEstimator(hand, board, calibration, HORIZON_S)
    return [estimator.update(float(time), raw) for time, raw in zip(*frames, strict=True)]


@pytest.mark.parametrize("held_mm", [0.5, 1.0, 2.0, 3.5, 5.0])
def test_distance_of_a_held_target_lies_within_half_a_millimetre_and_in_the_interval(
    hand, board, calibration, make_frames, held_mm
):
    path = approach(0.03, stop_m=1e-3 * held_mm)
    last = run(hand, board, calibration, make_frames(path, 8.0))[-1]
    assert last.distance_m is not None
    assert abs(1e3 * last.distance_m.median - held_mm) < 0.5
    assert 1e3 * last.distance_m.low <= held_mm <= 1e3 * last.distance_m.high
    assert abs(last.speed_m_s.median) < 0.005


@pytest.mark.parametrize("speed_mm_s", [20.0, 50.0])
def test_approach_speed_lies_in_its_interval(hand, board, calibration, make_frames, speed_mm_s):
    path = approach(1e-3 * speed_mm_s)
    frames = make_frames(path, START_S + 39.0 / speed_mm_s)
    near = run(hand, board, calibration, frames)[-1]
    assert near.speed_m_s is not None
    assert 1e3 * near.speed_m_s.low <= speed_mm_s <= 1e3 * near.speed_m_s.high


@pytest.mark.parametrize("seed", range(5))
def test_contact_at_50_mm_s_is_predicted_80_ms_ahead(hand, board, calibration, make_frames, seed):
    frames = make_frames(approach(0.05), 6.0, seed=seed)
    contact_s = START_S + 0.04 / 0.05
    warned = [each.time_s for each in run(hand, board, calibration, frames) if each.contact_soon > WARNING_PROBABILITY]
    assert 0.08 <= contact_s - warned[0] < 0.5, f"seed {seed}"


@pytest.mark.parametrize("drift", [-2.0, 0.0, 2.0])
def test_drift_without_a_target_predicts_no_contact(hand, board, calibration, make_frames, drift):
    frames = make_frames(lambda times: np.full(len(times), 1.0), 30.0, drift=drift)
    estimates = run(hand, board, calibration, frames)
    assert max(each.contact_soon for each in estimates) < 0.1
    assert all(each.distance_m is None for each in estimates)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_warm_up_during_and_after_a_target_leaves_no_target_behind(hand, board, calibration, make_frames, sign):
    def path(times):
        return np.where((times > 20.0) & (times < 40.0), 0.002, 0.05)

    times, raw = make_frames(path, 60.0)
    warm_up = 120.0 * sign * -np.expm1(-times / 180.0)
    estimates = run(hand, board, calibration, (times, np.round(raw + warm_up[:, None])))
    near = [each for each in estimates if 36.0 < each.time_s < 39.5]
    assert all(each.distance_m.low < 0.002 < each.distance_m.high for each in near)
    assert all(each.distance_m is None for each in estimates if each.time_s > 45.0)


def test_target_that_stops_before_the_skin_is_not_in_contact(hand, board, calibration, make_frames):
    last = run(hand, board, calibration, make_frames(approach(0.05, stop_m=0.002), 9.0))[-1]
    assert last.contact < 0.01
    assert last.contact_soon < 0.5


def test_grounded_target_is_distinguished_from_acrylic_by_its_sign(hand, board, calibration, make_frames):
    last = run(hand, board, calibration, make_frames(approach(0.03, stop_m=0.001), 8.0))[-1]
    assert last.target == "grounded"


def test_kind_of_target_is_not_identifiable_with_a_single_calibrated_target(hand, board, calibration, make_frames):
    del calibration.targets["acrylic"]
    last = run(hand, board, calibration, make_frames(approach(0.03, stop_m=0.001), 8.0))[-1]
    assert last.target == "not identifiable"


def test_response_that_no_calibration_contains_is_reported_as_unknown(hand, board, calibration, make_frames):
    del calibration.targets["acrylic"]
    frames = make_frames(approach(0.03, stop_m=0.001), 8.0, law=lambda gap: 120.0 * np.exp(-gap / 0.003))
    estimates = run(hand, board, calibration, frames)[-10:]
    assert all(each.target in ("unknown", None) for each in estimates)


def test_first_frames_are_the_baseline(hand, board, calibration, make_frames):
    estimates = run(hand, board, calibration, make_frames(lambda times: np.full(len(times), 1.0), 3.0))
    assert [each.is_ready for each in estimates].index(True) == 39
    assert estimates[0].as_dict()["distance_mm"] is None
