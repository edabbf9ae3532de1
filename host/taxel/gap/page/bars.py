"""Small diagrams in table cells: bars of shares, steps of the waterfall, values before and after.

A diagram has no view box: its x coordinates are per cent of the cell's width, so that it scales with the cell while its
strokes and dots keep their size. The table contains the same numbers as text, so the diagrams are hidden from screen
readers.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from taxel.gap.report.report_values import Interval

HEIGHT = 22  # pixels
STEP_HEIGHT = 38  # pixels; the rows of the waterfall touch each other
MIDDLE = HEIGHT // 2


@dataclass(frozen=True)
class Axis:
    """The values at the left end (`low`) and at the right end (`high`) of a cell."""

    low: float
    high: float

    @classmethod
    def over(cls, values: Iterable[float | None]) -> Axis:
        """Return an axis from 0, or from the smallest value if it is negative, to the largest value. None is ignored.

        If all values are 0, the axis ends at 1.
        """
        known = [0.0, *(value for value in values if value is not None)]
        low, high = min(known), max(known)
        return cls(low, high if high > low else low + 1.0)

    def percent(self, value: float) -> float:
        """Return the position of a value, per cent of the cell's width; values outside the axis are at its ends."""
        return 100.0 * min(max((value - self.low) / (self.high - self.low), 0.0), 1.0)

    def at(self, value: float) -> str:
        """Return the position of a value as an SVG length."""
        return f"{self.percent(value):.2f}%"

    def span(self, first: float, second: float) -> tuple[str, str]:
        """Return the left end and the width of the span between two values, as SVG lengths."""
        start, end = sorted((self.percent(first), self.percent(second)))
        return f"{start:.2f}%", f"{end - start:.2f}%"


@dataclass(frozen=True)
class Shape:
    """A shape of a diagram. tag: "rect", "line", "circle" or "diamond". kind: CSS class, which determines colour and
    stroke. attributes: SVG attributes.
    """

    tag: str
    kind: str
    attributes: dict[str, str]


@dataclass(frozen=True)
class Bar:
    """A diagram of `height` pixels."""

    shapes: tuple[Shape, ...]
    height: int = HEIGHT


def build_share_bar(axis: Axis, share: float, is_strong: bool) -> Bar:
    """Return a bar from zero to `share`, with a line at zero if the axis has negative values. is_strong: whether the
    bar has the strong instead of the pale colour.
    """
    # 5, 12: upper edge and height of the bar, pixels
    return Bar((_draw_rect(axis, 0.0, share, "mark" if is_strong else "faint", 5, 12), *_draw_zero_line(axis)))


def build_waterfall_bar(axis: Axis, start: float, end: float, kind: str, floor: float | None) -> Bar:
    """Return a bar from `start` to `end` with the CSS class `kind`, and a vertical line at the floor, which continues
    through all rows. floor: None omits the line.
    """
    floor_line = () if floor is None else (_draw_vertical_line(axis, floor, "floor", STEP_HEIGHT),)
    # 9, 20: upper edge and height of the bar, pixels
    return Bar((_draw_rect(axis, start, end, kind, 9, 20), *floor_line), STEP_HEIGHT)


def build_shrink_bar(axis: Axis, shrink: float, bounds: Interval | None, is_strong: bool) -> Bar:
    """Return a bar from zero to `shrink` with its interval. bounds: interval; None omits it. is_strong: whether the bar
    has the strong instead of the pale colour.
    """
    # 5, 12: upper edge and height of the bar, pixels
    bar = _draw_rect(axis, 0.0, shrink, "mark" if is_strong else "faint", 5, 12)
    return Bar((bar, *_draw_zero_line(axis), *_draw_whisker(axis, bounds)))


def build_before_after_bar(axis: Axis, before: float, after: float, floor: float | None) -> Bar:
    """Return a diagram with a ring at the value before, a dot at the value after, a line between them, and a vertical
    line at the floor. floor: None omits its line.
    """
    floor_line = () if floor is None else (_draw_vertical_line(axis, floor, "floor"),)
    connection = Shape("line", "thread", {"x1": axis.at(before), "x2": axis.at(after), **_at_middle()})
    return Bar((*floor_line, connection, _draw_circle(axis, before, "ring"), _draw_circle(axis, after, "dot")))


def build_prediction_bar(axis: Axis, predicted: float | None, measured: float | None, bounds: Interval | None) -> Bar:
    """Return a diagram with a diamond at the predicted value, and a dot with its interval at the measured value.

    predicted, measured, bounds: None omits the diamond, the dot or the interval.
    """
    shapes = [Shape("line", "axis", {"x1": "0", "x2": "100%", **_at_middle()}), *_draw_whisker(axis, bounds)]
    if measured is not None:
        shapes.append(_draw_circle(axis, measured, "dot"))
    if predicted is not None:
        shapes.append(Shape("diamond", "ring hollow", {"x": axis.at(predicted), "y": str(MIDDLE)}))
    return Bar(tuple(shapes))


def _draw_rect(axis: Axis, start: float, end: float, kind: str, top: int, height: int) -> Shape:
    """Return a rectangle from `start` to `end` with the CSS class `kind`. top, height: pixels."""
    x, width = axis.span(start, end)
    return Shape("rect", kind, {"x": x, "width": width, "y": str(top), "height": str(height)})


def _draw_circle(axis: Axis, value: float, kind: str) -> Shape:
    return Shape("circle", kind, {"cx": axis.at(value), "cy": str(MIDDLE), "r": "5"})


def _draw_vertical_line(axis: Axis, value: float, kind: str, height: int = HEIGHT) -> Shape:
    return Shape("line", kind, {"x1": axis.at(value), "x2": axis.at(value), "y1": "0", "y2": str(height)})


def _draw_zero_line(axis: Axis) -> tuple[Shape, ...]:
    """Return a vertical line at zero; empty if the axis begins at zero."""
    return (_draw_vertical_line(axis, 0.0, "axis"),) if axis.low < 0 else ()


def _draw_whisker(axis: Axis, bounds: Interval | None) -> list[Shape]:
    """Return an interval as a horizontal line with short vertical lines at its ends; empty for None."""
    if bounds is None:
        return []
    low, high = (axis.at(bound) for bound in bounds)
    vertical = {"y1": str(MIDDLE - 4), "y2": str(MIDDLE + 4)}
    ends = [Shape("line", "ci", {"x1": x, "x2": x, **vertical}) for x in (low, high)]
    return [Shape("line", "ci", {"x1": low, "x2": high, **_at_middle()}), *ends]


def _at_middle() -> dict[str, str]:
    return {"y1": str(MIDDLE), "y2": str(MIDDLE)}
