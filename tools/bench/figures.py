"""What a benchmark returns, and how it takes its time."""

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Figure:
    """A ratio against a reference, and the least that is asked of it; a target of None: nothing is asked, it is shown.

    `ratio` of None: it could not be measured here; `detail` says why, and the figure is missed.
    """

    name: str
    ratio: float | None
    target: float | None
    reference: str
    detail: str

    @property
    def is_met(self) -> bool:
        """Whether what is asked was reached."""
        return self.target is None or (self.ratio is not None and self.ratio >= self.target)


def seconds(action: Callable[[], object], repeats: int = 5) -> float:
    """Median wall time of `action`."""
    times = []
    for _ in range(repeats):
        begun = time.perf_counter()
        action()
        times.append(time.perf_counter() - begun)
    return statistics.median(times)


def core_seconds(action: Callable[[], object]) -> float:
    """Processor time that `action` takes in this thread: what others do on the machine meanwhile counts little."""
    begun = time.thread_time()
    action()
    return time.thread_time() - begun


@dataclass(frozen=True)
class Compared:
    """Medians over rounds: of the reference's time over ours, and of either's processor time in seconds."""

    ratio: float
    ours_s: float
    reference_s: float


def compared(ours: Callable[[], object], reference: Callable[[], object], rounds: int = 15) -> Compared:
    """How many times faster `ours` is than `reference`: both in every round, so that a busy minute slows both."""
    ours()
    reference()
    times = [(core_seconds(reference), core_seconds(ours)) for _ in range(rounds)]
    return Compared(
        statistics.median(theirs / own for theirs, own in times),
        statistics.median(own for _, own in times),
        statistics.median(theirs for theirs, _ in times),
    )
