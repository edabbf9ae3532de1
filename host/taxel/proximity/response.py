"""Response curve of a kind of board: signal of a taxel as a function of the distance of a target."""

from dataclasses import dataclass

import numpy as np

from taxel.types import Float32Array, FloatArray

LENGTH_SCALE_M = 0.002
"""Offset of the logarithmic distance axis, metres: about the thickness of the layer. It influences the interpolation
between the support points; the values at the support points follow from the data alone."""

TABLE_STEP_M = 5e-5
"""Distance between two values of a tabulated curve, metres."""

TABLE_END_M = 0.04
"""Distance beyond which the response is 0. The signal there is far below the noise of any board."""


def to_axis(distance_m: FloatArray) -> FloatArray:
    """Convert distances in metres to the logarithmic axis on which the curve is interpolated: ln(distance + 2 mm)."""
    return np.log(np.maximum(distance_m, 0.0) + LENGTH_SCALE_M)


@dataclass(frozen=True, eq=False)
class ResponseCurve:
    """Signal of a taxel below a parallel target, as k support points with monotone cubic interpolation between them.

    distance_m: f64[k], ascending. signal_counts: f64[k], baseline minus raw count; negative for a grounded conductor.
    Beyond the last support point, the signal is proportional to (distance + 2 mm) to the power of minus `decay`.
    """

    distance_m: FloatArray
    signal_counts: FloatArray
    decay: float

    def make_table(self) -> FloatArray:
        """Tabulate the curve at multiples of `TABLE_STEP_M` from 0 to `TABLE_END_M`, f64[t], counts.

        Below the first support point the curve is extrapolated linearly on the logarithmic axis of `to_axis`; beyond
        the last one it decays with the power `decay`.
        """
        distance = np.arange(0.0, TABLE_END_M, TABLE_STEP_M)
        axis, knots = to_axis(distance), to_axis(self.distance_m)
        values = interpolate_monotone(knots, self.signal_counts, np.clip(axis, knots[0], knots[-1]))
        first_slope = (self.signal_counts[1] - self.signal_counts[0]) / (knots[1] - knots[0])
        values += np.minimum(axis - knots[0], 0.0) * first_slope
        values *= np.exp(-self.decay * np.maximum(axis - knots[-1], 0.0))
        return np.asarray(values)


def look_up(table: FloatArray, distance_m: FloatArray) -> Float32Array:
    """Evaluate a table of `make_table` at distances in metres by linear interpolation; the signal is 0 beyond its end.

    The result has the shape of `distance_m` and single precision, because a window of taxels needs a million values.
    The rounding error is below 1e-3 counts.
    """
    values = np.append(table, 0.0).astype(np.float32)
    position: Float32Array = np.asarray(distance_m, dtype=np.float32) * np.float32(1.0 / TABLE_STEP_M)
    np.clip(position, 0.0, len(table), out=position)
    index = position.astype(np.int32)
    position -= index
    position *= np.append(np.diff(values), 0.0).astype(np.float32)[index]
    position += values[index]
    return position


def interpolate_monotone(knots: FloatArray, values: FloatArray, at: FloatArray) -> FloatArray:
    """Interpolate with piecewise cubics without overshoot: Fritsch and Butland, SIAM J. Sci. Stat. Comput. 5 (1984)
    300.

    knots: f64[k], ascending, k at least 2. values: f64[k]. at: f64[...], positions within the knots; the result has the
    same shape. SciPy's `PchipInterpolator` computes the same, but is not a dependency of the core.
    """
    step = np.diff(knots)
    slope = np.diff(values) / step
    rate = np.zeros(len(knots))
    before, after = 2 * step[1:] + step[:-1], step[1:] + 2 * step[:-1]
    is_monotone = slope[:-1] * slope[1:] > 0
    with np.errstate(divide="ignore", invalid="ignore"):
        mean = (before + after) / (before / slope[:-1] + after / slope[1:])
    rate[1:-1] = np.where(is_monotone, mean, 0.0)
    rate[0], rate[-1] = slope[0], slope[-1]
    index = np.clip(np.searchsorted(knots, at, side="right") - 1, 0, len(step) - 1)
    h, t = step[index], (at - knots[index]) / step[index]
    return np.asarray(
        (1 + 2 * t) * (1 - t) ** 2 * values[index]
        + t * (1 - t) ** 2 * h * rate[index]
        + t**2 * (3 - 2 * t) * values[index + 1]
        + t**2 * (t - 1) * h * rate[index + 1]
    )
