"""A fixed-period control loop with absolute deadlines, and an account of how late it was."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

PERIOD_S: Final = 0.003  # usual control period of the Allegro hand
# Sleep ends up to about this much late on an ordinary Linux kernel, so the last part is spent watching the clock.
SPIN_S: Final = 0.0002
KEPT: Final = 100_000  # lateness values kept for percentiles: five minutes at 3 ms


@dataclass(frozen=True)
class LoopStatistics:
    """How a loop kept its deadlines. Lateness is the start of a tick after its deadline, seconds; NaN before the first.

    periods: ticks begun. missed: periods without a tick, because the tick before them came later than their deadline.
    p50_s, p99_s: of the last 100,000 ticks. max_s: of all.
    """

    periods: int
    missed: int
    p50_s: float
    p99_s: float
    max_s: float


class ControlLoop:
    """Waits for deadlines at whole multiples of `period_s` after the first; lateness of one tick never moves the next.

    clock, sleep: seconds; in virtual time a virtual clock and what steps it. spin_s: the end of each wait that is spent
    watching the clock instead of sleeping; default 0.2 ms with `time.sleep`, 0 with any other.

    A period is missed when its tick would start at or after the next deadline: the loop then goes on with the latest
    deadline that has passed, and does not run the missed ticks in a burst.

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
        if not 0 < period_s < math.inf:
            raise ValueError(f"period_s: expected more than 0, found {period_s}")
        self.period_s = period_s
        self.clock = clock
        self._sleep = sleep
        # Watching a clock that only `sleep` moves would never end.
        self._spin_s = (SPIN_S if sleep is time.sleep else 0.0) if spin_s is None else spin_s
        self._start_s: float | None = None
        self._next = 0
        self._late: npt.NDArray[np.float64] = np.zeros(KEPT)
        self._periods = 0
        self._missed = 0
        self._max_s = math.nan

    def wait(self) -> int:
        """Wait for the next deadline; the first call sets the schedule and returns at once.

        Returns the number of the period, from 0; it jumps over periods that were missed.
        """
        if self._start_s is None:
            self._start_s = self.clock()
        deadline_s = self._start_s + self._next * self.period_s
        while (left_s := deadline_s - self.clock()) > 0:
            if left_s > self._spin_s:
                self._sleep(left_s - self._spin_s)
        late_s = -left_s
        skipped = int(late_s // self.period_s)
        self._record(late_s, skipped)
        period = self._next + skipped
        self._next = period + 1
        return period

    def _record(self, late_s: float, skipped: int) -> None:
        self._late[self._periods % KEPT] = late_s
        self._periods += 1
        self._missed += skipped
        self._max_s = late_s if math.isnan(self._max_s) else max(self._max_s, late_s)

    def run(self, tick: Callable[[int], object], periods: int) -> LoopStatistics:
        """Call `tick` with the number of the period until `periods` of them have passed, the missed ones included."""
        while self._next < periods:
            tick(self.wait())
        return self.statistics()

    def statistics(self) -> LoopStatistics:
        """How the deadlines were kept so far."""
        late = self._late[: self._periods] if self._periods else np.array([math.nan])
        p50, p99 = np.percentile(late, (50, 99)).tolist()
        return LoopStatistics(self._periods, self._missed, p50, p99, self._max_s)
