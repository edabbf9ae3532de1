"""Rates of several counters over the last seconds."""

from collections import deque

import numpy as np
from numpy.typing import ArrayLike

from taxel.types import FloatArray


class RecentRate:
    """Measurement of the rates at which several counters rise, per second, over about the last `window_s` seconds."""

    def __init__(self, window_s: float = 2.0) -> None:
        """Create a measurement of the rates of counters over about the last `window_s` seconds."""
        self._window_s = window_s
        self._samples: deque[tuple[FloatArray, FloatArray]] = deque()

    def update(self, times_s: ArrayLike, counts: ArrayLike) -> FloatArray:
        """Add the values of k counters, and return their recent rates f64[k], counts per second.

        times_s: f64[k], time of each value, NaN before the first count. counts: [k], values of the counters. A counter
        without an elapsed time has the rate 0. If a time is smaller than in the previous call, the clock has restarted,
        and all earlier values are discarded.
        """
        times, values = np.array(times_s, dtype=np.float64), np.array(counts, dtype=np.float64)
        if self._samples and np.any(times < self._samples[-1][0]):
            self._samples.clear()  # the clock has restarted
        self._samples.append((times, values))
        # The oldest values are removed as long as the remaining values cover the whole window.
        newest = np.max(np.nan_to_num(times, nan=-np.inf))
        while len(self._samples) > 2 and np.nanmax(self._samples[1][0], initial=-np.inf) <= newest - self._window_s:
            self._samples.popleft()
        all_times, all_counts = (np.stack(rows) for rows in zip(*self._samples, strict=True))
        column = np.arange(len(times))
        first = np.isfinite(all_times).argmax(axis=0)  # a counter that started later is measured from its start
        elapsed = times - all_times[first, column]
        has_elapsed = elapsed > 0.0  # False for NaN
        return np.where(has_elapsed, (values - all_counts[first, column]) / np.where(has_elapsed, elapsed, 1.0), 0.0)
