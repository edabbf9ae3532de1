"""The transforms of one edge of the frame tree over time: a bounded history that is read between its stamps."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from taxel.hand.transforms import interpolate
from taxel.types import FloatArray

_FIRST_CAPACITY = 16  # transforms


class TransformHistory:
    """Stamped transforms in order of time; those older than `span_s` before the newest are dropped.

    The live part is [_begin, _end) of arrays that double when full, so an appended stamp costs constant time.
    """

    def __init__(self, span_s: float) -> None:
        self.span_s = span_s
        self._stamps: FloatArray = np.empty(_FIRST_CAPACITY)
        self._transforms: FloatArray = np.empty((_FIRST_CAPACITY, 4, 4))
        self._begin = self._end = 0

    def __len__(self) -> int:
        return self._end - self._begin

    @property
    def first_s(self) -> float:
        """The oldest stamp, seconds."""
        return float(self._stamps[self._begin])

    @property
    def last_s(self) -> float:
        """The newest stamp, seconds."""
        return float(self._stamps[self._end - 1])

    def add(self, stamp_s: float, transform: FloatArray) -> bool:
        """Keep f64[4, 4] at its place in time, in the stead of one of the same stamp; False if it is too old."""
        if len(self) and stamp_s < self.last_s - self.span_s:
            return False
        index = self._begin + int(np.searchsorted(self._stamps[self._begin : self._end], stamp_s))
        if index == self._end or self._stamps[index] != stamp_s:
            index = self._open(index)
        self._stamps[index] = stamp_s
        self._transforms[index] = transform
        self._begin += int(np.searchsorted(self._stamps[self._begin : self._end], self.last_s - self.span_s))
        return True

    def at(self, times_s: npt.ArrayLike) -> FloatArray:
        """Transforms f64[..., 4, 4] at times f64[...] from `first_s` to `last_s`; exact at a stamp."""
        times = np.asarray(times_s, dtype=np.float64)
        stamps = self._stamps[self._begin : self._end]
        transforms = self._transforms[self._begin : self._end]
        before = np.searchsorted(stamps, times, side="right") - 1
        after = np.minimum(before + 1, stamps.size - 1)
        gap = stamps[after] - stamps[before]
        fraction = (times - stamps[before]) / np.where(gap > 0, gap, 1)
        if not fraction.any():  # at stamps only: the common case of "latest"
            return transforms[before].copy()
        return interpolate(transforms[before], transforms[after], fraction)

    def _open(self, index: int) -> int:
        """Make room for one more at `index`; returns where it is after the arrays may have moved."""
        if self._end == self._stamps.size:
            count, index = len(self), index - self._begin
            capacity = max(_FIRST_CAPACITY, 2 * count)
            stamps, transforms = np.empty(capacity), np.empty((capacity, 4, 4))
            stamps[:count] = self._stamps[self._begin : self._end]
            transforms[:count] = self._transforms[self._begin : self._end]
            self._stamps, self._transforms, self._begin, self._end = stamps, transforms, 0, count
        self._stamps[index + 1 : self._end + 1] = self._stamps[index : self._end]
        self._transforms[index + 1 : self._end + 1] = self._transforms[index : self._end]
        self._end += 1
        return index
