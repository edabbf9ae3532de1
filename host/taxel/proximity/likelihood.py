"""Likelihood of one frame of a window of taxels for every template, distance and gain.

The signals y of a window are y = a m + b 1 + n: the prediction m of a template at a distance, a gain a, an offset b that
the taxels share (drift of the baseline), and noise n. Offset, error of the gain and position within a cell of distance are
normally distributed and integrated in closed form (matrix inversion lemma, Woodbury 1950). The variance of n contains the
white noise and the error of the templates, which grows with the signal.

The normalising factors of the densities are left out. They would favour the hypothesis with the smaller signal in every
frame again, although the errors of templates and gains persist over many frames: the estimates would drift away from the
skin with the number of frames.
"""

from collections.abc import Sequence

import numpy as np

from taxel.proximity.calibration import KindCalibration, TargetResponse
from taxel.proximity.motion_grid import CENTRES_M, WIDTHS_M
from taxel.proximity.templates import Window
from taxel.types import FloatArray

GAINS = (0.9, 1.0, 1.1)
"""Gains of a target that persist over frames: area that the target covers, temperature, parts."""
GAIN_WEIGHTS = (0.2, 0.6, 0.2)

SHAPE_ERROR = 0.06
"""Relative standard deviation between the signal of a taxel and that of the nearest template (chosen: half of the
difference between neighbouring templates of radius and position, 5 to 15 %)."""

NEIGHBOUR_ERROR = 0.02
"""Error of a template at any taxel, relative to the largest signal of the window: the field of a taxel reaches sideways
below the edge of a target, which the templates do not contain (chosen)."""

GAIN_ERROR = 0.04
"""Relative standard deviation of the gain around the nearest of `GAINS`: their spacing divided by the root of 6."""

PERSISTENT_FRAMES = 4.0
"""Number of frames over which errors of shape and gain persist. The filter treats frames as independent, so the variances
of these errors are larger by this factor. A smaller value narrows the intervals of slow targets."""

CONTACT_COUNTS = 300.0
"""Standard deviation of the signals in contact, counts: contact lowers the counts of pressed taxels by hundreds."""


class WindowLikelihood:
    """Likelihoods of the frames of one window.

    targets: responses of the calibration, in a fixed order; the templates of all targets are stacked: K = targets x
    templates. The arrays have the shape [K * G, n] with G cells of distance and n taxels.
    """

    def __init__(self, window: Window, calibration: KindCalibration, targets: Sequence[TargetResponse]) -> None:
        """Predict the signals of all templates."""
        self.taxels = window.taxels
        self.noise = calibration.noise_counts
        mean = np.concatenate([window.predict(target.curve.make_table(), CENTRES_M) for target in targets])
        slope = np.gradient(mean, CENTRES_M, axis=1) * (WIDTHS_M / np.sqrt(12.0))[:, None]
        self.shape = mean.shape[:2]
        products = (mean, slope, mean * mean, mean * slope, slope * slope)
        self._products = np.stack([array.reshape(-1, mean.shape[2]) for array in products]).astype(np.float32)
        spread = max(target.gain_spread for target in targets)
        self._relative_variance = PERSISTENT_FRAMES * (SHAPE_ERROR**2 + spread**2)
        self._neighbour_variance = PERSISTENT_FRAMES * NEIGHBOUR_ERROR**2
        error = np.concatenate([np.full(window.count, target.curve_error) for target in targets])
        self._gain_error = np.sqrt(PERSISTENT_FRAMES * (GAIN_ERROR**2 + error**2))[:, None]

    def _compute_weight(self, signal: FloatArray) -> FloatArray:
        """Compute the inverse variance of each taxel, f64[n], from the measured signals."""
        squares = signal**2
        variance = self.noise**2 + self._relative_variance * squares + self._neighbour_variance * squares.max()
        return np.asarray(1.0 / variance)

    def evaluate(self, signal: FloatArray, offset_counts: float) -> tuple[FloatArray, float, float]:
        """Compute the log-likelihoods of the signals f64[n] of the window, counts.

        offset_counts: standard deviation of the offset that all taxels share. Returns those of the templates at each
        distance, f64[gains, K, G], that of no target, and that of a contact.
        """
        weight = self._compute_weight(signal)
        weighted = np.stack([weight, weight * signal], axis=1).astype(np.float32)
        sums = (self._products @ weighted).astype(np.float64).reshape(5, *self.shape, 2)
        m1, s1, mm, ms, ss = sums[..., 0]
        my, sy = sums[0, ..., 1], sums[1, ..., 1]
        one, total, square = weight.sum(), weight @ signal, (weight * signal) @ signal
        directions = _Directions(offset_counts, self._gain_error, one, m1, s1, mm, ms, ss)
        result = np.empty((len(GAINS), *self.shape))
        for index, gain in enumerate(GAINS):
            explained = directions.compute_explained(total - gain * m1, my - gain * mm, sy - gain * ms)
            result[index] = -0.5 * (square - 2.0 * gain * my + gain**2 * mm - explained)
        absent = -0.5 * (square - (offset_counts * total) ** 2 / (1.0 + offset_counts**2 * one))
        return result, float(absent), self._evaluate_contact(signal, weight)

    def _evaluate_contact(self, signal: FloatArray, weight: FloatArray) -> float:
        """Compute the log-likelihood of a contact, whatever the pressure, relative to the other ones."""
        variance = CONTACT_COUNTS**2
        return float(-0.5 * ((signal @ signal) / variance + np.log(variance * weight).sum()))


class _Directions:
    """Quadratic form of the three directions that are integrated: offset, gain, position within the cell.

    offset: standard deviation of the offset, counts. gain: relative one of the gain, f64[K, 1]. The sums f64[K, G] are
    those of the weights with the products of 1, mean (m) and slope (s).
    """

    def __init__(
        self,
        offset: float,
        gain: FloatArray,
        one: float,
        m1: FloatArray,
        s1: FloatArray,
        mm: FloatArray,
        ms: FloatArray,
        ss: FloatArray,
    ) -> None:
        """Factorise 1 + U^T W U by Cholesky, for all templates and distances at once."""
        self._offset, self._gain = offset, gain
        self._l00 = np.sqrt(1.0 + offset**2 * one)
        self._l10 = offset * gain * m1 / self._l00
        self._l20 = offset * s1 / self._l00
        self._l11 = np.sqrt(1.0 + gain**2 * mm - self._l10**2)
        self._l21 = (gain * ms - self._l20 * self._l10) / self._l11
        self._l22 = np.sqrt(1.0 + ss - self._l20**2 - self._l21**2)

    def compute_explained(self, total: FloatArray, product: FloatArray, slopes: FloatArray) -> FloatArray:
        """Compute the part of the misfit that the directions explain, f64[K, G], from the projected residuals."""
        x0 = self._offset * total / self._l00
        x1 = (self._gain * product - self._l10 * x0) / self._l11
        x2 = (slopes - self._l20 * x0 - self._l21 * x1) / self._l22
        return np.asarray(x0**2 + x1**2 + x2**2)
