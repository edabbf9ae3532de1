"""Pose with its covariance, fitted to measured points or given directly.

Source of the procedure: thesis, section 5.5; an optical tracker measures the object in the frame of the robot's base.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.special import chdtrc, fdtrc, stdtrit

from taxel.grasp.calibration_errors import CalibrationField
from taxel.grasp.pose_fit import check_points, compute_cofactors, solve_kabsch, studentise
from taxel.hand.errors import format_value
from taxel.hand.transforms import apply, from_quaternion, to_quaternion
from taxel.types import FloatArray

__all__ = ["MeasuredPoints", "PoseEstimate", "fit_pose", "make_pose_estimate"]

CONFIDENCE = 0.95
FALSE_ALARM = 0.01
"""Probability of a warning for points without outliers; a lower value detects only larger outliers."""


@dataclass(frozen=True, eq=False)
class MeasuredPoints:
    """Points in the body frame and as measured in the reference frame: f64[n, 3] each, metres; weights: f64[n]."""

    names: tuple[str, ...]
    body_m: FloatArray
    measured_m: FloatArray
    weights: FloatArray


@dataclass(frozen=True, eq=False)
class PoseEstimate:
    """Pose of a body (an object, a bracket) in a reference frame (the robot's base, a link).

    transform: f64[4, 4], maps points of the body to the reference frame, metres.
    covariance: f64[6, 6], of the rotation vector (rad, about the axes of the reference frame) and the translation (m,
        of the body's origin) from this pose to the true pose; NaN (unknown) for a given pose.
    points: the fitted points; None for a given pose.
    sigma_m: standard deviation of a measured coordinate of weight 1: given, or estimated as sqrt(w r^2 / (3 n - 6)).
    sigma_given: whether sigma_m was given instead of estimated from the residuals.
    source: origin of the pose, for reports. measured: date, ISO 8601. instrument: the tracker. Empty if unknown.
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
        """Number of measured points behind the pose; 0 for a given pose."""
        return len(self.points.names) if self.points else 0

    @property
    def degrees_of_freedom(self) -> int:
        """Degrees of freedom of the fit to n points, 3 n - 6; 0 for a given pose."""
        return max(3 * self.n_points - 6, 0)

    @property
    def residuals_m(self) -> FloatArray:
        """Residuals of the n points (measured minus fitted), f64[n, 3], metres, in the reference frame."""
        if self.points is None:
            return np.zeros((0, 3))
        return self.points.measured_m - apply(self.transform, self.points.body_m)

    @property
    def rms_m(self) -> float:
        """Root mean square of the lengths of the points' residuals, metres; NaN for a given pose."""
        return float(np.sqrt((self.residuals_m**2).sum(axis=1).mean())) if self.points else float("nan")

    @property
    def interval_95(self) -> FloatArray:
        """Half widths of the 95 % intervals of the pose, f64[6]: rotation vector (rad) and translation (m).

        Student's t with 3 n - 6 degrees of freedom if the measurement error is estimated from the n points, normal
        distribution if it is given.
        """
        degrees = np.inf if self.sigma_given else self.degrees_of_freedom
        factor = stdtrit(degrees, (1 + CONFIDENCE) / 2) if degrees else np.nan
        return np.asarray(factor * np.sqrt(np.diagonal(self.covariance)), dtype=np.float64)

    def warnings(self) -> tuple[str, ...]:
        """Return warnings about the measured points: the largest outlier, and residuals above the stated accuracy.

        One line for each warning.
        """
        if self.points is None:
            return ()
        lines = []
        values, degrees = self._studentise_residuals()
        if np.isfinite(values).any():
            worst = int(np.nanargmax(values))
            # Bonferroni correction, since the largest of n values is tested.
            if _compute_survival(values[worst], *degrees[worst]) < FALSE_ALARM / self.n_points:
                distance_mm = 1e3 * float(np.linalg.norm(self.residuals_m[worst]))
                lines.append(
                    f"{self.source}: point {self.points.names[worst]!r} has a residual of {distance_mm:.3g} mm, "
                    f"{values[worst]:.3g} times the value expected from the other points; measure it again or remove it"
                )
        square = (self.points.weights[:, np.newaxis] * self.residuals_m**2).sum()
        if self.sigma_given and chdtrc(self.degrees_of_freedom, square / self.sigma_m**2) < FALSE_ALARM:
            sigma_mm = 1e3 * float(np.sqrt(square / self.degrees_of_freedom))
            lines.append(
                f"{self.source}: expected residuals of {1e3 * self.sigma_m:.3g} mm (sigma_m), found {sigma_mm:.3g} mm; "
                "check the points and the accuracy of the instrument"
            )
        return tuple(lines)

    def to_json(self) -> dict[str, Any]:
        """Convert the pose estimate, its points and its intervals to JSON values."""
        points = self.points
        return {
            "position_m": self.transform[:3, 3].tolist(),
            "quaternion_wxyz": to_quaternion(self.transform).tolist(),
            "transform": self.transform.tolist(),
            "covariance": None if np.isnan(self.covariance).any() else self.covariance.tolist(),
            "points": points
            and {
                "names": list(points.names),
                "known_m": points.body_m.tolist(),
                "measured_m": points.measured_m.tolist(),
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

    def _studentise_residuals(self) -> tuple[FloatArray, FloatArray]:
        """Compute the studentised residuals of the n points, f64[n], and their degrees of freedom, f64[n, 2].

        A studentised residual is the residual of a point divided by its standard deviation (no unit). If `sigma_given`,
        the standard deviation follows from `sigma_m`, otherwise from the residuals of the other points. The square of a
        studentised residual has an F distribution. Columns of the degrees of freedom: numerator (number of directions
        in which the residual of the point can vary, at most 3), denominator (infinite if `sigma_given`). A given pose
        without points has n = 0.
        """
        if self.points is None:
            return np.zeros(0), np.zeros((0, 2))
        _, cofactors = compute_cofactors(self.transform, self.points.body_m, self.points.weights)
        return studentise(self.residuals_m, cofactors, self.points.weights, self.sigma_m if self.sigma_given else None)


def fit_pose(
    body_points: npt.ArrayLike,
    measured_points: npt.ArrayLike,
    *,
    names: Sequence[str] | None = None,
    weights: npt.ArrayLike | None = None,
    sigma_m: float | None = None,
    place: CalibrationField | None = None,
) -> PoseEstimate:
    """Fit the pose of a body to measured points by weighted least squares, with covariance.

    Used for objects measured in the base frame and for remounted brackets measured in the frame of their link.

    body_points: f64[n, 3], metres, in the body frame; n >= 3, not collinear. measured_points: f64[n, 3], metres, the
    same points in the reference frame. names: n names for reports; default "1" to "n". weights: f64[n] above 0,
    relative: a point of weight 4 has half the standard deviation; default 1. sigma_m: standard deviation of a
    coordinate of the tracker; None: estimated from the residuals. place: origin of the points, for errors and `source`.

    Raises CalibrationError for too few, collinear, infinite or mirrored points, or another unit.
    """
    place = place or CalibrationField("fit_pose", "points")
    a, b = np.array(body_points, dtype=np.float64), np.array(measured_points, dtype=np.float64)
    if a.ndim != 2 or a.shape[1] != 3 or a.shape != b.shape:
        place.fail("body and measured points, [n, 3] each", f"{a.shape} and {b.shape}", "pass both for each point")
    if not (np.isfinite(a).all() and np.isfinite(b).all()):
        place.fail("finite coordinates", "NaN or infinity", "remove this point")
    w = np.ones(len(a)) if weights is None else np.array(weights, dtype=np.float64)
    if w.shape != (len(a),) or not (np.isfinite(w) & (w > 0)).all():
        place.fail(
            f"{len(a)} finite weights above 0",
            format_value(w.tolist() if w.size < 2 else w.shape),
            "correct the weights",
        )
    if sigma_m is not None and not (np.isfinite(sigma_m) and sigma_m > 0):
        place.fail("sigma_m in metres, above 0", format_value(sigma_m), "correct or omit it")
    labels = tuple(names) if names is not None else tuple(str(i + 1) for i in range(len(a)))
    if len(labels) != len(a):
        place.fail(f"{len(a)} names", str(len(labels)), "name each point")
    check_points(a, b, w, place)
    transform = solve_kabsch(a, b, w)
    cofactor, _ = compute_cofactors(transform, a, w)
    residuals = b - apply(transform, a)
    # Degrees of freedom: three coordinates of each point minus the six parameters of the pose.
    estimated = np.sqrt((w[:, np.newaxis] * residuals**2).sum() / (3 * len(a) - 6))
    sigma = float(estimated if sigma_m is None else sigma_m)
    points = MeasuredPoints(labels, a, b, w)
    return PoseEstimate(transform, sigma**2 * cofactor, points, sigma, sigma_m is not None, str(place))


def make_pose_estimate(position_m: npt.ArrayLike, quaternion_wxyz: npt.ArrayLike, source: str = "") -> PoseEstimate:
    """Make an estimate of a given pose, without measured points and with unknown covariance.

    position_m: f64[3]. quaternion_wxyz: f64[4]. source: origin of the pose, for reports.
    """
    transform = from_quaternion(quaternion_wxyz)
    transform[:3, 3] = position_m
    return PoseEstimate(transform, source=source)


def _compute_survival(value: float, rank: float, remaining: float) -> float:
    """Compute the probability that a studentised residual is at least `value` if there are no outliers.

    rank, remaining: degrees of freedom of numerator and denominator of its square, which has an F distribution;
    remaining is infinite for a given measurement error.
    """
    if np.isinf(remaining):
        return float(chdtrc(rank, rank * value**2))  # fdtrc does not accept infinity
    return float(fdtrc(rank, remaining, value**2))
