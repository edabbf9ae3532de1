"""Baseline that follows drift while no target is near, and is extrapolated while a target is near."""

import numpy as np

from taxel.types import FloatArray

LEVEL_TIME_S = 2.0
"""Shortest time constant with which the baseline follows the counts without a target. With a shorter time, the baseline
absorbs slow approaches; with a longer time, it lags behind a change of the temperature."""

SLOPE_TIME_S = 100.0
"""Time constant of the rate of drift: the temperatures of boards and air change over minutes (chosen)."""

SLOPE_COUNTS_PER_S = 0.5
"""Standard deviation of the rate of drift (chosen: a warm-up of 100 counts over minutes). With a larger value, a faster
drift is permitted while a target is near, and the intervals of targets that stay for long are wider."""


class DriftTracker:
    """Baseline f64[n] of the raw counts of one board, with a level and a rate of drift that the taxels share.

    The common level performs a random walk, and its rate an Ornstein-Uhlenbeck process; a Kalman filter estimates both
    from the mean of the taxels, with a gain that `LEVEL_TIME_S` limits (local linear trend: Harvey, Forecasting,
    Structural Time Series Models and the Kalman Filter, 1989, chapter 2).

    baseline: None until enough frames have been averaged.
    """

    def __init__(self, n_taxels: int, drift_counts: float, noise_counts: float, frames: int) -> None:
        """Create a tracker whose first `frames` frames are averaged to the first baseline.

        drift_counts: random walk of the mean over the taxels, counts per square root of a second. noise_counts:
        standard deviation of the white noise of a taxel in one frame.
        """
        self._needed = frames
        self._sum = np.zeros(n_taxels)
        self._count = 0
        self._slope = 0.0
        self._drift = drift_counts
        self._mean_variance = noise_counts**2 / n_taxels
        self._covariance = np.diag([self._mean_variance / frames, SLOPE_COUNTS_PER_S**2])
        self.baseline: FloatArray | None = None

    @property
    def progress(self) -> float:
        """Completed share of the first baseline, 0 to 1."""
        return 1.0 if self.baseline is not None else self._count / self._needed

    def start(self, raw_counts: FloatArray) -> None:
        """Add a frame to the average with which the baseline starts."""
        self._sum += raw_counts
        self._count += 1
        if self._count >= self._needed:
            self.baseline = self._sum / self._count

    def advance(self, dt_s: float) -> FloatArray:
        """Extrapolate the baseline by `dt_s` seconds and return it, f64[n], counts.

        The rate of drift decays with the time constant `SLOPE_TIME_S`. `travel`, seconds, is the drift in the
        interval divided by the rate at the start of the interval.
        """
        assert self.baseline is not None  # the estimator calls start() first
        decay = float(np.exp(-dt_s / SLOPE_TIME_S))
        travel = SLOPE_TIME_S * (1.0 - decay)
        self.baseline = self.baseline + self._slope * travel
        self._slope *= decay
        step = np.array([[1.0, travel], [0.0, decay]])
        change = np.diag([self._drift**2 * dt_s, SLOPE_COUNTS_PER_S**2 * (1.0 - decay**2)])
        self._covariance = step @ self._covariance @ step.T + change
        return self.baseline

    def follow(self, raw_counts: FloatArray, dt_s: float) -> None:
        """Correct the baseline and the rate of drift with a frame f64[n] without a target.

        The mean error over the taxels is corrected by the Kalman gain, but not faster than with the time constant
        `LEVEL_TIME_S`. The deviation of each taxel from the mean error is corrected with this time constant. dt_s: time
        since the previous frame, seconds.
        """
        assert self.baseline is not None
        error = raw_counts - self.baseline
        mean = float(error.mean())
        level_gain = float(-np.expm1(-dt_s / LEVEL_TIME_S))
        gain = self._covariance[:, 0] / (self._covariance[0, 0] + self._mean_variance)
        gain *= min(1.0, level_gain / float(gain[0]))
        self.baseline = self.baseline + gain[0] * mean + level_gain * (error - mean)
        self._slope += float(gain[1]) * mean
        kept = np.eye(2) - np.outer(gain, [1.0, 0.0])
        self._covariance = kept @ self._covariance @ kept.T + self._mean_variance * np.outer(gain, gain)

    @property
    def offset_counts(self) -> float:
        """Standard deviation of the offset between baseline and counts that all taxels share, counts."""
        return float(np.sqrt(self._covariance[0, 0]))
