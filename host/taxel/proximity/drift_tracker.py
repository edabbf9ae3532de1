"""Baseline that follows drift while no target is near, and is extrapolated while a target is."""

import numpy as np

from taxel.types import FloatArray

LEVEL_TIME_S = 2.0
"""Shortest time constant with which the baseline follows the counts without a target. A shorter time absorbs slow
approaches, a longer one lags behind a change of the temperature."""

SLOPE_TIME_S = 100.0
"""Time constant of the rate of drift: boards warm up, and the air changes its temperature, over minutes (chosen)."""

SLOPE_COUNTS_PER_S = 0.5
"""Standard deviation of the rate of drift (chosen: a warm-up of 100 counts over minutes). A larger value widens the
intervals of targets that stay for long, and permits a faster drift during this time."""


class DriftTracker:
    """Baseline f64[n] of the raw counts of one board, with a level and a rate of drift that the taxels share.

    The common level performs a random walk, and its rate an Ornstein-Uhlenbeck process; a Kalman filter estimates both
    from the mean of the taxels, with a gain that `LEVEL_TIME_S` limits (local linear trend: Harvey, Forecasting,
    Structural Time Series Models and the Kalman Filter, 1989, chapter 2).

    drift_counts: random walk of the mean, counts per root second. noise_counts: white noise of a taxel in one frame.
    """

    def __init__(self, n_taxels: int, drift_counts: float, noise_counts: float, frames: int) -> None:
        """Create a tracker whose first `frames` frames are averaged."""
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
        """Share of the first frames, 0 to 1."""
        return 1.0 if self.baseline is not None else self._count / self._needed

    def start(self, raw_counts: FloatArray) -> None:
        """Add a frame to the average with which the baseline starts."""
        self._sum += raw_counts
        self._count += 1
        if self._count >= self._needed:
            self.baseline = self._sum / self._count

    def advance(self, dt_s: float) -> FloatArray:
        """Extrapolate the baseline by an interval and return it, f64[n]."""
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
        """Correct baseline and rate by a frame without a target."""
        assert self.baseline is not None
        error = raw_counts - self.baseline
        mean = float(error.mean())
        own = float(-np.expm1(-dt_s / LEVEL_TIME_S))
        gain = self._covariance[:, 0] / (self._covariance[0, 0] + self._mean_variance)
        gain *= min(1.0, own / float(gain[0]))
        self.baseline = self.baseline + gain[0] * mean + own * (error - mean)
        self._slope += float(gain[1]) * mean
        kept = np.eye(2) - np.outer(gain, [1.0, 0.0])
        self._covariance = kept @ self._covariance @ kept.T + self._mean_variance * np.outer(gain, gain)

    @property
    def offset_counts(self) -> float:
        """Standard deviation of the common offset between baseline and counts, counts."""
        return float(np.sqrt(self._covariance[0, 0]))
