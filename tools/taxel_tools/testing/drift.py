"""Whether a value has moved, judged by the earlier values of the same device.

- With `MANY_RUNS` earlier values or more: the device's own spread is known. A value has moved if it is more than
  `MOVED_DEVIATIONS` robust standard deviations from the median; a robust standard deviation is 1.4826 times the median
  absolute deviation (Rousseeuw and Croux 1993). It is taken as at least `LEAST_SPREAD` of the median, because earlier
  values that are all alike (a count, or a rounded figure) would else make any other value unusual.
- With fewer: the limit is the only scale. A value has moved if it went from the median by more than `MOVED_SHARE` of
  the way from the median to the bound that it moved towards, or, where there is none on that side, to the other one.
  Close to a bound that way is short, so at least `LEAST_WIDTH` of the limit's own width counts (of its size, if it has
  one bound). Without a limit nothing is said.
- What is no finite number now, and was one before, has moved.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import median
from typing import Final

from taxel_tools.testing.record import Limit, Measurement

MANY_RUNS: Final = 5
MOVED_DEVIATIONS: Final = 5.0
ROBUST_SD_PER_MAD: Final = 1.4826
LEAST_SPREAD: Final = 0.01
MOVED_SHARE: Final = 0.25
LEAST_WIDTH: Final = 0.1


@dataclass(frozen=True, slots=True)
class Change:
    """A number now and before.

    value: None where nothing was measured now. last, median: of `runs` earlier finite values, 1 or more. shift: how far
    it went from the median, in units of what is still usual; 0 where nothing says what is. moved: shift above 1.
    """

    phase: str
    measurement: str
    place: str
    unit: str
    value: float | None
    last: float
    median: float
    runs: int
    shift: float
    moved: bool


def change_of(phase: str, measurement: Measurement, earlier: list[float]) -> Change:
    """Compare a measurement with the earlier finite values of the same thing, oldest first, at least one."""
    if isinstance(measurement.value, str):
        raise TypeError("text has no drift")
    middle = median(earlier)
    shift = _shift(measurement.value, middle, earlier, measurement.limit)
    return Change(
        phase=phase,
        measurement=measurement.name,
        place=measurement.place,
        unit=measurement.unit,
        value=measurement.value,
        last=earlier[-1],
        median=middle,
        runs=len(earlier),
        shift=shift,
        moved=shift > 1.0,
    )


def _shift(value: float | None, middle: float, earlier: list[float], limit: Limit | None) -> float:
    if value is None or not math.isfinite(value):
        return math.inf
    usual: float | None
    if len(earlier) >= MANY_RUNS:
        deviation = ROBUST_SD_PER_MAD * median(abs(one - middle) for one in earlier)
        usual = MOVED_DEVIATIONS * max(deviation, LEAST_SPREAD * abs(middle))
    else:
        width = None if limit is None else _width(value > middle, middle, limit)
        usual = None if width is None else MOVED_SHARE * width
    if usual is None or value == middle:
        return 0.0
    return abs(value - middle) / usual if usual > 0 else math.inf


def _width(upwards: bool, middle: float, limit: Limit) -> float | None:
    low, high = limit.minimum, limit.maximum
    if low is not None and high is not None:
        return max(abs((high if upwards else low) - middle), LEAST_WIDTH * (high - low))
    bound = high if low is None else low
    return None if bound is None else max(abs(bound - middle), LEAST_WIDTH * abs(bound))
