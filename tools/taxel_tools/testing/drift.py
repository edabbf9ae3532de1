"""Comparison of a value with the earlier values of the same device.

- With at least `OWN_SPREAD_RUNS` earlier values, the spread of the device itself is known. A value has moved if it is
  more than `MOVED_DEVIATIONS` robust standard deviations from the median; a robust standard deviation is 1.4826 times
  the median absolute deviation (Rousseeuw and Croux 1993). It is at least `SPREAD_MIN` of the median, because identical
  earlier values (a count, or a rounded figure) would otherwise make any other value significant.
- With fewer values, the limit is the only scale. A value has moved if its distance from the median is more than
  `MOVED_SHARE` of the distance between the median and the bound on this side or, without a bound on this side, the
  other bound. This distance is at least `WIDTH_MIN` of the width of the limit (of its magnitude with one bound),
  because it vanishes near a bound. Without a limit there is no comparison.
- A value that is not finite, after finite earlier values, has moved.
"""

import math
from dataclasses import dataclass
from statistics import median
from typing import Final

from taxel_tools.testing.record import Limit, Measurement

OWN_SPREAD_RUNS: Final = 5
MOVED_DEVIATIONS: Final = 5.0
ROBUST_SD_PER_MAD: Final = 1.4826
SPREAD_MIN: Final = 0.01
MOVED_SHARE: Final = 0.25
WIDTH_MIN: Final = 0.1


@dataclass(frozen=True, slots=True)
class Change:
    """A value of this test, compared with earlier tests of the same device.

    `value` is None if nothing was measured now. `last` and `median`: last value and median of `runs` earlier finite
    values, at least one. `shift`: distance from the median, in permitted distances; 0 without a scale. `has_moved`:
    shift above 1.
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
    has_moved: bool


def compare_value(phase: str, measurement: Measurement, earlier: list[float]) -> Change:
    """Compare a measurement with its earlier finite values (at least one, oldest first).

    Raises TypeError for a measurement whose value is a text.
    """
    if isinstance(measurement.value, str):
        raise TypeError("expected a number, found text")
    centre = median(earlier)
    shift = _compute_shift(measurement.value, centre, earlier, measurement.limit)
    return Change(
        phase=phase,
        measurement=measurement.name,
        place=measurement.place,
        unit=measurement.unit,
        value=measurement.value,
        last=earlier[-1],
        median=centre,
        runs=len(earlier),
        shift=shift,
        has_moved=shift > 1.0,
    )


def _compute_shift(value: float | None, centre: float, earlier: list[float], limit: Limit | None) -> float:
    """Compute the distance of a value from the median of earlier values, in units of the permitted distance.

    The permitted distance is a number of robust standard deviations of the earlier values or, if they are fewer than
    `OWN_SPREAD_RUNS`, a share of the distance from the median to a bound of the limit. centre: the median. Returns
    infinity for a missing or infinite value, 0 if there is no permitted distance.
    """
    if value is None or not math.isfinite(value):
        return math.inf
    permitted: float | None
    if len(earlier) >= OWN_SPREAD_RUNS:
        deviation = ROBUST_SD_PER_MAD * median(abs(other - centre) for other in earlier)
        permitted = MOVED_DEVIATIONS * max(deviation, SPREAD_MIN * abs(centre))
    else:
        width = None if limit is None else _compute_width(value > centre, centre, limit)
        permitted = None if width is None else MOVED_SHARE * width
    if permitted is None or value == centre:
        return 0.0
    return abs(value - centre) / permitted if permitted > 0 else math.inf


def _compute_width(is_above: bool, centre: float, limit: Limit) -> float | None:
    """Compute the distance from the median to the bound of its limit, by which a change of the value is judged.

    is_above: whether the value is above the median `centre`, which selects the upper bound. Returns None for a limit
    without bounds.
    """
    low, high = limit.minimum, limit.maximum
    if low is not None and high is not None:
        return max(abs((high if is_above else low) - centre), WIDTH_MIN * (high - low))
    bound = high if low is None else low
    return None if bound is None else max(abs(bound - centre), WIDTH_MIN * abs(bound))
