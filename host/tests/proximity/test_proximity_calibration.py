"""Holds, curves and calibration files."""

import json
import os
from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from taxel.hand import load_hand
from taxel.input_files import InputFileError
from taxel.output import OutputError
from taxel.proximity import (
    CalibrationFileError,
    Hold,
    ProximityCalibration,
    ProximityError,
    calibrate,
    format_holds,
    read_calibration,
    read_holds,
    write_calibration,
)
from taxel.proximity.calibration_merge import merge_calibrations
from taxel.proximity.hold_signals import HoldCounts
from taxel.proximity.response import ResponseCurve, interpolate_monotone, look_up

RATE_HZ = 20.0


def test_interpolation_agrees_with_scipy_between_inner_points():
    rng = np.random.default_rng(3)
    knots = np.cumsum(rng.uniform(0.5, 2.0, 12))
    values = np.cumsum(rng.uniform(-1.0, 2.0, 12))
    at = np.linspace(knots[1], knots[-2], 500)
    np.testing.assert_allclose(
        interpolate_monotone(knots, values, at), PchipInterpolator(knots, values)(at), atol=1e-12
    )


def test_tabulated_curve_passes_through_its_support_points_and_decays_beyond_them():
    distance = np.array([0.5, 1.0, 2.0, 4.0, 8.0]) * 1e-3
    curve = ResponseCurve(distance, np.array([-200.0, -150.0, -90.0, -40.0, -10.0]), 3.0)  # 3: exponent of the decay
    table = curve.make_table()
    np.testing.assert_allclose(look_up(table, distance), curve.signal_counts, atol=0.5)
    beyond = look_up(table, np.array([0.012, 0.02, 0.1]))
    assert -10.0 < beyond[0] < beyond[1] < 0.0
    assert beyond[2] == 0.0


def make_counts(hand, name, law, drift=0.0, seed=1):
    """Make the frames of nine holds of 3 s above one board: rest, a plate at eight distances, rest.

    law: signal at given gaps, counts. drift: increase of all counts, counts per second. The noise is 4 counts.
    """
    from taxel.proximity.skin_points import compute_plane_gaps, compute_skin_points

    rng = np.random.default_rng(seed)
    board = hand.find_board(name)
    points = compute_skin_points(hand, board)
    counts, now = [], 0.0
    for distance in [None, 0.012, 0.008, 0.006, 0.004, 0.003, 0.002, 0.001, 0.0005, None]:
        times = now + np.arange(0.0, 3.0, 1.0 / RATE_HZ)
        signal = 0.0 if distance is None else law(compute_plane_gaps(points, distance)).mean(axis=1)
        raw = 3000.0 - signal + drift * times[:, None] + 4.0 * rng.normal(size=(len(times), points.n_taxels))
        target = "rest" if distance is None else "grounded"
        counts.append(HoldCounts(Hold(now, now + 3.0, name, target, distance), times, np.round(raw)))
        now += 4.0
    return counts


@pytest.mark.parametrize("name", ["palm", "fingertip_index", "medial_back_index"])
def test_calibration_recovers_curve_and_noise_of_flat_and_curved_boards_in_spite_of_drift(name):
    hand = load_hand("original")

    def law(gap):
        return -250.0 * np.exp(-gap / 0.003)

    result = calibrate(hand, make_counts(hand, name, law, drift=0.5))
    kind = result.kinds[hand.find_board(name).kind.name]
    response = kind.targets["grounded"]
    assert kind.noise_counts == pytest.approx(4.0, rel=0.1)  # the noise of `make_counts`
    inner = response.curve.distance_m[1:-1]
    np.testing.assert_allclose(response.curve.signal_counts[1:-1], law(inner), rtol=0.06, atol=1.0)
    assert response.gain_spread < 0.05


def test_response_that_changes_its_sign_is_not_made_monotone():
    hand = load_hand("original")

    def law(gap):
        return 120.0 * np.exp(-gap / 0.001) - 40.0 * np.exp(-gap / 0.004)

    curve = calibrate(hand, make_counts(hand, "palm", law)).kinds["palm"].targets["grounded"].curve
    assert curve.signal_counts[0] > 0.0 > curve.signal_counts[3]
    assert curve.signal_counts[3] < curve.signal_counts[-1]


def test_calibration_without_frames_before_the_target_is_rejected():
    hand = load_hand("original")
    counts = [each for each in make_counts(hand, "palm", lambda gap: -gap) if each.hold.distance_m is not None]
    with pytest.raises(ProximityError, match=r"palm: expected a rest"):
        calibrate(hand, counts)


def test_calibration_with_two_distances_is_rejected():
    hand = load_hand("original")
    rest_and_two_distances = make_counts(hand, "palm", lambda gap: -gap)[:3]
    with pytest.raises(ProximityError, match=r"expected holds at 5 distances or more, found 2"):
        calibrate(hand, rest_and_two_distances)


