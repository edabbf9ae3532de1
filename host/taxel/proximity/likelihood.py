"""Likelihood of one frame of a window of taxels for every template, distance and gain.

The signals y of a window are y = a m + b 1 + n: the prediction m of a template at a distance, a gain a and an offset b
that the taxels share (drift of the baseline), and noise n. Offset, error of the gain and position within a bin of
distance are normally distributed and integrated in closed form (matrix inversion lemma, Woodbury 1950). The variance of
n contains the white noise and the error of the templates, which grows with the signal.

The normalising factors of the densities are left out. They favour the hypothesis with the smaller signal. Because the
errors of templates and gains persist over many frames, this preference would accumulate, and the estimated distances
would grow with the number of frames.
"""

from collections.abc import Sequence

import numpy as np

from taxel.proximity.calibration import KindCalibration, TargetResponse
from taxel.proximity.motion_grid import CENTRES_M, WIDTHS_M
from taxel.proximity.templates import Window
from taxel.types import FloatArray

SHAPE_ERROR = 0.04
"""Relative standard deviation between the signal of the nearest taxel and that of the nearest template (chosen: the
tolerance of the gap within the taxel)."""

SHAPE_ERROR_PER_M = 12.0
"""Increase of the shape error (`SHAPE_ERROR`) with the distance from the centre of the window, per metre. Between two
templates the tilt is uncertain by 2 degrees and the radius by a tenth. At 9 mm from the centre, the gap is therefore
uncertain by 0.3 mm, and a signal that decays over 3 mm by 10 %."""

SMALL_SIGNAL = 0.3
"""Signal, relative to the largest signal of the window, below which the assumed error of a template does not decrease
further. Signals are small beside the edge of a target, where a small displacement of the edge changes them strongly."""

GAIN_ERROR = 0.06
"""Relative standard deviation of the gain that all taxels share: temperature, tolerances of parts, area of the
target."""

LARGEST_GAIN = 2.0
"""Largest ratio between measured and predicted signals that is explained by a gain. Without this limit, a target beyond
its range, which predicts no signal, would explain drift better than the absence of a target does."""

PERSISTENT_FRAMES = 2.0
"""Number of frames over which errors of shape and gain persist. The filter treats frames as independent, so the
variances of these errors are multiplied by this factor. Chosen on emulated skins with the seed 9001, which the check in
docs/proximity.md does not use: with 4, nearly all intervals contained the distance; 1.5 gave the true distances the
largest likelihood. A smaller value narrows the intervals."""

CONTACT_COUNTS = 300.0
"""Standard deviation of the signals in contact, counts: contact lowers the counts of pressed taxels by hundreds."""


class WindowLikelihood:
    """Computes the likelihoods of frames of one window of n taxels, for K hypotheses on the target and G distances.

    A hypothesis is a pair of a calibrated target and a template (shape): K = targets x templates, with all templates of
    the first target first. Internally, the predictions are arrays of the shape [K * G, n].
    """

    def __init__(self, window: Window, calibration: KindCalibration, targets: Sequence[TargetResponse]) -> None:
        """Predict the signals of all hypotheses. targets: responses of the calibrated targets, in a fixed order."""
        self.taxels = window.taxels
        self.noise = calibration.noise_counts
        mean = np.concatenate([window.predict(target.curve.make_table(), CENTRES_M) for target in targets])
        # A uniform distance within a bin has the standard deviation width / sqrt(12).
        slope = np.gradient(mean, CENTRES_M, axis=1) * (WIDTHS_M / np.sqrt(12.0))[:, None]
        self.shape = mean.shape[:2]
        self._mean, self._slope = (
            np.ascontiguousarray(array.reshape(-1, mean.shape[2]), dtype=np.float32) for array in (mean, slope)
        )
        spread = max(target.gain_spread for target in targets)
        error = max(target.curve_error for target in targets)
        shape_error = np.hypot(SHAPE_ERROR, SHAPE_ERROR_PER_M * window.radius_m)
        self._relative_variance = PERSISTENT_FRAMES * (shape_error**2 + spread**2)
        self._gain_error = float(np.sqrt(PERSISTENT_FRAMES * (GAIN_ERROR**2 + error**2)))

    def _compute_weight(self, signal: FloatArray) -> FloatArray:
        """Compute the inverse variance of each taxel, f64[n], from the measured signals."""
        size = np.abs(signal)
        scale = np.maximum(size, SMALL_SIGNAL * size.max())
        return np.asarray(1.0 / (self.noise**2 + self._relative_variance * scale**2))

    def evaluate(self, signal: FloatArray, offset_counts: float) -> tuple[FloatArray, float, float]:
        """Compute the log-likelihoods of the signals f64[n] of the window, counts.

        offset_counts: standard deviation of the offset that all taxels share. Returns the log-likelihoods of the K
        hypotheses at each of G distances, f64[K, G], that of no target, and that of a contact. A log-likelihood is -1/2
        times the weighted squared residuals, less the part that offset, gain error and place in the bin explain.
        """
        weight = self._compute_weight(signal)
        m1, s1, my, sy, mm, ms, ss = self._compute_sums(weight, signal)
        one, total, square = (float(weight @ power) for power in (np.ones(len(signal)), signal, signal**2))
        gain = self._gain_error * np.clip(LARGEST_GAIN * my / max(square, 1e-12), 0.0, 1.0)
        directions = _Directions(offset_counts, gain, (one, total, square), s1, sy, ss)
        explained = directions.compute_explained(total - m1, square - my, sy - ms)
        result = -0.5 * (square - 2.0 * my + mm - explained)
        _equalise_widths(result)
        absent = -0.5 * (square - (offset_counts * total) ** 2 / (1.0 + offset_counts**2 * one))
        return result, float(absent), self._evaluate_contact(signal, weight)

    def _compute_sums(self, weight: FloatArray, signal: FloatArray) -> list[FloatArray]:
        """Compute the weighted sums over the taxels of m, s, m y, s y, m^2, m s and s^2 in this order, f64[K, G] each.

        m: predicted signal. s: standard deviation of the prediction for a uniform distance within the bin. y: signal.
        """
        weighted = np.stack([weight, weight * signal], axis=1).astype(np.float32)
        means, slopes = self._mean @ weighted, self._slope @ weighted
        scaled = self._mean * weighted[:, 0]
        squares = np.einsum("in,in->i", scaled, self._mean), np.einsum("in,in->i", scaled, self._slope)
        slope_square = np.einsum("in,in->i", self._slope * weighted[:, 0], self._slope)
        sums = means[:, 0], slopes[:, 0], means[:, 1], slopes[:, 1], *squares, slope_square
        return [array.reshape(self.shape).astype(np.float64) for array in sums]

    def _evaluate_contact(self, signal: FloatArray, weight: FloatArray) -> float:
        """Compute the log-likelihood of a contact with any pressure, with the normalisation of the other hypotheses."""
        variance = CONTACT_COUNTS**2
        return float(-0.5 * ((signal @ signal) / variance + np.log(variance * weight).sum()))


