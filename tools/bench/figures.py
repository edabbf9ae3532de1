"""What a benchmark returns, and how it takes its time."""

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Figure:
    """A ratio against a reference, and the least that is asked of it."""

    name: str
    ratio: float
    target: float
    reference: str
    detail: str


def seconds(action: Callable[[], object], repeats: int = 5) -> float:
    """Median wall time of `action`."""
    times = []
    for _ in range(repeats):
        begun = time.perf_counter()
        action()
        times.append(time.perf_counter() - begun)
    return statistics.median(times)
