"""Small pictures in the cells of tables: bars of shares, steps of the waterfall, before and after.

They have no view box: positions along x are per cent of the cell, so that they grow with it and their strokes and dots
do not. The numbers stand beside them in the table, hence a screen reader is told to pass them over.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from taxel.gap.page.fields import Interval

HEIGHT = 22  # pixels
STEP_HEIGHT = 38  # the waterfall's rows touch each other
MIDDLE = HEIGHT // 2


@dataclass(frozen=True)
class Axis:
    """The values at the left and at the right end of a cell."""

    low: float
    high: float

    @classmethod
    def over(cls, values: Iterable[float | None]) -> Axis:
        """From zero, or the least value if that is negative, to the largest."""
        known = [0.0, *(value for value in values if value is not None)]
        low, high = min(known), max(known)
        return cls(low, high if high > low else low + 1.0)

    def percent(self, value: float) -> float:
        """Where a value is, per cent of the width; what lies outside is at the end."""
        return 100.0 * min(max((value - self.low) / (self.high - self.low), 0.0), 1.0)

    def at(self, value: float) -> str:
        """The same as a length of SVG."""
        return f"{self.percent(value):.2f}%"

    def span(self, first: float, second: float) -> tuple[str, str]:
        """Left end and width between two values, as lengths of SVG."""
        left, right = sorted((self.percent(first), self.percent(second)))
        return f"{left:.2f}%", f"{right - left:.2f}%"


def picture(shapes: str, height: int = HEIGHT) -> str:
    """The cell's picture around its shapes."""
    return f'<svg class="bar" width="100%" height="{height}" aria-hidden="true">{shapes}</svg>'


def share_bar(axis: Axis, share: float, strong: bool) -> str:
    """A bar from zero; faint unless `strong`."""
    zero = _upright(axis, 0.0, "axis") if axis.low < 0 else ""
    return picture(f"{_bar(axis, 0.0, share, 'mark' if strong else 'faint', 5, 12)}{zero}")


def waterfall_bar(axis: Axis, start: float, end: float, kind: str, floor: float | None) -> str:
    """A step from `start` to `end`, `kind` its class, with the floor as a line that runs on from row to row."""
    line = "" if floor is None else _upright(axis, floor, "floor", STEP_HEIGHT)
    return picture(f"{_bar(axis, start, end, kind, 9, 20)}{line}", STEP_HEIGHT)


def whisker(axis: Axis, bounds: Interval | None, middle: int = MIDDLE) -> str:
    """An interval, with its ends."""
    if bounds is None:
        return ""
    low, high = (axis.at(bound) for bound in bounds)
    ends = "".join(f'<line x1="{x}" x2="{x}" y1="{middle - 4}" y2="{middle + 4}" class="ci"/>' for x in (low, high))
    return f'<line x1="{low}" x2="{high}" y1="{middle}" y2="{middle}" class="ci"/>{ends}'


def shrink_bar(axis: Axis, shrink: float, bounds: Interval | None, strong: bool) -> str:
    """A bar from zero with its interval."""
    zero = _upright(axis, 0.0, "axis") if axis.low < 0 else ""
    return picture(f"{_bar(axis, 0.0, shrink, 'mark' if strong else 'faint', 5, 12)}{zero}{whisker(axis, bounds)}")


def before_after(axis: Axis, before: float, after: float, floor: float | None) -> str:
    """A ring before, a dot after, and the floor."""
    left, right = axis.at(before), axis.at(after)
    line = "" if floor is None else _upright(axis, floor, "floor")
    return picture(
        f'{line}<line x1="{left}" x2="{right}" y1="{MIDDLE}" y2="{MIDDLE}" class="thread"/>'
        f'<circle cx="{left}" cy="{MIDDLE}" r="5" class="ring"/><circle cx="{right}" cy="{MIDDLE}" r="5" class="dot"/>'
    )


def predicted_measured(axis: Axis, predicted: float | None, measured: float | None, bounds: Interval | None) -> str:
    """An open diamond where it was predicted, a dot with its interval where it was measured."""
    shapes = whisker(axis, bounds)
    if measured is not None:
        shapes += f'<circle cx="{axis.at(measured)}" cy="{MIDDLE}" r="5" class="dot"/>'
    if predicted is not None:
        shapes += (
            f'<svg x="{axis.at(predicted)}" y="{MIDDLE}" overflow="visible">'
            '<path d="M0 -7L7 0L0 7L-7 0Z" class="ring hollow"/></svg>'
        )
    ground = f'<line x1="0" x2="100%" y1="{MIDDLE}" y2="{MIDDLE}" class="axis"/>'
    return picture(f"{ground}{shapes}")


def _bar(axis: Axis, start: float, end: float, kind: str, top: int, height: int) -> str:
    left, width = axis.span(start, end)
    return f'<rect x="{left}" width="{width}" y="{top}" height="{height}" class="{kind}"/>'


def _upright(axis: Axis, value: float, kind: str, height: int = HEIGHT) -> str:
    return f'<line x1="{axis.at(value)}" x2="{axis.at(value)}" y1="0" y2="{height}" class="{kind}"/>'