def _equalise_widths(values: FloatArray) -> None:
    """Scale the likelihood of each hypothesis over the distance to the same width as that of the best hypothesis.

    values: f64[K, G], log-likelihoods of K hypotheses at G distances, changed in place. The hypotheses then differ by
    their best fits only.

    Without this scaling, a hypothesis with a farther target would have a wider likelihood, and therefore a larger total
    probability. In a single measurement this difference is evidence. In a sequence of frames, however, the errors of
    template and gain are the same in every frame, and the same difference would be counted again in every frame.
    """
    largest = values.max(axis=1, keepdims=True)
    width = (np.exp(values - largest) * WIDTHS_M).sum(axis=1, keepdims=True)
    best = np.unravel_index(np.argmax(largest), largest.shape)
    values -= np.log(width / width[best])


class _Directions:
    """Part of the misfit that the three integrated unknowns explain: offset, gain, and position within the distance
    bin.

    A gain error changes the signals by a multiple of the measured signal y, which is the same for all templates; with
    the predicted signal instead, templates with a larger signal would be favoured. offset: standard deviation of the
    offset, counts. gain: f64[K, G], relative standard deviation of the gain. sums: sums over the taxels of weight times
    1, y and y^2. s1, sy, ss: f64[K, G], sums of weight times s, s y and s^2, where s is the change within the bin.
    """

    def __init__(
        self,
        offset: float,
        gain: FloatArray,
        sums: tuple[float, float, float],
        s1: FloatArray,
        sy: FloatArray,
        ss: FloatArray,
    ) -> None:
        """Compute the Cholesky factors of 1 + U^T W U for all templates and distances.

        U: changes of the signals by one standard deviation of offset, gain, and position within the bin (3 columns). W:
        weights of the taxels. offset, gain: standard deviations of the offset, counts, and of the relative gain. sums:
        sums over the taxels of weight times 1, y and y^2. s1, sy, ss: sums of weight times s, s y and s^2. y: measured
        signal. s: change of the predicted signal within the bin.
        """
        one, total, square = sums
        self._offset, self._gain = offset, gain
        self._l00 = np.sqrt(1.0 + offset**2 * one)
        self._l10 = offset * gain * total / self._l00
        self._l11 = np.sqrt(1.0 + gain**2 * square - self._l10**2)
        self._l20 = offset * s1 / self._l00
        self._l21 = (gain * sy - self._l20 * self._l10) / self._l11
        self._l22 = np.sqrt(1.0 + ss - self._l20**2 - self._l21**2)

    def compute_explained(self, total: FloatArray, product: FloatArray, slopes: FloatArray) -> FloatArray:
        """Compute the part of the weighted squared residuals that the unknown offset, gain and position in the bin
        explain, f64[K, G].

        total, product, slopes: f64[K, G], sums over the taxels of weight times residual times 1, y and s.
        """
        x0 = self._offset * total / self._l00
        x1 = (self._gain * product - self._l10 * x0) / self._l11
        x2 = (slopes - self._l20 * x0 - self._l21 * x1) / self._l22
        return np.asarray(x0**2 + x1**2 + x2**2)
