"""Small pictures in the cells of tables: one value, or many, within what the limit allows.

Positions along x are per cent of the cell. The numbers stand beside them, hence a screen reader passes them over.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterable

from taxel.gap.page.bars import HEIGHT, MIDDLE, Axis, picture
from taxel_tools.testing.record import Limit, Outcome, Value

_MARGIN = 0.35  # of the allowed width, beyond a bound
_FARTHEST = 1.0  # allowed widths by which values may stretch the axis beyond that
_EDGE = 0.05  # of the same, so that the largest value does not stand on the end
_DOT = 4.5
_BAND = (MIDDLE - 5, 10)  # top and height, pixels


def axis_of(limit: Limit, values: Iterable[Value]) -> Axis:
    """An axis on which the limit and the values are seen; what lies far outside is left beyond its end."""
    known = [value for value in values if isinstance(value, int | float) and math.isfinite(value)]
    least, largest = (min(known), max(known)) if known else (0.0, 0.0)
    low, high = limit.minimum, limit.maximum
    if low is None and high is None:
        return Axis.over(known)
    if low is not None and high is not None:
        width = _wide_enough((high - low) or abs(high) or 1.0, low, high)
        start, end = low - _MARGIN * width, high + _MARGIN * width
    elif high is not None:
        width = _wide_enough(high if high > 0 and least >= 0 else abs(high - least) or abs(high) or 1.0, least, high)
        start, end = high - width, high + _MARGIN * width
    else:
        bound = 0.0 if low is None else low
        width = _wide_enough(max(abs(largest - bound), abs(bound)) or 1.0, bound, largest)
        start, end = (0.0 if bound > 0 and least >= 0 else bound - _MARGIN * width), bound + (1.0 + _EDGE) * width
    return Axis(max(min(start, least), start - _FARTHEST * width), min(max(end, largest), end + _FARTHEST * width))


def _wide_enough(width: float, *ends: float) -> float:
    """A width that a margin of it can be told from nothing beside these ends: floats are only so dense."""
    return max(width, 1e-9 * max(abs(end) for end in ends), sys.float_info.min)


def value_bar(axis: Axis, limit: Limit, value: Value, outcome: Outcome) -> str:
    """What is allowed as a band, and the value as a dot; an arrow where it lies beyond the end."""
    kind = "bad" if outcome is Outcome.FAIL else "good"
    return picture(f"{_allowed(axis, limit)}{_dot(axis, value, kind)}")


def strip(axis: Axis, limit: Limit | None, values: Iterable[Value]) -> str:
    """Many values as ticks on one line."""
    ticks = "".join(
        f'<line x1="{axis.at(value)}" x2="{axis.at(value)}" y1="{MIDDLE - 7}" y2="{MIDDLE + 7}"'
        f' class="tick {"good" if limit is None or limit.holds(value) else "bad"}"/>'
        for value in sorted(one for one in values if isinstance(one, int | float) and math.isfinite(one))
    )
    return picture(("" if limit is None else _allowed(axis, limit)) + ticks)


def _allowed(axis: Axis, limit: Limit) -> str:
    low, high = limit.bounds
    left, width = axis.span(max(low, axis.low), min(high, axis.high))
    band = f'<rect x="{left}" width="{width}" y="{_BAND[0]}" height="{_BAND[1]}" class="band"/>'
    ends = "".join(
        f'<line x1="{axis.at(bound)}" x2="{axis.at(bound)}" y1="2" y2="{HEIGHT - 2}" class="bound"/>'
        for bound in (low, high)
        if math.isfinite(bound)
    )
    return f'<rect x="0" width="100%" y="{_BAND[0]}" height="{_BAND[1]}" class="ground"/>{band}{ends}'


def _dot(axis: Axis, value: Value, kind: str) -> str:
    if not isinstance(value, int | float) or math.isnan(value):
        return ""
    if value > axis.high or value < axis.low:
        x, tip = ("100%", -9) if value > axis.high else ("0", 9)
        shape = f'<path d="M{tip} {MIDDLE - 6}L0 {MIDDLE}L{tip} {MIDDLE + 6}z" class="{kind}"/>'
        return f'<svg x="{x}" overflow="visible">{shape}</svg>'
    return f'<circle cx="{axis.at(value)}" cy="{MIDDLE}" r="{_DOT}" class="{kind}"/>'
