"""Small pictures in table cells: one value, or several values, and the permitted range.

Positions along x are percentages of the cell. The numbers are in the neighbouring cells, so screen readers skip the
pictures.
"""

import math
import sys
from collections.abc import Iterable

from taxel.gap.page.bars import HEIGHT, MIDDLE, Axis
from taxel_tools.testing.page.html_text import render_diagram
from taxel_tools.testing.record import Limit, Outcome, Value

_MARGIN = 0.35  # Margin beyond a bound, in units of the permitted width.
_STRETCH_MAX = 1.0  # Largest extension of the axis for values beyond the margin, in permitted widths.
_END_MARGIN = 0.05  # Margin beyond the largest value, in permitted widths.
_DOT = 4.5
_BAND = (MIDDLE - 5, 10)  # Top and height in pixels.


def build_axis(limit: Limit, values: Iterable[Value]) -> Axis:
    """Build the axis of a diagram that covers a limit and the measured values.

    The permitted width is the length of the axis between bounds and start. Margins are proportional to this width.

    - No bound: the axis covers the values.
    - Two bounds: from the lower to the upper bound, with a margin at both ends.
    - Only an upper bound: from 0 to the bound, with a margin above. If the bound is not positive, or a value is
      negative, the axis begins as far below the bound as the smallest value is from the bound.
    - Only a lower bound: from 0 to a point above the bound, with a margin. This point is as far above the bound as the
      largest value is from the bound, and at least as far as the bound is from 0. If the bound is not positive, or a
      value is negative, the axis begins at a margin below the bound instead of 0.

    For values further outside, the axis is extended by at most `_STRETCH_MAX` permitted widths. Values beyond the
    extended axis are drawn as arrows.
    """
    finite = [value for value in values if isinstance(value, int | float) and math.isfinite(value)]
    least, largest = (min(finite), max(finite)) if finite else (0.0, 0.0)
    low, high = limit.minimum, limit.maximum
    if low is None and high is None:
        return Axis.over(finite)
    if low is not None and high is not None:
        width = _compute_least_width((high - low) or abs(high) or 1.0, low, high)
        start, end = low - _MARGIN * width, high + _MARGIN * width
    elif high is not None:
        width = _compute_least_width(
            high if high > 0 and least >= 0 else abs(high - least) or abs(high) or 1.0, least, high
        )
        start, end = high - width, high + _MARGIN * width
    else:
        bound = 0.0 if low is None else low
        width = _compute_least_width(max(abs(largest - bound), abs(bound)) or 1.0, bound, largest)
        start, end = (0.0 if bound > 0 and least >= 0 else bound - _MARGIN * width), bound + (1.0 + _END_MARGIN) * width
    return Axis(
        max(min(start, least), start - _STRETCH_MAX * width), min(max(end, largest), end + _STRETCH_MAX * width)
    )


def _compute_least_width(width: float, *ends: float) -> float:
    """Compute the width of an axis, at least so large that a margin at its ends is representable in floating point."""
    return max(width, 1e-9 * max(abs(end) for end in ends), sys.float_info.min)


def render_value_bar(axis: Axis, limit: Limit, value: Value, outcome: Outcome) -> str:
    """Render the SVG diagram of one measurement: permitted range as a band, value as a dot, or as an arrow beyond the
    axis.
    """
    kind = "bad" if outcome is Outcome.FAIL else "good"
    return render_diagram(f"{_render_limit_band(axis, limit)}{_render_value_mark(axis, value, kind)}")


def render_value_strip(axis: Axis, limit: Limit | None, values: Iterable[Value]) -> str:
    """Render the SVG diagram of several measured values as ticks on one line, with the permitted range as a band."""
    ticks = "".join(
        f'<line x1="{axis.at(value)}" x2="{axis.at(value)}" y1="{MIDDLE - 7}" y2="{MIDDLE + 7}"'
        f' class="tick {"good" if limit is None or limit.contains(value) else "bad"}"/>'
        for value in sorted(value for value in values if isinstance(value, int | float) and math.isfinite(value))
    )
    return render_diagram(("" if limit is None else _render_limit_band(axis, limit)) + ticks)


def _render_limit_band(axis: Axis, limit: Limit) -> str:
    """Render the SVG band of a measurement's permitted range on an axis, with a line at each finite bound."""
    low, high = limit.bounds
    left, width = axis.span(max(low, axis.low), min(high, axis.high))
    band = f'<rect x="{left}" width="{width}" y="{_BAND[0]}" height="{_BAND[1]}" class="band"/>'
    ends = "".join(
        f'<line x1="{axis.at(bound)}" x2="{axis.at(bound)}" y1="2" y2="{HEIGHT - 2}" class="bound"/>'
        for bound in (low, high)
        if math.isfinite(bound)
    )
    return f'<rect x="0" width="100%" y="{_BAND[0]}" height="{_BAND[1]}" class="ground"/>{band}{ends}'


def _render_value_mark(axis: Axis, value: Value, kind: str) -> str:
    """Render the SVG mark of a value on an axis: a dot, or an arrow at the end of the axis if the value is beyond.

    kind: CSS class.
    """
    if not isinstance(value, int | float) or math.isnan(value):
        return ""
    if value > axis.high or value < axis.low:
        x, tip = ("100%", -9) if value > axis.high else ("0", 9)
        shape = f'<path d="M{tip} {MIDDLE - 6}L0 {MIDDLE}L{tip} {MIDDLE + 6}z" class="{kind}"/>'
        return f'<svg x="{x}" overflow="visible">{shape}</svg>'
    return f'<circle cx="{axis.at(value)}" cy="{MIDDLE}" r="{_DOT}" class="{kind}"/>'
