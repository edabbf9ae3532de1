"""Poses from measured points and their covariance are correct; every error in a file is reported in one line."""

import json
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import least_squares

from taxel.grasp.calibration import (
    Calibration,
    CalibrationError,
    PoseEstimate,
    fit_pose,
    load_calibration,
    make_pose_estimate,
)
from taxel.hand.transforms import apply, from_rotation_vector, inverse, make_pose, to_rotation_vector

SEED = 22
SIGMA_M = 50e-6
TRUE_POSE = make_pose([0.612, -0.104, 0.021], [0.8, 0.1, -0.5, 0.3])
# Marks on a box of 60 x 40 x 100 mm, metres.
MARKS = np.array([[0, 0, 0], [0.06, 0, 0], [0.06, 0.04, 0], [0, 0.04, 0.1], [0, 0, 0.1], [0.06, 0.02, 0.1]])

VALID = """\
format = "taxel-calibration"
version = 1

[[objects]]
name = "box"
measured = 2024-05-17
instrument = "C-Track 780"
sigma_m = 25e-6
weights = [1, 1, 2.5, 1]
points = [
    ["a", 0.0, 0.0, 0.0, 0.6, 0.1, 0.02],
    ["b", 0.06, 0.0, 0.0, 0.6, 0.16, 0.02],
    ["c", 0.06, 0.04, 0.0, 0.56, 0.16, 0.02],
    ["d", 0.0, 0.04, 0.1, 0.56, 0.1, 0.12],
]

[[objects]]
name = "cylinder"
pose = { position_m = [0.5, 0.0, 0.1], quaternion_wxyz = [1.0, 0.0, 0.0, 0.0] }

[[brackets]]
sensor = "palm"
pose.position_m = [0.0, 0.0, 0.0951]
pose.quaternion_wxyz = [0.0, 1.0, 0.0, 0.0]
"""

