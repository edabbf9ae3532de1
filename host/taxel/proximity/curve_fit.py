"""Fit of the response curve and its uncertainties to the signals of targets that are held at known distances."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from taxel.optional import optional_import
from taxel.proximity.errors import ProximityError
from taxel.proximity.hold_signals import HeldSignal
from taxel.proximity.response import TABLE_END_M, ResponseCurve, look_up, to_axis
from taxel.proximity.skin_points import SkinPoints, compute_plane_gaps
from taxel.types import FloatArray

MIN_DISTANCES = 5
"""Smallest number of distances in a calibration: a decaying curve needs about one support point per halving of its
values."""

DECAY_RANGE = (1.0, 6.0)
"""Range of the power with which the signal decays beyond the last hold: from a field between plates (1) to that of a
dipole and its image (6)."""

MONOTONE_LIMIT = 3.0
"""Largest deviation of a curve from the nearest monotone curve, in standard errors, at which the monotone curve is
used. With a larger value, the response to a dielectric, which changes its sign, would be replaced by a monotone
curve."""

FACING_SHARE = 0.05
"""Smallest sum of squared predicted signals of a taxel that faces the plate, relative to the largest of its board."""


@dataclass(frozen=True, eq=False)
class CurveFit:
    """Fitted response curve with its uncertainties.

    curve_error: relative standard deviation of the curve between its support points. gain_spread: relative standard
    deviation of the response between taxels.
    """

    curve: ResponseCurve
    curve_error: float
    gain_spread: float


def fit_curve(points_of: dict[str, SkinPoints], signals: Sequence[HeldSignal], noise_counts: float) -> CurveFit:
    """Fit the response curve of one kind of board and one target.

    points_of: skin points by board name. signals: signals of the target at known distances, of boards of this kind.
    noise_counts: standard deviation of the white noise of a taxel in one frame. Raises `ProximityError` for fewer than
    `MIN_DISTANCES` distances.
    """
    knots = np.unique(np.array([signal.distance_m for signal in signals]))
    if len(knots) < MIN_DISTANCES:
        raise ProximityError(
            f"{signals[0].board}, target {signals[0].target}: expected holds at {MIN_DISTANCES} distances or more, "
            f"found {len(knots)}; hold the target at more distances"
        )
    gaps = [compute_plane_gaps(points_of[signal.board], signal.distance_m) for signal in signals]
    curve = _fit_support_points(knots, gaps, signals, noise_counts)
    table = curve.make_table()
    predicted = [look_up(table, gap).mean(axis=1) for gap in gaps]
    return CurveFit(
        curve, _compute_curve_error(knots, curve, noise_counts, signals), _compute_spread(predicted, signals)
    )


def _fit_support_points(
    knots: FloatArray, gaps: Sequence[FloatArray], signals: Sequence[HeldSignal], noise_counts: float
) -> ResponseCurve:
    """Fit the values of the curve at the distances `knots` (f64[k], metres) by least squares over all taxels.

    gaps: for each signal the distances of the target from 9 skin points of each of n taxels, f64[n, 9]. On a curved
    board the taxels have different gaps at the same distance: a signal constrains the values at all support points
    between which its gaps lie. `to_axis` returns a logarithmic distance.
    """
    decay = 3.0
    for _ in range(3):  # the decay beyond the last support point follows from the last two of them
        design = np.concatenate([_compute_hat_means(knots, gap, decay) for gap in gaps])
        observed = np.concatenate([signal.signal_counts for signal in signals])
        weight = np.concatenate([np.full(len(signal.signal_counts), np.sqrt(signal.frames)) for signal in signals])
        values, *_ = np.linalg.lstsq(design * weight[:, None], observed * weight, rcond=None)
        ratio = values[-2] / values[-1] if values[-1] * values[-2] > 0 else 1.0
        step = to_axis(knots[-1:])[0] - to_axis(knots[-2:-1])[0]
        decay = float(np.clip(np.log(max(ratio, 1e-3)) / step, *DECAY_RANGE))
    normal = (design * weight[:, None]).T @ (design * weight[:, None])
    error = noise_counts * np.sqrt(np.diag(np.linalg.pinv(normal)))
    return ResponseCurve(knots, _make_monotone(values, error), decay)


def _compute_hat_means(knots: FloatArray, gap: FloatArray, decay: float) -> FloatArray:
    """Compute the mean of each support point's hat function over each taxel's skin points, f64[n, k].

    The hat function of a support point is 1 there, and falls to 0 at the adjacent support points, linearly on the axis
    of `to_axis`. Beyond the last support point its hat function decays exponentially with the rate `decay` on
    this axis. knots: f64[k], metres. gap: f64[n, 9], metres.
    """
    axis, ends = to_axis(np.minimum(gap, TABLE_END_M)), to_axis(knots)
    index = np.clip(np.searchsorted(ends, axis, side="right") - 1, 0, len(ends) - 2)
    share = np.minimum((axis - ends[index]) / (ends[index + 1] - ends[index]), 1.0)
    fade = np.where(gap < TABLE_END_M, np.exp(-decay * np.maximum(axis - ends[-1], 0.0)), 0.0)
    hats = np.zeros((*gap.shape, len(ends)))
    np.put_along_axis(hats, index[..., None], ((1.0 - share) * fade)[..., None], axis=-1)
    np.put_along_axis(hats, index[..., None] + 1, (share * fade)[..., None], axis=-1)
    return np.asarray(hats.mean(axis=1))


def _make_monotone(values: FloatArray, error: FloatArray) -> FloatArray:
    """Return the nearest monotone values if they agree with `values` within `MONOTONE_LIMIT`, otherwise `values`.

    values, error: f64[k], values of the curve at its support points and their standard errors, counts.
    """
    with optional_import("scipy", "the calibration of the proximity response"):
        from scipy.optimize import isotonic_regression
    is_rising = values[-1] > values[0]
    monotone = np.asarray(isotonic_regression(values, weights=1.0 / error**2, increasing=bool(is_rising)).x)
    deviation = np.abs(monotone - values) / np.maximum(error, 1e-9)
    return monotone if deviation.max() <= MONOTONE_LIMIT else values


def _compute_curve_error(
    knots: FloatArray, curve: ResponseCurve, noise_counts: float, signals: Sequence[HeldSignal]
) -> float:
    """Compute the relative error of the curve between its support points, as a root mean square.

    Each inner support point is predicted from the others, which is an interpolation over twice the spacing. For a
    smooth curve, the error of this interpolation is about 4 times the error between two support points (second-order
    interpolation). The deviations are therefore divided by 4.
    """
    errors = []
    for index in range(1, len(knots) - 1):
        kept = np.arange(len(knots)) != index
        reduced = ResponseCurve(curve.distance_m[kept], curve.signal_counts[kept], curve.decay)
        predicted = look_up(reduced.make_table(), curve.distance_m[index : index + 1])[0]
        noise = noise_counts / np.sqrt(sum(signal.frames for signal in signals if signal.distance_m == knots[index]))
        # A signal near 0 would make the relative error of its noise arbitrarily large.
        scale = max(abs(curve.signal_counts[index]), 3.0 * noise)
        errors.append((predicted - curve.signal_counts[index]) / scale / 4.0)
    return float(np.sqrt(np.mean(np.square(errors))))


def _compute_spread(predicted: Sequence[FloatArray], signals: Sequence[HeldSignal]) -> float:
    """Compute the relative standard deviation of the response between the taxels that face the target.

    The gain of a taxel is fitted to its predicted and measured signals of all holds. The standard deviation is
    estimated robustly, from the median absolute deviation of the gains.
    """
    products: dict[str, list[FloatArray]] = {}
    for value, signal in zip(predicted, signals, strict=True):
        entry = products.setdefault(signal.board, [np.zeros(len(value)), np.zeros(len(value))])
        entry[0] += value * signal.signal_counts
        entry[1] += value**2
    gains = np.concatenate(
        [
            (numerator / np.maximum(squares, 1e-9))[squares > FACING_SHARE * squares.max()]
            for numerator, squares in products.values()
        ]
    )
    # For a normal distribution, the standard deviation is 1.4826 times the median absolute deviation.
    return float(1.4826 * np.median(np.abs(gains - np.median(gains))))
