"""Least-squares fit of a rigid pose to measured points.

Model: ``measured_i = R points_i + t + e_i`` with normal, isotropic e_i of variance ``sigma^2 / weight_i``. The points
in the body frame (a CAD model) are exact.
"""

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from taxel.grasp.calibration_errors import CalibrationField
from taxel.hand.transforms import apply, rotate
from taxel.types import FloatArray

__all__ = ["check_points", "compute_cofactors", "solve_kabsch", "studentise"]

MIN_POINTS = 3
LINE_LIMIT = 1e-3
"""Smallest ratio of width to length of the points; below it the rotation about their line is not determined."""
MIRROR_RATIO = 0.1
"""Points are reported as mirrored if a reflection reduces the RMS below this fraction."""
MISFIT = 0.01
"""Ratio of RMS to extent of the points above which a reflection is tested; trackers are a hundred times better."""
SCALE_TOLERANCE = 0.05
"""Relative tolerance of the scale between two units."""
UNITS: Mapping[str, float] = {"millimetres": 1000.0, "centimetres": 100.0, "inches": 1 / 0.0254}  # per metre
SIGMA_FLOOR_M = 1e-9
"""Smallest standard deviation, metres; smaller residuals are rounding errors."""


def solve_kabsch(
    points: FloatArray, measured: FloatArray, weights: FloatArray, is_mirrored: bool = False
) -> FloatArray:
    """Solve for the pose f64[4, 4] that maps points to measured points with the least weighted squares.

    points, measured: f64[n, 3], metres. weights: f64[n]. is_mirrored: return the best reflection instead, which is used
    to detect left-handed points. Source: Kabsch, Acta Cryst. A32 (1976) 922; Umeyama, IEEE TPAMI 13 (1991) 376, without
    scale.
    """
    weight = weights[:, np.newaxis] / weights.sum()
    centre, measured_centre = (weight * points).sum(axis=0), (weight * measured).sum(axis=0)
    u, _, vt = np.linalg.svd((weight * (measured - measured_centre)).T @ (points - centre))
    # The sign gives the result the determinant +1 (rotation), or -1 (reflection).
    sign = np.sign(np.linalg.det(u @ vt)) * (-1 if is_mirrored else 1)
    transform = np.eye(4)
    transform[:3, :3] = u @ np.diag([1.0, 1.0, sign]) @ vt
    transform[:3, 3] = measured_centre - transform[:3, :3] @ centre
    return transform


