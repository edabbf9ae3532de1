"""How fast things count up, lately."""

from collections import deque

import numpy as np
from numpy.typing import ArrayLike, NDArray


class RecentRate:
    """Counts a second over about the last `window_s` seconds, of several counters [k] at once."""

    def __init__(self, window_s: float = 2.0) -> None:
        self._window_s = window_s
        self._marks: deque[tuple[NDArray[np.float64], NDArray[np.float64]]] = deque()

    def update(self, times_s: ArrayLike, counts: ArrayLike) -> NDArray[np.float64]:
        """Rates [k] from `counts` [k], each reached at its own of `times_s` [k]; 0 where no time has gone by.

        A time that is NaN has not come yet.
        """
        times, mark = np.array(times_s, dtype=np.float64), np.array(counts, dtype=np.float64)
        if self._marks and np.any(times < self._marks[-1][0]):
            self._marks.clear()  # the clock has begun anew
        self._marks.append((times, mark))
        newest = np.max(np.nan_to_num(times, nan=-np.inf))
        while len(self._marks) > 2 and np.nanmax(self._marks[1][0], initial=-np.inf) <= newest - self._window_s:
            self._marks.popleft()
        all_times, all_counts = (np.stack(rows) for rows in zip(*self._marks, strict=True))
        column = np.arange(len(times))
        first = np.isfinite(all_times).argmax(axis=0)  # a counter that began later is measured from its beginning
        elapsed = times - all_times[first, column]
        has_gone_by = elapsed > 0.0  # False where NaN
        return np.where(has_gone_by, (mark - all_counts[first, column]) / np.where(has_gone_by, elapsed, 1.0), 0.0)
