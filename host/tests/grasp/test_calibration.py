"""A pose from measured points is right, says how well it is known, and every mistake in a file is one clear line."""

from __future__ import annotations

import json
import pickle
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import least_squares

from taxel.grasp.calibration import (
    Calibration,
    CalibrationError,
    PoseEstimate,
    fit_pose,
    given_pose,
    load_calibration,
    load_points,
    save_calibration,
)
from taxel.hand.transforms import apply, from_rotation_vector, inverse, make_pose, to_rotation_vector

SEED = 22
SIGMA_M = 50e-6
TRUE_POSE = make_pose([0.612, -0.104, 0.021], [0.8, 0.1, -0.5, 0.3])
# Marks on a box of 60 x 40 x 100 mm, metres.
MARKS = np.array([[0, 0, 0], [0.06, 0, 0], [0.06, 0.04, 0], [0, 0.04, 0.1], [0, 0, 0.1], [0.06, 0.02, 0.1]])

GOOD = """\
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

# What is replaced in GOOD, by what; the field that the error names; a piece of the error.
MISTAKES: dict[str, tuple[str, str, str, str]] = {
    "not TOML": ("version = 1", "version = = 1", "line 2, column 11", "expected valid TOML"),
    "another format": ("taxel-calibration", "taxel-hand", "format", "found 'taxel-hand'"),
    "no format": ('format = "taxel-calibration"\n', "", "format", 'add format = "taxel-calibration"'),
    "another version": ("version = 1", "version = 2", "version", "expected 1, found 2"),
    "true for a version": ("version = 1", "version = true", "version", "found true"),
    "unknown key at the top": ("[[brackets]]", "[[bracket]]", "bracket", "did you mean brackets?"),
    "unknown key of an object": ("instrument", "instrumnt", "objects[0].instrumnt", "did you mean instrument?"),
    "a sensor of an object": ('name = "box"', 'sensor = "box"', "objects[0].sensor", "an unknown one; known are name"),
    "no name": ('name = "box"\n', "", "objects[0].name", "add name"),
    "a bad name": ('"cylinder"', '"my cylinder"', "objects[1].name", "rename it"),
    "a name twice": ('"cylinder"', '"box"', "objects[1].name", "'box', also in objects[0].name"),
    "one table for a list": ("[[brackets]]", "[brackets]", "brackets", "expected a list, found a table"),
    "neither pose nor points": (GOOD[GOOD.index("pose = {") : GOOD.index("\n\n[[br")], "", "objects[1]", "neither"),
    "both pose and points": ("pose = {", "points = []\npose = {", "objects[1]", "found both; keep one"),
    "sigma with a pose": ("pose = {", "sigma_m = 1e-5\npose = {", "objects[1].sigma_m", "with points only"),
    "sigma in micrometres": ("25e-6", "25", "objects[0].sigma_m", "give the standard deviation in metres"),
    "sigma 0": ("25e-6", "0", "objects[0].sigma_m", "above 0"),
    "sigma in quotes": ("25e-6", '"25e-6"', "objects[0].sigma_m", "expected a number, found '25e-6'"),
    "a date in quotes": ("2024-05-17", '"2024-05-17"', "objects[0].measured", "without quotes"),
    "an instrument of two lines": ("C-Track 780", r"C-Track\n780", "objects[0].instrument", "one printable line"),
    "too few weights": ("[1, 1, 2.5, 1]", "[1, 1]", "objects[0].weights", "expected 4 weights, one a point, found 2"),
    "a weight of 0": ("2.5", "0.0", "objects[0].weights[2]", "leave a point out to ignore it"),
    "a row too short": ('["b", 0.06, ', '["b", ', "objects[0].points[1]", "[name, x, y, z, X, Y, Z], found 6 values"),
    "a point name twice": ('["b",', '["a",', "objects[0].points[1]", "'a', also in objects[0].points[0]"),
    "a point without a name": ('["b",', "[2,", "objects[0].points[1]", "found 2; rename it"),
    "a text for a coordinate": ("0.06, 0.0,", '"6 cm", 0.0,', "objects[0].points[1][1]", "found '6 cm'"),
    "a coordinate in millimetres": ("0.06, 0.0,", "60.0, 0.0,", "objects[0].points[1][1]", "in metres, as 0.125"),
    "a coordinate not a number": ("0.06, 0.0,", "nan, 0.0,", "objects[0].points[1][1]", "found nan"),
    "a position in millimetres": ("[0.5, 0.0", "[500, 0.0", "objects[1].pose.position_m[0]", "found 500; give the"),
    "a position of 2 numbers": ("[0.5, 0.0, 0.1]", "[0.5, 0.0]", "objects[1].pose.position_m", "3 numbers, found 2"),
    "a quaternion of length 2": (
        "[0.0, 1.0, 0",
        "[2.0, 0.0, 0",
        "brackets[0].pose.quaternion_wxyz",
        "length 1, found 2",
    ),
    "no quaternion": ("pose.quaternion_wxyz = [0.0, 1.0, 0.0, 0.0]\n", "", "brackets[0].pose.quaternion_wxyz", "add"),
}


def measured_marks(rng: np.random.Generator, sigma_m: float = SIGMA_M) -> NDArray[np.float64]:
    return apply(TRUE_POSE, MARKS) + rng.normal(scale=sigma_m, size=MARKS.shape)


def error_of(estimate: PoseEstimate) -> NDArray[np.float64]:
    """Rotation vector and translation from the estimate to the truth."""
    turn = to_rotation_vector(TRUE_POSE @ inverse(estimate.transform))
    return np.concatenate([turn, TRUE_POSE[:3, 3] - estimate.transform[:3, 3]])


def refusal(known: NDArray[np.float64], measured: NDArray[np.float64]) -> str:
    with pytest.raises(CalibrationError) as caught:
        fit_pose(known, measured)
    assert_one_line(caught.value, "fit_pose", "points")
    return str(caught.value)


def assert_one_line(error: CalibrationError, file: str, field: str) -> None:
    line = str(error)
    assert line.isprintable()
    assert line.startswith(f"{file}: {field}: expected ")
    assert ", found " in line
    assert "; " in line
    assert str(pickle.loads(pickle.dumps(error))) == line


def load_refusal(path: Path, text: str) -> CalibrationError:
    path.write_text(text)
    with pytest.raises(CalibrationError) as caught:
        load_calibration(path)
    return caught.value


def test_exact_points_give_the_exact_pose() -> None:
    estimate = fit_pose(MARKS, apply(TRUE_POSE, MARKS))
    np.testing.assert_allclose(estimate.transform, TRUE_POSE, atol=1e-14)
    assert estimate.rms_m < 1e-15
    assert estimate.warnings() == ()


def test_three_points_are_enough() -> None:
    estimate = fit_pose(MARKS[:3], apply(TRUE_POSE, MARKS[:3]))
    np.testing.assert_allclose(estimate.transform, TRUE_POSE, atol=1e-13)
    assert estimate.degrees_of_freedom == 3


@pytest.mark.parametrize("weights", [np.ones(6), np.array([1, 4, 0.5, 2, 9, 1])])
def test_no_other_pose_has_a_smaller_sum_of_squares(weights: NDArray[np.float64]) -> None:
    print(f"seed {SEED}")
    measured = measured_marks(np.random.default_rng(SEED), 1e-3)
    estimate = fit_pose(MARKS, measured, weights=weights)

    def residuals(change: NDArray[np.float64]) -> NDArray[np.float64]:
        moved = from_rotation_vector(change[:3]) @ estimate.transform
        moved[:3, 3] = estimate.transform[:3, 3] + change[3:]
        return (np.sqrt(weights)[:, np.newaxis] * (measured - apply(moved, MARKS))).ravel()

    best = least_squares(residuals, np.zeros(6), x_scale=[1, 1, 1, 0.1, 0.1, 0.1], xtol=1e-15, ftol=1e-15, gtol=1e-15)
    np.testing.assert_allclose(best.x, 0, atol=1e-8)
    # The covariance is that of the linearised problem.
    expected = estimate.sigma_m**2 * np.linalg.inv(best.jac.T @ best.jac)
    np.testing.assert_allclose(estimate.covariance, expected, rtol=1e-4, atol=1e-3 * np.abs(expected).min())


def test_the_intervals_cover_the_truth_in_95_of_100_trials() -> None:
    print(f"seed {SEED}")
    rng = np.random.default_rng(SEED)
    trials = 2000
    inside = np.zeros((2, 6))
    for _ in range(trials):
        measured = measured_marks(rng)
        for row, sigma in enumerate((None, SIGMA_M)):
            estimate = fit_pose(MARKS, measured, sigma_m=sigma)
            inside[row] += np.abs(error_of(estimate)) <= estimate.interval_95
    coverage = inside / trials
    assert (coverage >= 0.93).all(), coverage
    assert (coverage <= 0.97).all(), coverage


def test_the_estimated_sigma_is_that_of_the_measurement() -> None:
    print(f"seed {SEED}")
    rng = np.random.default_rng(SEED)
    weights = np.array([1, 1, 4, 4, 0.25, 0.25])
    squares = []
    for _ in range(500):
        noise = rng.normal(scale=SIGMA_M, size=MARKS.shape) / np.sqrt(weights)[:, np.newaxis]
        squares.append(fit_pose(MARKS, apply(TRUE_POSE, MARKS) + noise, weights=weights).sigma_m ** 2)
    assert np.sqrt(np.mean(squares)) == pytest.approx(SIGMA_M, rel=0.03)


def test_residuals_are_measured_minus_fitted_in_metres() -> None:
    measured = measured_marks(np.random.default_rng(SEED))
    estimate = fit_pose(MARKS, measured)
    residuals = measured - apply(estimate.transform, MARKS)
    np.testing.assert_array_equal(estimate.residuals_m, residuals)
    assert estimate.rms_m == pytest.approx(np.sqrt((residuals**2).sum() / 6))
    assert estimate.sigma_m == pytest.approx(np.sqrt((residuals**2).sum() / 12))
    assert (estimate.n_points, estimate.degrees_of_freedom) == (6, 12)


def test_a_point_that_lies_off_is_named() -> None:
    measured = measured_marks(np.random.default_rng(SEED))
    measured[3] += [0, 2e-3, 0]
    for sigma in (None, SIGMA_M):
        estimate = fit_pose(MARKS, measured, names=list("abcdef"), sigma_m=sigma)
        assert np.argmax(estimate.normalised_residuals) == 3
        assert "fit_pose: points: point 'd' lies" in estimate.warnings()[0]
        assert estimate.warnings()[0].isprintable()


def test_good_points_seldom_draw_a_warning() -> None:
    print(f"seed {SEED}")
    rng = np.random.default_rng(SEED)
    estimates = [fit_pose(MARKS, measured_marks(rng), sigma_m=s) for _ in range(150) for s in (None, SIGMA_M)]
    assert sum(bool(estimate.warnings()) for estimate in estimates) <= 10


def test_residuals_above_the_instruments_sigma_draw_a_warning() -> None:
    measured = measured_marks(np.random.default_rng(SEED), 1e-3)
    (*_, line) = fit_pose(MARKS, measured, sigma_m=25e-6).warnings()
    assert "mm where sigma_m says 0.025 mm" in line


def test_fewer_than_three_points_are_refused() -> None:
    assert "at least 3 points, found 2" in refusal(MARKS[:2], MARKS[:2])


def test_points_on_one_line_are_refused() -> None:
    line = np.linspace(0, 1, 5)[:, np.newaxis] * np.array([0.1, 0.2, 0.3])
    assert "found all on one line in their own frame; add a point" in refusal(line, apply(TRUE_POSE, line))
    assert "found all on one line as measured" in refusal(MARKS[:5], line)
    assert "found all in one place in their own frame" in refusal(np.ones((4, 3)), MARKS[:4])


def test_mirrored_points_are_refused() -> None:
    measured = measured_marks(np.random.default_rng(SEED))
    assert "found a mirror image" in refusal(MARKS, measured * [1, -1, 1])
    assert "two axes that are swapped" in refusal(MARKS[:, [1, 0, 2]], measured)


def test_points_in_one_plane_have_no_mirror_image_that_could_be_told() -> None:
    flat = MARKS * [1, 1, 0]
    assert fit_pose(flat, flat * [1, -1, 1]).rms_m < 1e-15


@pytest.mark.parametrize(("unit", "per_metre"), [("millimetres", 1000), ("centimetres", 100), ("inches", 1 / 0.0254)])
def test_another_unit_is_named(unit: str, per_metre: float) -> None:
    measured = measured_marks(np.random.default_rng(SEED))
    assert f"measured ones that fit as {unit}" in refusal(MARKS, measured * per_metre)
    assert f"known ones that fit as {unit}" in refusal(MARKS * per_metre, measured)


def test_what_is_not_n_by_3_and_finite_is_refused() -> None:
    assert "(6, 2) and (6, 3)" in refusal(MARKS[:, :2], MARKS)
    assert "a NaN or an infinity" in refusal(MARKS, MARKS * np.nan)
    for options in ({"weights": [1, 2]}, {"weights": [0] * 6}, {"sigma_m": -1.0}, {"names": ["a"]}):
        with pytest.raises(CalibrationError, match="expected"):
            fit_pose(MARKS, MARKS, **options)  # type: ignore[arg-type]


def test_a_file_gives_the_poses_of_objects_and_brackets(tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(GOOD)
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


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_refused_with_one_line(mistake: str, tmp_path: Path) -> None:
    old, new, field, piece = MISTAKES[mistake]
    assert old in GOOD
    path = tmp_path / "cell.toml"
    error = load_refusal(path, GOOD.replace(old, new, 1))
    assert_one_line(error, str(path), field)
    assert piece in str(error)


def test_points_that_give_no_pose_are_refused_with_their_place(tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    text = GOOD[: GOOD.index("weights")] + 'points = [["a", 0, 0, 0, 0, 0, 0]]\n'
    assert_one_line(load_refusal(path, text), str(path), "objects[0].points")
    assert "found 1; measure more" in str(load_refusal(path, text))
    assert "at least 3 points, found 0" in str(load_refusal(path, text.replace('["a", 0, 0, 0, 0, 0, 0]', "")))


def test_an_empty_calibration_is_refused(tmp_path: Path) -> None:
    error = load_refusal(tmp_path / "cell.toml", GOOD[: GOOD.index("[[objects]]")])
    assert "expected at least one object or bracket, found none" in str(error)


def test_a_file_that_cannot_be_read_is_refused(tmp_path: Path) -> None:
    for path, piece in ((tmp_path / "none.toml", "no such file"), (tmp_path, "expected a regular file")):
        with pytest.raises(CalibrationError, match=piece) as caught:
            load_calibration(path)
        assert_one_line(caught.value, str(path), "file")
    assert "is it a calibration?" in str(load_refusal(tmp_path / "big.toml", GOOD + "#\n" * (1 << 19)))


def calibration() -> Calibration:
    rng = np.random.default_rng(SEED)
    box = fit_pose(MARKS, measured_marks(rng), weights=[1, 2, 1, 1, 1, 1 / 3], sigma_m=SIGMA_M)
    plain = fit_pose(MARKS, measured_marks(rng), names=list("abcdef"))
    return Calibration({"box": box, "plain": plain}, {"palm": given_pose(TRUE_POSE[:3, 3], [0.8, 0.1, -0.5, 0.3])})


def assert_same(left: Calibration, right: Calibration) -> None:
    for kind in ("objects", "brackets"):
        ours, theirs = getattr(left, kind), getattr(right, kind)
        assert list(ours) == list(theirs)
        for name, estimate in ours.items():
            np.testing.assert_allclose(theirs[name].transform, estimate.transform, atol=1e-15)
            np.testing.assert_array_equal(theirs[name].covariance, estimate.covariance)
            np.testing.assert_array_equal(theirs[name].interval_95, estimate.interval_95)
            assert theirs[name].n_points == estimate.n_points
            assert (theirs[name].measured, theirs[name].instrument) == (estimate.measured, estimate.instrument)


def test_what_is_saved_loads_as_it_was(tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    save_calibration(path, calibration())
    assert_same(load_calibration(path), calibration())
    path.write_text(GOOD)
    loaded = load_calibration(path)
    save_calibration(path, loaded, overwrite=True)
    assert_same(load_calibration(path), loaded)
    assert [file.name for file in tmp_path.iterdir()] == ["cell.toml"]


def test_a_file_is_not_overwritten_unasked(tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    path.write_text("mine")
    with pytest.raises(CalibrationError, match="found one that exists") as caught:
        save_calibration(path, calibration())
    assert_one_line(caught.value, str(path), "file")
    assert path.read_text() == "mine"


def test_what_could_not_be_loaded_is_not_saved(tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    for bad in (Calibration({"no name!": given_pose([0, 0, 0], [1, 0, 0, 0])}), Calibration()):
        with pytest.raises(CalibrationError, match="expected"):
            save_calibration(path, bad)
    with pytest.raises(CalibrationError, match="a place to write to"):
        save_calibration(tmp_path / "none" / "cell.toml", calibration())
    assert not path.exists()


def test_a_calibration_goes_through_json_and_pickle_to_the_last_bit() -> None:
    given = calibration()
    text = json.dumps(given.to_json(), allow_nan=False)
    back = Calibration.from_json(json.loads(text))
    assert_same(back, given)
    assert json.dumps(back.to_json()) == text
    assert json.dumps(pickle.loads(pickle.dumps(given)).to_json()) == text


def test_json_that_is_no_calibration_is_refused_with_one_line() -> None:
    whole = calibration().to_json()
    box = whole["objects"]["box"]
    scaled = {**box, "transform": (2 * np.eye(4)).tolist()}
    for bad in (
        {},
        {**whole, "version": 2},
        {**whole, "objects": []},
        {**whole, "objects": {"box": {}}},
        {**whole, "objects": {"box": 3}},
        {**whole, "objects": {"box": scaled}},
        {**whole, "objects": {"box": {**box, "covariance": [1, 2]}}},
        {**whole, "objects": {"box": {**box, "points": {**box["points"], "names": ["a"]}}}},
    ):
        with pytest.raises(CalibrationError) as caught:
            Calibration.from_json(bad)
        assert str(caught.value).startswith("from_json: ")
        assert str(caught.value).isprintable()


def test_doubts_of_a_file_name_the_entry(tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(GOOD.replace("0.56, 0.1, 0.12", "0.56, 0.1, 0.123"))
    assert any(line.startswith(f"{path}: objects[0].points: point ") for line in load_calibration(path).warnings())


def test_points_are_read_from_csv(tmp_path: Path) -> None:
    path = tmp_path / "points.csv"
    path.write_text("\ufeffname,x,y,z,X,Y,Z\r\na,0,0,0,0.1,0,0\r\nb,0.1,0,0,0.2,0,0\r\n\r\nc,0,0.1,0,0.1,1e-1,0\r\n")
    points = load_points(path)
    assert points.names == ("a", "b", "c")
    estimate = fit_pose(points.known, points.measured, names=points.names)
    np.testing.assert_allclose(estimate.transform, make_pose([0.1, 0, 0], [1, 0, 0, 0]), atol=1e-14)


@pytest.mark.parametrize(
    ("text", "field", "piece"),
    [
        ("", "line 1", "found ''; name the columns so"),
        ("x,y,z\n", "line 1", "found 'x,y,z'"),
        ("name;x;y;z;X;Y;Z\n", "line 1", "with commas between"),
        ("name,x,y,z,X,Y,Z\na,1,2,3\n", "line 2", "expected 7 values, found 4"),
        ("name,x,y,z,X,Y,Z\na,1,2,3,4,5,six\n", "line 2.Z", "found 'six'; write it as 0.125"),
        ("name,x,y,z,X,Y,Z\na,1,2,3,4,5,600\n", "line 2.Z", "give the coordinate in metres"),
        ("name,x,y,z,X,Y,Z\na,1,2,3,4,5,6\na,1,2,3,4,5,6\n", "line 3", "'a', also in line 2"),
        ("name,x,y,z,X,Y,Z\na b,1,2,3,4,5,6\n", "line 2", "rename it"),
    ],
)
def test_a_mistake_in_csv_is_refused_with_its_line(text: str, field: str, piece: str, tmp_path: Path) -> None:
    path = tmp_path / "points.csv"
    path.write_text(text)
    with pytest.raises(CalibrationError) as caught:
        load_points(path)
    assert_one_line(caught.value, str(path), field)
    assert piece in str(caught.value)