def compute_cofactors(transform: FloatArray, points: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Compute the cofactors (covariances for unit variance) of a fitted pose and of its residuals, to first order.

    transform: fitted pose f64[4, 4] with the rotation R and the translation t. points: f64[n, 3], metres, in the body
    frame. weights: f64[n].

    Let the true pose have the rotation ``exp([d]x) R`` and the translation ``t + u``; d is a small rotation vector
    about the axes of the reference frame, u a small translation of the origin of the body frame, and ``[v]x`` the
    matrix of the cross product with v. Point i then moves by ``J_i (d, u)`` with ``J_i = [-[R points_i]x, 1]``. The
    normal matrix is ``N = sum weight_i J_i^T J_i``.

    Returns ``Q = N^-1`` f64[6, 6] (rotation vector, then translation) and the blocks ``1 / weight_i - J_i Q J_i^T``
    f64[n, 3, 3] of the residuals. Source: the Gauss-Markov model, as in Foerstner and Wrobel, Photogrammetric Computer
    Vision (2016), chapter 4.
    """
    x, y, z = rotate(transform, points).T
    jacobian = np.zeros((len(points), 3, 6))
    jacobian[:, 0, 1], jacobian[:, 0, 2] = z, -y
    jacobian[:, 1, 0], jacobian[:, 1, 2] = -z, x
    jacobian[:, 2, 0], jacobian[:, 2, 1] = y, -x
    jacobian[:, :, 3:] = np.eye(3)
    normal = np.einsum("n,nki,nkj->ij", weights, jacobian, jacobian)
    cofactor = np.linalg.inv(normal)
    residual = np.eye(3) / weights[:, np.newaxis, np.newaxis] - jacobian @ cofactor @ np.swapaxes(jacobian, 1, 2)
    return (cofactor + cofactor.T) / 2, residual


def studentise(
    residuals: FloatArray, cofactors: FloatArray, weights: FloatArray, sigma_m: float | None
) -> tuple[FloatArray, FloatArray]:
    """Compute the studentised residuals f64[n] of measured points and their degrees of freedom f64[n, 2].

    A studentised residual is the residual of a point divided by its standard deviation; outliers have large values.
    residuals: f64[n, 3], metres. cofactors: f64[n, 3, 3], covariances of the residuals for unit variance. weights:
    f64[n]. sigma_m: standard deviation of a coordinate of weight 1, metres; None: estimated for each point from the
    residuals of the other points. Columns of the degrees of freedom: k, then m - k, as defined below.

    The value of a point with the residual r and the cofactors C of rank k is the square root of F = (r^T C^+ r / k) /
    s^2, where C^+ is the pseudoinverse of C and s^2 the variance estimated without the point, or sigma_m^2. F has k and
    m - k degrees of freedom, m = 3 n - 6 (infinite with sigma_m). NaN if no degrees of freedom remain.

    Source: Baarda, A testing procedure for use in geodetic networks (1968), with s^2 estimated without the point.
    """
    values, axes = np.linalg.eigh(cofactors * weights[:, np.newaxis, np.newaxis])
    is_tested = values > 1e-9  # relative to the variance of weight 1; smaller values are rounding errors
    component = np.einsum("nki,nk->ni", axes, residuals) * np.sqrt(weights)[:, np.newaxis]
    square = np.where(is_tested, component**2 / np.where(is_tested, values, 1), 0).sum(axis=1)
    rank = is_tested.sum(axis=1).astype(np.float64)
    if sigma_m is not None:
        remaining, variance = np.full(len(rank), np.inf), np.full(len(rank), sigma_m**2)
    else:
        remaining = 3.0 * len(rank) - 6 - rank
        total = (weights[:, np.newaxis] * residuals**2).sum()
        variance = np.maximum(total - square, 0) / np.where(remaining > 0, remaining, np.nan)
    value = np.sqrt(square / np.where(rank > 0, rank, np.nan) / np.maximum(variance, SIGMA_FLOOR_M**2))
    return value, np.stack([rank, remaining], axis=1)


def check_points(points: FloatArray, measured: FloatArray, weights: FloatArray, place: CalibrationField) -> None:
    """Raise CalibrationError for points that do not determine a pose, or that indicate a wrong unit or handedness.

    points, measured: f64[n, 3], metres, in the body frame and in the reference frame. weights: f64[n]. place: location
    of the points, for messages.
    """
    if len(points) < MIN_POINTS:
        place.fail(f"at least {MIN_POINTS} points", str(len(points)), "measure more points that are not collinear")
    _check_spread(points, "in the body frame", place)
    _check_spread(measured, "as measured", place)
    _check_unit(points, measured, weights, place)
    extent = _compute_extent(measured)
    proper = _compute_rms(solve_kabsch(points, measured, weights), points, measured)
    mirrored = _compute_rms(solve_kabsch(points, measured, weights, is_mirrored=True), points, measured)
    if proper > MISFIT * extent and mirrored < MIRROR_RATIO * proper:
        place.fail(
            "points of right-handed frames",
            f"a mirror image (RMS {1e3 * proper:.3g} mm, mirrored {1e3 * mirrored:.3g} mm)",
            "change the sign of one axis, or check for swapped axes",
        )


def _check_spread(points: FloatArray, label: str, place: CalibrationField) -> None:
    """Raise CalibrationError for points f64[n, 3] that do not span a plane.

    label: phrase for the message. place: location of the points, for the message.
    """
    length, width, _ = np.linalg.svd(points - points.mean(axis=0), full_matrices=True)[1][:3]
    if not length > 0:
        place.fail("distinct points", f"identical points {label}", "measure different points")
    if width < LINE_LIMIT * length:
        place.fail("points that span a plane", f"collinear points {label}", "add a point beside the line")


def _check_unit(points: FloatArray, measured: FloatArray, weights: FloatArray, place: CalibrationField) -> None:
    """Raise CalibrationError if the points fit only after a scale by a common unit, such as millimetres.

    points, measured: f64[n, 3], which should be in metres. weights: f64[n]. place: location, for the message.
    """
    ratio = _compute_extent(measured) / _compute_extent(points)
    for unit, per_metre in UNITS.items():
        for factor, label in ((per_metre, "measured"), (1 / per_metre, "body")):
            scaled = points * factor
            if abs(ratio / factor - 1) > SCALE_TOLERANCE:
                continue
            if _compute_rms(
                solve_kabsch(scaled, measured, weights), scaled, measured
            ) < SCALE_TOLERANCE * _compute_extent(measured):
                place.fail(
                    "coordinates in metres",
                    f"{label} coordinates that fit in {unit} (a scale of {factor:g})",
                    f"divide the {label} coordinates by {per_metre:.6g}",
                )


def _compute_extent(points: FloatArray) -> float:
    """Compute the root mean square distance of points f64[n, 3] from their centre, metres."""
    return float(np.sqrt(((points - points.mean(axis=0)) ** 2).sum(axis=1).mean()))


def _compute_rms(transform: npt.ArrayLike, points: FloatArray, measured: FloatArray) -> float:
    """Compute the root mean square distance of measured points from the transformed points, metres."""
    return float(np.sqrt(((measured - apply(transform, points)) ** 2).sum(axis=1).mean()))