# Text in VALID, its replacement, the field in the error, and a part of the error message.
INVALID_EDITS: dict[str, tuple[str, str, str, str]] = {
    "not TOML": ("version = 1", "version = = 1", "line 2, column 11", "expected valid TOML"),
    "another format": ("taxel-calibration", "taxel-hand", "format", "found 'taxel-hand'"),
    "no format": ('format = "taxel-calibration"\n', "", "format", 'add format = "taxel-calibration"'),
    "another version": ("version = 1", "version = 2", "version", "expected 1, found 2"),
    "true for a version": ("version = 1", "version = true", "version", "found true"),
    "unknown key at the top": ("[[brackets]]", "[[bracket]]", "bracket", "did you mean brackets?"),
    "unknown key of an object": ("instrument", "instrumnt", "objects[0].instrumnt", "did you mean instrument?"),
    "a sensor of an object": (
        'name = "box"',
        'sensor = "box"',
        "objects[0].sensor",
        "an unknown key; known keys: name",
    ),
    "no name": ('name = "box"\n', "", "objects[0].name", "add name"),
    "a bad name": ('"cylinder"', '"my cylinder"', "objects[1].name", "rename it"),
    "a name twice": ('"cylinder"', '"box"', "objects[1].name", "'box', also in objects[0].name"),
    "one table for a list": ("[[brackets]]", "[brackets]", "brackets", "expected a list, found a table"),
    "neither pose nor points": (VALID[VALID.index("pose = {") : VALID.index("\n\n[[br")], "", "objects[1]", "neither"),
    "both pose and points": ("pose = {", "points = []\npose = {", "objects[1]", "found both; keep one"),
    "sigma with a pose": (
        "pose = {",
        "sigma_m = 1e-5\npose = {",
        "objects[1].sigma_m",
        "expected an entry with points",
    ),
    "sigma in micrometres": ("25e-6", "25", "objects[0].sigma_m", "write the standard deviation in metres"),
    "sigma 0": ("25e-6", "0", "objects[0].sigma_m", "above 0"),
    "sigma in quotes": ("25e-6", '"25e-6"', "objects[0].sigma_m", "expected a number, found '25e-6'"),
    "a date in quotes": ("2024-05-17", '"2024-05-17"', "objects[0].measured", "without quotes"),
    "an instrument of two lines": ("C-Track 780", r"C-Track\n780", "objects[0].instrument", "one printable line"),
    "too few weights": ("[1, 1, 2.5, 1]", "[1, 1]", "objects[0].weights", "expected 4 weights, one per point, found 2"),
    "a weight of 0": ("2.5", "0.0", "objects[0].weights[2]", "remove the point to ignore it"),
    "a row too short": ('["b", 0.06, ', '["b", ', "objects[0].points[1]", "[name, x, y, z, X, Y, Z], found 6 values"),
    "a point name twice": ('["b",', '["a",', "objects[0].points[1]", "'a', also in objects[0].points[0]"),
    "a point without a name": ('["b",', "[2,", "objects[0].points[1]", "found 2; rename it"),
    "a text for a coordinate": ("0.06, 0.0,", '"6 cm", 0.0,', "objects[0].points[1][1]", "found '6 cm'"),
    "a coordinate in millimetres": (
        "0.06, 0.0,",
        "60.0, 0.0,",
        "objects[0].points[1][1]",
        "in metres, for example 0.125",
    ),
    "a coordinate not a number": ("0.06, 0.0,", "nan, 0.0,", "objects[0].points[1][1]", "found nan"),
    "a position in millimetres": ("[0.5, 0.0", "[500, 0.0", "objects[1].pose.position_m[0]", "found 500; write the"),
    "a position of 2 numbers": ("[0.5, 0.0, 0.1]", "[0.5, 0.0]", "objects[1].pose.position_m", "3 numbers, found 2"),
    "a quaternion of length 2": (
        "[0.0, 1.0, 0",
        "[2.0, 0.0, 0",
        "brackets[0].pose.quaternion_wxyz",
        "length 1, found 2",
    ),
    "a quaternion that is not a number": (
        "[0.0, 1.0, 0",
        "[nan, 1.0, 0",
        "brackets[0].pose.quaternion_wxyz",
        "length 1, found nan",
    ),
    "no quaternion": ("pose.quaternion_wxyz = [0.0, 1.0, 0.0, 0.0]\n", "", "brackets[0].pose.quaternion_wxyz", "add"),
}


def measure_marks(rng: np.random.Generator, sigma_m: float = SIGMA_M) -> NDArray[np.float64]:
    """Return the marks at the true pose with normal noise of a standard deviation, f64[6, 3], metres."""
    return apply(TRUE_POSE, MARKS) + rng.normal(scale=sigma_m, size=MARKS.shape)


def compute_error(estimate: PoseEstimate) -> NDArray[np.float64]:
    """Compute the rotation vector and the translation from the estimate to the true pose."""
    rotation = to_rotation_vector(TRUE_POSE @ inverse(estimate.transform))
    return np.concatenate([rotation, TRUE_POSE[:3, 3] - estimate.transform[:3, 3]])


def get_fit_error(points: NDArray[np.float64], measured: NDArray[np.float64]) -> str:
    """Return the one-line message of the error that a fit to the points raises."""
    with pytest.raises(CalibrationError) as caught:
        fit_pose(points, measured)
    assert_one_line(caught.value, "fit_pose", "points")
    return str(caught.value)


def assert_one_line(error: CalibrationError, file: str, field: str) -> None:
    """Check that an error is one line with file, field, expected and found content and remedy, and can be pickled."""
    line = str(error)
    assert line.isprintable()
    assert line.startswith(f"{file}: {field}: expected ")
    assert ", found " in line
    assert "; " in line
    assert str(pickle.loads(pickle.dumps(error))) == line


def get_load_error(path: Path, text: str) -> CalibrationError:
    """Write a calibration file, and return the error that loading it raises."""
    path.write_text(text)
    with pytest.raises(CalibrationError) as caught:
        load_calibration(path)
    return caught.value


def test_exact_points_give_the_exact_pose() -> None:
    estimate = fit_pose(MARKS, apply(TRUE_POSE, MARKS))
    np.testing.assert_allclose(estimate.transform, TRUE_POSE, atol=1e-14)
    assert estimate.rms_m < 1e-15
    assert estimate.warnings() == ()


