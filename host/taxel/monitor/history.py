"""Signals of all taxels over the last half minute, for time series."""

import numpy as np

from taxel.monitor.reading import SkinReading
from taxel.types import Float32Array, FloatArray, IndexArray


class History:
    """Ring buffer of the signals of all n taxels in the last `length` readings.

    A reading whose time is before that of the last reading empties the buffer.
    """

    def __init__(self, n_taxels: int, length: int = 300) -> None:
        """Create an empty ring buffer for the signals of `n_taxels` taxels in the last `length` readings."""
        self._times = np.full(length, np.nan)
        self._signals = np.full((length, n_taxels), np.nan, dtype=np.float32)
        self._next = 0
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def add(self, reading: SkinReading) -> None:
        """Store the signals of a reading, unless it has no newer frame than the last stored reading."""
        newest = self._times[self._next - 1]
        if not np.isfinite(reading.time_s) or newest == reading.time_s:
            return
        if reading.time_s < newest:
            self._count = 0  # the clock of the stream has restarted
        self._times[self._next] = reading.time_s
        self._signals[self._next] = reading.signal_counts
        self._next = (self._next + 1) % len(self._times)
        self._count = min(self._count + 1, len(self._times))

    def _rows(self) -> IndexArray:
        """Return the indices of the stored readings in the ring buffer, the oldest first."""
        return (self._next - self._count + np.arange(self._count)) % len(self._times)

    @property
    def times_s(self) -> FloatArray:
        """Times of the t stored readings relative to the newest, f64[t], seconds, at most 0; the newest is the last."""
        times = self._times[self._rows()]
        return times - times[-1] if times.size else times

    def taxels(self, index: IndexArray) -> Float32Array:
        """Return the stored signals of k taxels, f32[t, k], counts, oldest reading first; NaN if unknown."""
        return np.asarray(self._signals[np.ix_(self._rows(), index)])

    def find_most_active(self, count: int) -> IndexArray:
        """Return the indices of the `count` taxels with the largest signals in all stored readings, largest first.

        Taxels without a signal are last.
        """
        signals = self._signals[self._rows()]
        largest = np.nan_to_num(signals, nan=-np.inf).max(axis=0, initial=-np.inf)
        return np.argsort(-largest, kind="stable")[:count]
