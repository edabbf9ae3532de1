"""Baseline that follows drift while no target is near, and is extrapolated while a target is."""

import numpy as np

from taxel.types import FloatArray

LEVEL_TIME_S = 2.0
"""Time constant with which the baseline follows the counts without a target. A shorter time absorbs slow approaches, a
longer one lags behind a change of the temperature."""

SLOPE_MEMORY_S = 5.0
"""Time constant with which the extrapolation of the drift ends while a target is near."""


class DriftTracker:
    """Baseline f64[n] of the raw counts of one board with a trend that the taxels share (alpha-beta filter).

    drift_counts: random walk of the mean, counts per root second.
    """

    def __init__(self, n_taxels: int, drift_counts: float, frames: int) -> None:
        """Create a tracker whose first `frames` frames are averaged."""
        self._needed = frames
        self._sum = np.zeros(n_taxels)
        self._count = 0
        self._slope = 0.0
        self._held_s = 0.0
        self._drift = drift_counts
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
        self.baseline = self.baseline + self._slope * dt_s
        if self._held_s > 0.0:
            self._slope *= float(np.exp(-dt_s / SLOPE_MEMORY_S))
        self._held_s += dt_s
        return self.baseline

    def follow(self, raw_counts: FloatArray, dt_s: float) -> None:
        """Correct baseline and trend by a frame without a target."""
        assert self.baseline is not None
        gain = -np.expm1(-dt_s / LEVEL_TIME_S)
        error = raw_counts - self.baseline
        self.baseline = self.baseline + gain * error
        self._slope += float(gain**2 / (2.0 - gain) * error.mean() / max(dt_s, 1e-3))
        self._held_s = 0.0

    @property
    def offset_counts(self) -> float:
        """Standard deviation of the offset that drift has caused since the baseline was last followed, counts."""
        return float(self._drift * np.sqrt(LEVEL_TIME_S + self._held_s))
