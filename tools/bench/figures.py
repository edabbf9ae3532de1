"""Result type of a benchmark, and its time measurements."""

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Figure:
    """Result of a benchmark: a ratio to a reference, and its required minimum.

    target None: no requirement. ratio None: the benchmark could not run; `detail` states the reason, and a requirement
    is missed.
    """

    name: str
    ratio: float | None
    target: float | None
    reference: str
    detail: str

    @property
    def is_met(self) -> bool:
        """Whether the requirement is met."""
        return self.target is None or (self.ratio is not None and self.ratio >= self.target)

    @property
    def ratio_text(self) -> str:
        """The ratio with two decimals below 10 and without decimals above; "-" for None."""
        if self.ratio is None:
            return "-"
        return f"{self.ratio:.2f}" if self.ratio < 10 else f"{self.ratio:,.0f}"

    @property
    def target_text(self) -> str:
        """The required minimum; empty for None."""
        return "" if self.target is None else f"{self.target:.3g}"


def measure_median_seconds(action: Callable[[], object], repeats: int = 5) -> float:
    """Measure the median wall-clock time of `action` in seconds."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        action()
        times.append(time.perf_counter() - start)
    return statistics.median(times)


def measure_core_seconds(action: Callable[[], object]) -> float:
    """Measure the processor time of `action` in this thread, which depends little on other load of the machine."""
    start = time.thread_time()
    action()
    return time.thread_time() - start


@dataclass(frozen=True)
class Comparison:
    """Medians over repeats: reference time divided by measured time, and both processor times in seconds."""

    ratio: float
    measured_s: float
    reference_s: float


def compare(measured: Callable[[], object], reference: Callable[[], object], repeats: int = 15) -> Comparison:
    """Compare the speed of `measured` with the speed of `reference`: a ratio above 1 if `measured` is faster.

    Both functions run once without a measurement, and then in turn in every repeat, so that other load slows both.
    """
    measured()
    reference()
    times = [(measure_core_seconds(reference), measure_core_seconds(measured)) for _ in range(repeats)]
    return Comparison(
        statistics.median(reference_time / measured_time for reference_time, measured_time in times),
        statistics.median(measured_time for _, measured_time in times),
        statistics.median(reference_time for reference_time, _ in times),
    )
