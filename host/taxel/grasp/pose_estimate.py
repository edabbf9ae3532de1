"""A pose and how well it is known: from measured points, or as it was given.

Source of the procedure: thesis, section 5.5: an optical tracker measures the object in the frame of the robot's base.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy import stats

from taxel.grasp.calibration_errors import Place
from taxel.grasp.pose_fit import check_points, cofactor_of, kabsch, studentised
from taxel.hand.errors import format_value
from taxel.hand.transforms import apply, check_rigid, from_quaternion, to_quaternion
from taxel.types import FloatArray

__all__ = ["MeasuredPoints", "PoseEstimate", "fit_pose", "given_pose"]

CONFIDENCE = 0.95
FALSE_ALARM = 0.01  # chance that a good set of points draws a warning


@dataclass(frozen=True, eq=False)
class MeasuredPoints:
    """n points in two frames: f64[n, 3] metres each, their names, their weights f64[n]."""

    names: tuple[str, ...]
    known: FloatArray
    measured: FloatArray
    weights: FloatArray


@dataclass(frozen=True, eq=False)
class PoseEstimate:
    """The pose of a body (an object, a bracket) in a reference frame (the robot's base, a link).

    transform: f64[4, 4], maps points of the body to the reference frame, metres.
    covariance: f64[6, 6], of a rotation vector (rad, about the axes of the reference frame) and a translation (m, of
        the body's origin) that lead from this pose to the true one; NaN where the pose was given: unknown, not zero.
    points: what it was fitted to, None where the pose was given.
    sigma_m: standard deviation of one measured coordinate of weight 1: the given one, else sqrt(w r^2 / (3 n - 6)).
    sigma_given: whether sigma_m was told and not estimated from the residuals.
    source: where it comes from, for reports. measured: date, ISO 8601. instrument: the tracker. Empty if not told.
    """

    transform: FloatArray
    covariance: FloatArray = field(default_factory=lambda: np.full((6, 6), np.nan))
    points: MeasuredPoints | None = None
    sigma_m: float = float("nan")
    sigma_given: bool = False
    source: str = ""
    measured: str = ""
    instrument: str = ""

    @property
    def n_points(self) -> int:
        """Number of points; 0 where the pose was given."""
        return len(self.points.names) if self.points else 0

    @property
    def degrees_of_freedom(self) -> int:
        """3 n - 6; 0 where the pose was given."""
        return max(3 * self.n_points - 6, 0)

    @property
    def residuals_m(self) -> FloatArray:
        """f64[n, 3], measured minus fitted, metres, in the reference frame."""
        if self.points is None:
            return np.zeros((0, 3))
        return self.points.measured - apply(self.transform, self.points.known)

    @property
    def rms_m(self) -> float:
        """Root mean square of the residuals' lengths, metres; NaN where the pose was given."""
        return float(np.sqrt((self.residuals_m**2).sum(axis=1).mean())) if self.points else float("nan")

    @property
    def interval_95(self) -> FloatArray:
        """f64[6], half widths of the 95 % intervals: rotation vector (rad), translation (m), as in `covariance`.

        Student's t with 3 n - 6 degrees of freedom where sigma was estimated, normal where it was given.
        """
        freedom = np.inf if self.sigma_given else self.degrees_of_freedom
        factor = stats.t.ppf((1 + CONFIDENCE) / 2, freedom) if freedom else np.nan
        return np.asarray(factor * np.sqrt(np.diagonal(self.covariance)), dtype=np.float64)

    @property
    def normalised_residuals(self) -> FloatArray:
        """f64[n], each point's residual in units of what the others allow (`pose_fit.studentised`); about 1 is good."""
        return self._studentised()[0]

    def warnings(self) -> tuple[str, ...]:
        """One line for each doubt about the points: the one that lies farthest off, residuals above sigma_m."""
        if self.points is None:
            return ()
        lines = []
        figures, freedom = self._studentised()
        if np.isfinite(figures).any():
            worst = int(np.nanargmax(figures))
            # A share of the false alarms for each point: the largest of n is looked at.
            if _chance(figures[worst], *freedom[worst]) < FALSE_ALARM / self.n_points:
                off_mm = 1e3 * float(np.linalg.norm(self.residuals_m[worst]))
                lines.append(
                    f"{self.source}: point {self.points.names[worst]!r} lies {off_mm:.3g} mm off the pose, "
                    f"{figures[worst]:.3g} times what the others allow; measure it again or leave it out"
                )
        square = (self.points.weights[:, np.newaxis] * self.residuals_m**2).sum()
        if self.sigma_given and stats.chi2.sf(square / self.sigma_m**2, self.degrees_of_freedom) < FALSE_ALARM:
            found = 1e3 * float(np.sqrt(square / self.degrees_of_freedom))
            lines.append(
                f"{self.source}: the residuals speak of {found:.3g} mm where sigma_m says {1e3 * self.sigma_m:.3g} mm; "
                "check the points and the instrument's figure"
            )
        return tuple(lines)

    def to_json(self) -> dict[str, Any]:
        """The estimate as plain numbers, texts and lists, also the figures that follow from the others."""
        points = self.points
        return {
            "position_m": self.transform[:3, 3].tolist(),
            "quaternion_wxyz": to_quaternion(self.transform).tolist(),
            "transform": self.transform.tolist(),
            "covariance": None if np.isnan(self.covariance).any() else self.covariance.tolist(),
            "points": points
            and {
                "names": list(points.names),
                "known_m": points.known.tolist(),
                "measured_m": points.measured.tolist(),
                "weights": points.weights.tolist(),
                "residuals_m": self.residuals_m.tolist(),
                "rms_m": self.rms_m,
                "sigma_m": self.sigma_m,
                "sigma_given": self.sigma_given,
                "interval_95": self.interval_95.tolist(),
            },
            "source": self.source,
            "measured": self.measured,
            "instrument": self.instrument,
        }

    @classmethod
    def from_json(cls, data: Mapping[str, Any], place: Place | None = None) -> PoseEstimate:
        """The estimate that `to_json` wrote, to the last bit; CalibrationError at `place` for anything else."""
        place = place or Place("from_json")
        try:
            transform = _array(data["transform"], (4, 4))
            check_rigid(transform)
            estimate = cls(
                transform=transform,
                source=str(data["source"]),
                measured=str(data["measured"]),
                instrument=str(data["instrument"]),
            )
            if data["covariance"] is not None:
                estimate = replace(estimate, covariance=_array(data["covariance"], (6, 6)))
            if data["points"] is None:
                return estimate
            found = data["points"]
            names = tuple(str(name) for name in found["names"])
            known, measured = (_array(found[key], (len(names), 3)) for key in ("known_m", "measured_m"))
            points = MeasuredPoints(names, known, measured, _array(found["weights"], (len(names),)))
            sigma_m, sigma_given = float(found["sigma_m"]), bool(found["sigma_given"])
            return replace(estimate, points=points, sigma_m=sigma_m, sigma_given=sigma_given)
        except KeyError as error:
            place.fail(f"the key {error}", "nothing", "store what to_json returns")
        except (TypeError, ValueError) as error:
            place.fail("what to_json returns", format_value(str(error)), "store it unchanged")

    def _studentised(self) -> tuple[FloatArray, FloatArray]:
        if self.points is None:
            return np.zeros(0), np.zeros((0, 2))
        _, cofactors = cofactor_of(self.transform, self.points.known, self.points.weights)
        return studentised(self.residuals_m, cofactors, self.points.weights, self.sigma_m if self.sigma_given else None)


def fit_pose(
    known: npt.ArrayLike,
    measured: npt.ArrayLike,
    *,
    names: Sequence[str] | None = None,
    weights: npt.ArrayLike | None = None,
    sigma_m: float | None = None,
    place: Place | None = None,
) -> PoseEstimate:
    """The pose that takes points known on a body to where they were measured; see `pose_fit` for the model.

    The same call serves an object measured in the base frame and a re-mounted bracket measured in its link's frame.

    Args:
        known: f64[n, 3], metres, in the body's frame; n >= 3, not on one line.
        measured: f64[n, 3], metres, the same points in the reference frame.
        names: n names for reports; "1" to "n" without.
        weights: f64[n] above 0, relative: a point of weight 4 has half the standard deviation. All 1 without.
        sigma_m: the tracker's standard deviation of one coordinate; without it, it is estimated from the residuals.
        place: where the points come from, for errors and `source`.

    Raises:
        CalibrationError: too few points, on one line, not finite, mirrored, in another unit.
    """
    place = place or Place("fit_pose", "points")
    a, b = np.array(known, dtype=np.float64), np.array(measured, dtype=np.float64)
    if a.ndim != 2 or a.shape[1] != 3 or a.shape != b.shape:
        place.fail("known and measured of shape [n, 3] each", f"{a.shape} and {b.shape}", "give both for each point")
    if not (np.isfinite(a).all() and np.isfinite(b).all()):
        place.fail("finite coordinates", "a NaN or an infinity", "leave that point out")
    w = np.ones(len(a)) if weights is None else np.array(weights, dtype=np.float64)
    if w.shape != (len(a),) or not (np.isfinite(w) & (w > 0)).all():
        place.fail(
            f"{len(a)} finite weights above 0", format_value(w.tolist() if w.size < 2 else w.shape), "correct them"
        )
    if sigma_m is not None and not (np.isfinite(sigma_m) and sigma_m > 0):
        place.fail("sigma_m in metres, above 0", format_value(sigma_m), "give it or leave it out")
    labels = tuple(names) if names is not None else tuple(str(i + 1) for i in range(len(a)))
    if len(labels) != len(a):
        place.fail(f"{len(a)} names", str(len(labels)), "name each point")
    check_points(a, b, w, place)
    transform = kabsch(a, b, w)
    cofactor, _ = cofactor_of(transform, a, w)
    residuals = b - apply(transform, a)
    estimated = np.sqrt((w[:, np.newaxis] * residuals**2).sum() / (3 * len(a) - 6))
    sigma = float(estimated if sigma_m is None else sigma_m)
    points = MeasuredPoints(labels, a, b, w)
    return PoseEstimate(transform, sigma**2 * cofactor, points, sigma, sigma_m is not None, str(place))


def given_pose(position_m: npt.ArrayLike, quaternion_wxyz: npt.ArrayLike, source: str = "") -> PoseEstimate:
    """A pose that was told, of unknown covariance. position_m: f64[3]; quaternion_wxyz: f64[4]."""
    transform = from_quaternion(quaternion_wxyz)
    transform[:3, 3] = position_m
    return PoseEstimate(transform, source=source)


def _chance(figure: float, rank: float, remaining: float) -> float:
    """Of a studentised residual at least this large at a good point."""
    if np.isinf(remaining):
        return float(stats.chi2.sf(rank * figure**2, rank))  # scipy's F has no such limit
    return float(stats.f.sf(figure**2, rank, remaining))


def _array(values: Any, shape: tuple[int, ...]) -> FloatArray:
    array = np.array(values, dtype=np.float64)
    if array.shape != shape or not np.isfinite(array).all():
        raise ValueError(f"finite numbers of shape {shape} expected, shape {array.shape} found")
    return array