def test_three_points_determine_a_pose() -> None:
    estimate = fit_pose(MARKS[:3], apply(TRUE_POSE, MARKS[:3]))
    np.testing.assert_allclose(estimate.transform, TRUE_POSE, atol=1e-13)
    assert estimate.degrees_of_freedom == 3


@pytest.mark.parametrize("weights", [np.ones(6), np.array([1, 4, 0.5, 2, 9, 1])])
def test_the_pose_minimises_the_weighted_sum_of_squares(weights: NDArray[np.float64]) -> None:
    """A numerical search that starts at the estimate finds no better pose, and gives the same covariance."""
    print(f"seed {SEED}")
    measured = measure_marks(np.random.default_rng(SEED), 1e-3)
    estimate = fit_pose(MARKS, measured, weights=weights)

    def compute_residuals(correction: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the weighted residuals f64[18] for a pose corrected by a rotation vector and a translation, f64[6]."""
        changed_pose = from_rotation_vector(correction[:3]) @ estimate.transform
        changed_pose[:3, 3] = estimate.transform[:3, 3] + correction[3:]
        return (np.sqrt(weights)[:, np.newaxis] * (measured - apply(changed_pose, MARKS))).ravel()

    solution = least_squares(
        compute_residuals, np.zeros(6), x_scale=[1, 1, 1, 0.1, 0.1, 0.1], xtol=1e-15, ftol=1e-15, gtol=1e-15
    )
    np.testing.assert_allclose(solution.x, 0, atol=1e-8)
    covariance_of_linearised_problem = estimate.sigma_m**2 * np.linalg.inv(solution.jac.T @ solution.jac)
    tolerance = 1e-3 * np.abs(covariance_of_linearised_problem).min()
    np.testing.assert_allclose(estimate.covariance, covariance_of_linearised_problem, rtol=1e-4, atol=tolerance)


def test_the_intervals_contain_the_true_pose_in_95_percent_of_trials() -> None:
    """The share of covered true values is computed for each pose parameter, with an estimated and with a given sigma.

    The share in 2000 trials has a standard deviation of 0.5 %.
    """
    print(f"seed {SEED}")
    rng = np.random.default_rng(SEED)
    repetitions = 2000
    covered = np.zeros((2, 6))
    for _ in range(repetitions):
        measured = measure_marks(rng)
        for row, sigma in enumerate((None, SIGMA_M)):
            estimate = fit_pose(MARKS, measured, sigma_m=sigma)
            covered[row] += np.abs(compute_error(estimate)) <= estimate.interval_95
    coverage = covered / repetitions
    assert (coverage >= 0.93).all(), coverage
    assert (coverage <= 0.97).all(), coverage


def test_the_estimated_sigma_equals_the_measurement_sigma() -> None:
    """A point with the weight w has errors of sigma / sqrt(w); 500 fits determine sigma within 3 %."""
    print(f"seed {SEED}")
    rng = np.random.default_rng(SEED)
    weights = np.array([1, 1, 4, 4, 0.25, 0.25])
    squares = []
    for _ in range(500):
        noise = rng.normal(scale=SIGMA_M, size=MARKS.shape) / np.sqrt(weights)[:, np.newaxis]
        squares.append(fit_pose(MARKS, apply(TRUE_POSE, MARKS) + noise, weights=weights).sigma_m ** 2)
    assert np.sqrt(np.mean(squares)) == pytest.approx(SIGMA_M, rel=0.03)


def test_residuals_are_measured_minus_fitted_in_metres() -> None:
    """Six points have 18 coordinates, and 12 degrees of freedom remain after the fit of six pose parameters."""
    measured = measure_marks(np.random.default_rng(SEED))
    estimate = fit_pose(MARKS, measured)
    residuals = measured - apply(estimate.transform, MARKS)
    np.testing.assert_array_equal(estimate.residuals_m, residuals)
    assert estimate.rms_m == pytest.approx(np.sqrt((residuals**2).sum() / 6))
    assert estimate.sigma_m == pytest.approx(np.sqrt((residuals**2).sum() / 12))
    assert (estimate.n_points, estimate.degrees_of_freedom) == (6, 12)


def test_a_warning_names_the_outlier() -> None:
    """The fourth point is moved by 2 mm; all points have errors of 0.05 mm."""
    measured = measure_marks(np.random.default_rng(SEED))
    measured[3] += [0, 2e-3, 0]
    for sigma in (None, SIGMA_M):
        estimate = fit_pose(MARKS, measured, names=list("abcdef"), sigma_m=sigma)
        assert "fit_pose: points: point 'd' has a residual" in estimate.warnings()[0]
        assert estimate.warnings()[0].isprintable()


def test_points_without_outliers_rarely_give_a_warning() -> None:
    """At most 10 of 300 fits to points with normally distributed errors give a warning."""
    print(f"seed {SEED}")
    rng = np.random.default_rng(SEED)
    estimates = [fit_pose(MARKS, measure_marks(rng), sigma_m=s) for _ in range(150) for s in (None, SIGMA_M)]
    assert sum(bool(estimate.warnings()) for estimate in estimates) <= 10


def test_residuals_above_the_given_sigma_give_a_warning() -> None:
    measured = measure_marks(np.random.default_rng(SEED), 1e-3)
    (*_, line) = fit_pose(MARKS, measured, sigma_m=25e-6).warnings()
    assert "expected residuals of 0.025 mm (sigma_m)" in line


def test_fewer_than_three_points_are_rejected() -> None:
    assert "at least 3 points, found 2" in get_fit_error(MARKS[:2], MARKS[:2])


def test_collinear_points_are_rejected() -> None:
    line = np.linspace(0, 1, 5)[:, np.newaxis] * np.array([0.1, 0.2, 0.3])
    assert "found collinear points in the body frame; add a point" in get_fit_error(line, apply(TRUE_POSE, line))
    assert "found collinear points as measured" in get_fit_error(MARKS[:5], line)
    assert "found identical points in the body frame" in get_fit_error(np.ones((4, 3)), MARKS[:4])


def test_mirrored_points_are_rejected() -> None:
    measured = measure_marks(np.random.default_rng(SEED))
    assert "found a mirror image" in get_fit_error(MARKS, measured * [1, -1, 1])
    assert "check for swapped axes" in get_fit_error(MARKS[:, [1, 0, 2]], measured)


def test_mirrored_coplanar_points_are_not_detectable() -> None:
    flat = MARKS * [1, 1, 0]
    assert fit_pose(flat, flat * [1, -1, 1]).rms_m < 1e-15


@pytest.mark.parametrize(("unit", "per_metre"), [("millimetres", 1000), ("centimetres", 100), ("inches", 1 / 0.0254)])
def test_another_unit_is_detected_and_named(unit: str, per_metre: float) -> None:
    measured = measure_marks(np.random.default_rng(SEED))
    assert f"measured coordinates that fit in {unit}" in get_fit_error(MARKS, measured * per_metre)
    assert f"body coordinates that fit in {unit}" in get_fit_error(MARKS * per_metre, measured)


def test_points_of_different_shapes_or_with_nan_are_rejected() -> None:
    assert "(6, 2) and (6, 3)" in get_fit_error(MARKS[:, :2], MARKS)
    assert "found NaN or infinity" in get_fit_error(MARKS, MARKS * np.nan)


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ({"weights": [1, 2]}, "6 finite weights above 0"),
        ({"weights": [0] * 6}, "6 finite weights above 0"),
        ({"sigma_m": -1.0}, "sigma_m in metres, above 0"),
        ({"names": ["a"]}, "6 names"),
    ],
)
def test_invalid_weights_sigma_or_names_are_rejected(options: dict[str, Any], expected: str) -> None:
    with pytest.raises(CalibrationError, match=f"expected {expected}"):
        fit_pose(MARKS, MARKS, **options)


def test_poses_of_objects_and_brackets_are_loaded_from_a_file(tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(VALID)
    calibration = load_calibration(path)
    assert list(calibration.objects) == ["box", "cylinder"]
    assert list(calibration.brackets) == ["palm"]
    box = calibration.objects["box"]
    expected = make_pose([0.6, 0.1, 0.02], [np.sqrt(0.5), 0, 0, np.sqrt(0.5)])
    np.testing.assert_allclose(box.transform, expected, atol=1e-12)
    assert (box.sigma_m, box.sigma_given, box.measured, box.instrument) == (25e-6, True, "2024-05-17", "C-Track 780")
    assert box.points is not None
    assert box.points.names == ("a", "b", "c", "d")
    assert box.source == f"{path}: objects[0].points"
    palm = calibration.brackets["palm"]
    np.testing.assert_allclose(palm.transform, make_pose([0, 0, 0.0951], [0, 1, 0, 0]))
    assert np.isnan(palm.covariance).all()
    assert np.isnan(palm.interval_95).all()


@pytest.mark.parametrize("edit", INVALID_EDITS)
def test_an_invalid_file_raises_a_one_line_error(edit: str, tmp_path: Path) -> None:
    old, new, field, message = INVALID_EDITS[edit]
    assert old in VALID
    path = tmp_path / "cell.toml"
    error = get_load_error(path, VALID.replace(old, new, 1))
    assert_one_line(error, str(path), field)
    assert message in str(error)


def test_points_that_determine_no_pose_are_rejected_with_their_field(tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    text = VALID[: VALID.index("weights")] + 'points = [["a", 0, 0, 0, 0, 0, 0]]\n'
    assert_one_line(get_load_error(path, text), str(path), "objects[0].points")
    assert "found 1; measure more" in str(get_load_error(path, text))
    assert "at least 3 points, found 0" in str(get_load_error(path, text.replace('["a", 0, 0, 0, 0, 0, 0]', "")))


def test_an_empty_calibration_is_rejected(tmp_path: Path) -> None:
    error = get_load_error(tmp_path / "cell.toml", VALID[: VALID.index("[[objects]]")])
    assert "expected at least one object or bracket, found none" in str(error)


def test_an_unreadable_file_is_rejected(tmp_path: Path) -> None:
    for path, message in ((tmp_path / "none.toml", "no such file"), (tmp_path, "expected a regular file")):
        with pytest.raises(CalibrationError, match=message) as caught:
            load_calibration(path)
        assert_one_line(caught.value, str(path), "file")
    # 1 MiB of comments: more than the largest permitted file.
    assert "use a calibration file" in str(get_load_error(tmp_path / "big.toml", VALID + "#\n" * (1 << 19)))


def make_calibration() -> Calibration:
    """Make a calibration with a weighted and an unweighted fit and a given pose of a bracket."""
    rng = np.random.default_rng(SEED)
    box = fit_pose(MARKS, measure_marks(rng), weights=[1, 2, 1, 1, 1, 1 / 3], sigma_m=SIGMA_M)
    unweighted = fit_pose(MARKS, measure_marks(rng), names=list("abcdef"))
    return Calibration(
        {"box": box, "unweighted": unweighted}, {"palm": make_pose_estimate(TRUE_POSE[:3, 3], [0.8, 0.1, -0.5, 0.3])}
    )


def test_a_calibration_can_be_pickled_and_converted_to_json() -> None:
    calibration = make_calibration()
    text = json.dumps(calibration.to_json(), allow_nan=False)
    assert json.dumps(pickle.loads(pickle.dumps(calibration)).to_json()) == text
    estimates = json.loads(text)["objects"]
    assert estimates["box"]["transform"] == calibration.objects["box"].transform.tolist()
    assert estimates["box"]["points"]["residuals_m"] == calibration.objects["box"].residuals_m.tolist()
    assert json.loads(text)["brackets"]["palm"]["points"] is None


def test_warnings_of_a_file_name_the_entry(tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(VALID.replace("0.56, 0.1, 0.12", "0.56, 0.1, 0.123"))
    assert any(line.startswith(f"{path}: objects[0].points: point ") for line in load_calibration(path).warnings())