def test_calibration_file_returns_the_written_values(tmp_path, calibration, hand):
    write_calibration(tmp_path / "skin.json", ProximityCalibration("original", {"medial_front": calibration}))
    read = read_calibration(tmp_path / "skin.json", hand).kinds["medial_front"]
    assert (read.noise_counts, read.drift_counts) == (calibration.noise_counts, calibration.drift_counts)
    assert read.targets.keys() == calibration.targets.keys()
    for name, written in calibration.targets.items():
        response = read.targets[name]
        np.testing.assert_allclose(response.curve.distance_m, written.curve.distance_m, atol=1e-9)
        np.testing.assert_allclose(response.curve.signal_counts, written.curve.signal_counts, atol=1e-3)
        assert response.curve.decay == written.curve.decay
        assert (response.curve_error, response.gain_spread) == (written.curve_error, written.gain_spread)
        assert response.boards == written.boards


def test_existing_calibration_file_is_not_overwritten(tmp_path, calibration):
    written = ProximityCalibration("original", {"medial_front": calibration})
    write_calibration(tmp_path / "skin.json", written)
    with pytest.raises(OutputError, match="expected a new file, found an existing one"):
        write_calibration(tmp_path / "skin.json", written)


def get_target(document):
    return document["kinds"]["medial_front"]["targets"]["grounded"]


@pytest.mark.parametrize(
    ("change", "field"),
    [
        (lambda document: document.update(format="x"), "format"),
        (lambda document: document.update(version=2), "version"),
        (lambda document: document.update(hand="flat8"), "hand"),
        (lambda document: document["kinds"].update(paw={}), "kinds.paw"),
        (lambda document: document["kinds"]["medial_front"].update(noise_counts="4"), "noise_counts"),
        (lambda document: document["kinds"]["medial_front"].update(targets={}), "targets"),
        (
            lambda document: get_target(document).update(distance_mm=[2, 1]),
            "distance",
        ),
        (lambda document: get_target(document).update(signal_counts=[1]), "signal"),
        (lambda document: get_target(document).update(decay=1e6), "decay"),
        (lambda document: get_target(document).update(boards=[1]), "boards"),
    ],
)
def test_error_for_a_wrong_value_names_calibration_file_and_field_in_one_line(
    tmp_path, calibration, hand, change, field
):
    path = tmp_path / "skin.json"
    write_calibration(path, ProximityCalibration("original", {"medial_front": calibration}))
    document = json.loads(path.read_text())
    change(document)
    path.write_text(json.dumps(document))
    with pytest.raises(CalibrationFileError) as error:
        read_calibration(path, hand)
    assert str(path) in str(error.value)
    assert field in str(error.value)
    assert "\n" not in str(error.value)


def test_truncated_calibration_file_is_rejected_with_its_line(tmp_path, hand):
    (tmp_path / "skin.json").write_text('{"format": ')
    with pytest.raises(CalibrationFileError, match=r"line 1: expected a calibration \(valid JSON\)"):
        read_calibration(tmp_path / "skin.json", hand)


@pytest.mark.parametrize("read", [read_calibration, read_holds])
def test_pipe_instead_of_a_file_is_refused(tmp_path, hand, read):
    os.mkfifo(tmp_path / "pipe")  # opening it would block without the check
    with pytest.raises(InputFileError, match="is a pipe"):
        read(tmp_path / "pipe", hand)


def test_written_holds_are_read_unchanged(tmp_path, hand):
    holds = [Hold(1.0, 2.0, "palm", "rest", None), Hold(2.5, 3.5, "palm", "grounded", 0.0025)]
    (tmp_path / "holds.csv").write_text(format_holds(holds))
    assert read_holds(tmp_path / "holds.csv", hand) == holds


@pytest.mark.parametrize(
    ("line", "place"),
    [
        ("1,2,palm,grounded", "columns"),
        ("1,2,paw,grounded,1", "board"),
        ("1,2,palm,Grounded!,1", "target"),
        ("2,1,palm,grounded,1", "start_s"),
        ("x,2,palm,grounded,1", "start_s"),
        ("1,2,palm,grounded,", "distance_mm"),
        ("1,2,palm,grounded,0", "distance_mm"),
        ("1,2,palm,grounded,99", "distance_mm"),
        ("1,2,palm,rest,1", "distance_mm"),
    ],
)
def test_error_for_a_wrong_line_of_a_hold_file_names_line_and_column(tmp_path, hand, line, place):
    path = tmp_path / "holds.csv"
    path.write_text("start_s,end_s,board,target,distance_mm\n" + line + "\n")
    with pytest.raises(CalibrationFileError, match=rf"line 2, .*{place}"):
        read_holds(path, hand)


def test_merged_calibration_has_the_targets_of_both_and_the_larger_noise(calibration):
    grounded = replace(calibration, targets={"grounded": calibration.targets["grounded"]}, noise_counts=4.0)
    acrylic = replace(calibration, targets={"acrylic": calibration.targets["acrylic"]}, noise_counts=5.0)
    first, second = (ProximityCalibration("original", {"medial_front": each}) for each in (grounded, acrylic))
    merged = merge_calibrations(first, second).kinds["medial_front"]
    assert set(merged.targets) == {"grounded", "acrylic"}
    assert merged.noise_counts == 5.0


def test_calibrations_of_different_hands_cannot_be_merged(calibration):
    first = ProximityCalibration("original", {"medial_front": calibration})
    with pytest.raises(ProximityError, match="cannot be combined"):
        merge_calibrations(first, ProximityCalibration("flat8", {}))
