"""The rigid pose that takes points known in one frame to the same points measured in another, by least squares.

Model: ``measured_i = R points_i + t + e_i`` with e_i normal, the same in x, y and z, variance ``sigma^2 / weight_i``.
The points in their own frame (a CAD model) count as exact.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from taxel.grasp.calibration_errors import Place
from taxel.hand.transforms import apply, rotate
from taxel.types import FloatArray

__all__ = ["check_points", "cofactor_of", "kabsch", "studentised"]

MIN_POINTS = 3
LINE_LIMIT = 1e-3  # width over length of the points; below it the turn about their line is not known
MIRROR_RATIO = 0.1  # a reflection that leaves less than this of the RMS is what was measured
MISFIT = 0.01  # RMS over the extent of the points; trackers are a hundred times better
SCALE_SLACK = 0.05  # of a unit's ratio
UNITS: Mapping[str, float] = {"millimetres": 1000.0, "centimetres": 100.0, "inches": 1 / 0.0254}  # in a metre
SIGMA_FLOOR_M = 1e-9  # below what any tracker resolves: residuals smaller than this are rounding


def kabsch(points: FloatArray, measured: FloatArray, weights: FloatArray, mirrored: bool = False) -> FloatArray:
    """The pose f64[4, 4] of least weighted squares; points, measured: f64[n, 3], metres; weights: f64[n].

    Source: Kabsch, Acta Cryst. A32 (1976) 922; Umeyama, IEEE TPAMI 13 (1991) 376, without scale. With `mirrored` the
    best reflection instead, which is no rigid pose and only serves to find left-handed points.
    """
    share = weights[:, np.newaxis] / weights.sum()
    middle, seen = (share * points).sum(axis=0), (share * measured).sum(axis=0)
    left, _, right = np.linalg.svd((share * (measured - seen)).T @ (points - middle))
    sign = np.sign(np.linalg.det(left @ right)) * (-1 if mirrored else 1)
    transform = np.eye(4)
    transform[:3, :3] = left @ np.diag([1.0, 1.0, sign]) @ right
    transform[:3, 3] = seen - transform[:3, :3] @ middle
    return transform


def cofactor_of(transform: FloatArray, points: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
    """What one unit of measurement variance makes of the pose and of the residuals, to first order.

    With the true pose ``exp([d]x) R, t + u`` a point moves by ``J_i (d, u)``, ``J_i = [-[R points_i]x, 1]``: d turns
    about the axes of the measuring frame, u moves the origin of the points' frame. The normal matrix is
    ``N = sum weight_i J_i^T J_i``.

    Returns ``Q = N^-1`` f64[6, 6] (rotation vector, then translation) and the blocks
    ``1 / weight_i - J_i Q J_i^T`` f64[n, 3, 3] of the residuals. Source: the Gauss-Markov model, as in Foerstner and
    Wrobel, Photogrammetric Computer Vision (2016), chapter 4.
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


def studentised(
    residuals: FloatArray, cofactors: FloatArray, weights: FloatArray, sigma_m: float | None
) -> tuple[FloatArray, FloatArray]:
    """How far each point lies off in units of what the others allow, and the figures that a rare chance gives.

    residuals: f64[n, 3], metres; cofactors: f64[n, 3, 3]; sigma_m: of weight 1, None where the residuals must tell it.
    A point's figure is the root of F = (r^T C^+ r / k) / s^2, with k the rank of its block C and s^2 the variance that
    remains without the point, or sigma_m^2. F has k and m - k degrees of freedom, m = 3 n - 6 (infinite with sigma_m).

    Returns the figures f64[n] and the degrees of freedom f64[n, 2]; NaN where nothing remains to compare with.
    Source: Baarda, A testing procedure for use in geodetic networks (1968), with the point left out of s^2.
    """
    values, axes = np.linalg.eigh(cofactors * weights[:, np.newaxis, np.newaxis])
    tested = values > 1e-9  # of a variance of weight 1; the rest is rounding of zero
    along = np.einsum("nki,nk->ni", axes, residuals) * np.sqrt(weights)[:, np.newaxis]
    square = np.where(tested, along**2 / np.where(tested, values, 1), 0).sum(axis=1)
    rank = tested.sum(axis=1).astype(np.float64)
    if sigma_m is not None:
        remaining, variance = np.full(len(rank), np.inf), np.full(len(rank), sigma_m**2)
    else:
        remaining = 3.0 * len(rank) - 6 - rank
        total = (weights[:, np.newaxis] * residuals**2).sum()
        variance = np.maximum(total - square, 0) / np.where(remaining > 0, remaining, np.nan)
    figure = np.sqrt(square / np.where(rank > 0, rank, np.nan) / np.maximum(variance, SIGMA_FLOOR_M**2))
    return figure, np.stack([rank, remaining], axis=1)


def check_points(points: FloatArray, measured: FloatArray, weights: FloatArray, place: Place) -> None:
    """Raise CalibrationError for points from which no pose follows, or that show a mistake of unit or of hand."""
    if len(points) < MIN_POINTS:
        place.fail(f"at least {MIN_POINTS} points", str(len(points)), "measure more, not on one line")
    _check_spread(points, "in their own frame", place)
    _check_spread(measured, "as measured", place)
    _check_unit(points, measured, weights, place)
    extent = _extent(measured)
    proper = _rms(kabsch(points, measured, weights), points, measured)
    mirrored = _rms(kabsch(points, measured, weights, mirrored=True), points, measured)
    if proper > MISFIT * extent and mirrored < MIRROR_RATIO * proper:
        place.fail(
            "points of right-handed frames",
            f"a mirror image (RMS {1e3 * proper:.3g} mm, mirrored {1e3 * mirrored:.3g} mm)",
            "turn the sign of one axis round, or look for two axes that are swapped",
        )


def _check_spread(points: FloatArray, which: str, place: Place) -> None:
    length, width, _ = np.linalg.svd(points - points.mean(axis=0), full_matrices=True)[1][:3]
    if not length > 0:
        place.fail("points apart from one another", f"all in one place {which}", "measure different points")
    if width < LINE_LIMIT * length:
        place.fail("points that span a plane", f"all on one line {which}", "add a point to the side of that line")


def _check_unit(points: FloatArray, measured: FloatArray, weights: FloatArray, place: Place) -> None:
    ratio = _extent(measured) / _extent(points)
    for unit, per_metre in UNITS.items():
        for factor, which in ((per_metre, "measured"), (1 / per_metre, "known")):
            scaled = points * factor
            if abs(ratio / factor - 1) > SCALE_SLACK:
                continue
            if _rms(kabsch(scaled, measured, weights), scaled, measured) < SCALE_SLACK * _extent(measured):
                place.fail(
                    "coordinates in metres",
                    f"{which} ones that fit as {unit} (a scale of {factor:g})",
                    f"divide the {which} coordinates by {per_metre:.6g}",
                )


def _extent(points: FloatArray) -> float:
    """Root mean square distance from the middle, metres."""
    return float(np.sqrt(((points - points.mean(axis=0)) ** 2).sum(axis=1).mean()))


def _rms(transform: npt.ArrayLike, points: FloatArray, measured: FloatArray) -> float:
    return float(np.sqrt(((measured - apply(transform, points)) ** 2).sum(axis=1).mean()))
