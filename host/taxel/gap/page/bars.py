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
    """The values at the left and the right end of a cell."""

    low: float
    high: float

    @classmethod
    def over(cls, values: Iterable[float | None]) -> Axis:
        """From zero, or the smallest value if it is negative, to the largest value."""
        known = [0.0, *(value for value in values if value is not None)]
        low, high = min(known), max(known)
        return cls(low, high if high > low else low + 1.0)

    def percent(self, value: float) -> float:
        """Position of a value, per cent of the width; values outside of the axis are at its end."""
        return 100.0 * min(max((value - self.low) / (self.high - self.low), 0.0), 1.0)

    def at(self, value: float) -> str:
        """The position as an SVG length."""
        return f"{self.percent(value):.2f}%"

    def span(self, first: float, second: float) -> tuple[str, str]:
        """Left end and width between two values, as SVG lengths."""
        start, end = sorted((self.percent(first), self.percent(second)))
        return f"{start:.2f}%", f"{end - start:.2f}%"


@dataclass(frozen=True)
class Shape:
    """A shape of a diagram. tag: "rect", "line", "circle" or "diamond". kind: CSS class. attributes: SVG attributes."""

    tag: str
    kind: str
    attributes: dict[str, str]


@dataclass(frozen=True)
class Bar:
    """A diagram of `height` pixels."""

    shapes: tuple[Shape, ...]
    height: int = HEIGHT


def build_share_bar(axis: Axis, share: float, is_strong: bool) -> Bar:
    """A bar from zero; pale unless `is_strong`."""
    return Bar((_rect(axis, 0.0, share, "mark" if is_strong else "faint", 5, 12), *_zero_line(axis)))


def build_waterfall_bar(axis: Axis, start: float, end: float, kind: str, floor: float | None) -> Bar:
    """A step from `start` to `end` with the CSS class `kind`, and the floor as a line through all rows."""
    floor_line = () if floor is None else (_vertical_line(axis, floor, "floor", STEP_HEIGHT),)
    return Bar((_rect(axis, start, end, kind, 9, 20), *floor_line), STEP_HEIGHT)


def build_shrink_bar(axis: Axis, shrink: float, bounds: Interval | None, is_strong: bool) -> Bar:
    """A bar from zero with its interval."""
    bar = _rect(axis, 0.0, shrink, "mark" if is_strong else "faint", 5, 12)
    return Bar((bar, *_zero_line(axis), *_whisker(axis, bounds)))


def build_before_after_bar(axis: Axis, before: float, after: float, floor: float | None) -> Bar:
    """A ring at the value before, a dot at the value after, and a line at the floor."""
    floor_line = () if floor is None else (_vertical_line(axis, floor, "floor"),)
    connection = Shape("line", "thread", {"x1": axis.at(before), "x2": axis.at(after), **_at_middle()})
    return Bar((*floor_line, connection, _circle(axis, before, "ring"), _circle(axis, after, "dot")))


def build_prediction_bar(axis: Axis, predicted: float | None, measured: float | None, bounds: Interval | None) -> Bar:
    """A diamond at the predicted value, and a dot with its interval at the measured value."""
    shapes = [Shape("line", "axis", {"x1": "0", "x2": "100%", **_at_middle()}), *_whisker(axis, bounds)]
    if measured is not None:
        shapes.append(_circle(axis, measured, "dot"))
    if predicted is not None:
        shapes.append(Shape("diamond", "ring hollow", {"x": axis.at(predicted), "y": str(MIDDLE)}))
    return Bar(tuple(shapes))


def _rect(axis: Axis, start: float, end: float, kind: str, top: int, height: int) -> Shape:
    x, width = axis.span(start, end)
    return Shape("rect", kind, {"x": x, "width": width, "y": str(top), "height": str(height)})


def _circle(axis: Axis, value: float, kind: str) -> Shape:
    return Shape("circle", kind, {"cx": axis.at(value), "cy": str(MIDDLE), "r": "5"})


def _vertical_line(axis: Axis, value: float, kind: str, height: int = HEIGHT) -> Shape:
    return Shape("line", kind, {"x1": axis.at(value), "x2": axis.at(value), "y1": "0", "y2": str(height)})


def _zero_line(axis: Axis) -> tuple[Shape, ...]:
    return (_vertical_line(axis, 0.0, "axis"),) if axis.low < 0 else ()


def _whisker(axis: Axis, bounds: Interval | None) -> list[Shape]:
    """An interval with short vertical lines at its ends."""
    if bounds is None:
        return []
    low, high = (axis.at(bound) for bound in bounds)
    vertical = {"y1": str(MIDDLE - 4), "y2": str(MIDDLE + 4)}
    ends = [Shape("line", "ci", {"x1": x, "x2": x, **vertical}) for x in (low, high)]
    return [Shape("line", "ci", {"x1": low, "x2": high, **_at_middle()}), *ends]


def _at_middle() -> dict[str, str]:
    return {"y1": str(MIDDLE), "y2": str(MIDDLE)}
