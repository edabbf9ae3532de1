"""Control loop with a fixed period, absolute deadlines and lateness statistics."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

PERIOD_S: Final = 0.003  # usual control period of the Allegro hand
SPIN_S: Final = 0.0002
"""Last part of each wait in which the clock is polled, because sleep() returns up to about this much late on Linux."""

LATENESS_HISTORY: Final = 100_000
"""Number of lateness values for the percentiles: five minutes at 3 ms."""


@dataclass(frozen=True)
class LoopStatistics:
    """Lateness statistics of a loop: time from the deadline to the start of a tick, seconds; NaN before the first tick.

    periods: number of started ticks. missed: periods without a tick, because the previous tick ended after their
    deadline. p50_s, p99_s: percentiles of the last 100,000 ticks. max_s: maximum of all ticks.
    """

    periods: int
    missed: int
    p50_s: float
    p99_s: float
    max_s: float


class ControlLoop:
    """Deadlines at multiples of `period_s` after the first wait; a late tick does not shift later deadlines.

    clock, sleep: in seconds; in virtual time a virtual clock and the function that advances it. spin_s: last part of
    each wait in which the clock is polled instead of sleeping; default 0.2 ms with `time.sleep`, else 0.

    A period is missed if its tick would start at or after the next deadline. The loop then continues with the latest
    deadline in the past and does not catch up on missed ticks.

    >>> times = [0.0]
    >>> loop = ControlLoop(0.003, lambda: times[0], lambda s: times.__setitem__(0, times[0] + s))
    >>> for _ in range(3):
    ...     loop.wait()
    0
    1
    2
    """

    def __init__(
        self,
        period_s: float = PERIOD_S,
        clock: Callable[[], float] = time.perf_counter,
        sleep: Callable[[float], object] = time.sleep,
        *,
        spin_s: float | None = None,
    ) -> None:
        """Create the timer of a control loop; the first call of `wait` starts the first period.

        period_s: time between two ticks. clock: returns seconds. sleep: waits the given number of seconds; in virtual
        time, the function that advances the virtual clock. spin_s: last part of each wait, in which the clock is
        polled; None: 0.2 ms with `time.sleep`, else 0. Raises ValueError for a period that is not positive.
        """
        if not 0 < period_s < math.inf:
            raise ValueError(f"period_s: expected a finite number above 0, found {period_s}")
        self.period_s = period_s
        self.clock = clock
        self._sleep = sleep
        # Polling a clock that only `sleep` advances would never end.
        self._spin_s = (SPIN_S if sleep is time.sleep else 0.0) if spin_s is None else spin_s
        self._start_s: float | None = None
        self._next = 0
        self._lateness: npt.NDArray[np.float64] = np.zeros(LATENESS_HISTORY)
        self._periods = 0
        self._missed = 0
        self._max_s = math.nan

    def wait(self) -> int:
        """Wait for the next deadline and return the index of its period, from 0; missed periods are skipped.

        The first call sets the schedule and returns at once.
        """
        if self._start_s is None:
            self._start_s = self.clock()
        deadline_s = self._start_s + self._next * self.period_s
        while (remaining_s := deadline_s - self.clock()) > 0:
            if remaining_s > self._spin_s:
                self._sleep(remaining_s - self._spin_s)
        lateness_s = -remaining_s
        missed = int(lateness_s // self.period_s)
        self._record(lateness_s, missed)
        period = self._next + missed
        self._next = period + 1
        return period

    def _record(self, lateness_s: float, missed: int) -> None:
        """Add one tick to the lateness statistics.

        lateness_s: time from the deadline for which the loop waited to the start of the tick, seconds. missed: number
        of periods skipped before this tick.
        """
        self._lateness[self._periods % LATENESS_HISTORY] = lateness_s
        self._periods += 1
        self._missed += missed
        self._max_s = lateness_s if math.isnan(self._max_s) else max(self._max_s, lateness_s)

    def run(self, tick: Callable[[int], object], periods: int) -> LoopStatistics:
        """Call `tick` with the index of each period until `periods` periods, including missed ones, have elapsed.

        Returns the lateness statistics, as `compute_statistics` does.
        """
        while self._next < periods:
            tick(self.wait())
        return self.compute_statistics()

    def compute_statistics(self) -> LoopStatistics:
        """Compute the lateness statistics: percentiles of the last `LATENESS_HISTORY` ticks, the rest of all ticks."""
        lateness = self._lateness[: self._periods] if self._periods else np.array([math.nan])
        p50, p99 = np.percentile(lateness, (50, 99)).tolist()
        return LoopStatistics(self._periods, self._missed, p50, p99, self._max_s)
