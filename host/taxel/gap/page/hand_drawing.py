"""Drawing of the unrolled hand: each board by its layout, each taxel coloured by its excess.

The drawing is a list of shapes in taxel pitches. The page and the SVG file (templates) and the PNG file (`hand_png.py`)
draw the same shapes.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from taxel.gap.errors import GapInputError
from taxel.gap.page.board_map import EDGE, Board, PlacedBoard, View, arrange_views, list_boards
from taxel.gap.page.colours import DARK, LIGHT, compute_top, format_ramp_css, format_step_css, select_step
from taxel.gap.page.locations import read_line
from taxel.gap.page.rendering import read_resource, render
from taxel.gap.page.text import format_count, format_number, format_percent, is_small, join_words, make_readable
from taxel.gap.report.checked_report import CheckedReport, get_address
from taxel.gap.report.report_values import REMEDY, ReportValue

SQUARE = 0.86
"""Side of a taxel, in taxel pitches."""

FRAME = 0.22
"""Distance of a board's frame from its taxels."""

MIN_SHARE = 0.01
"""Smallest share of the excess at which a board is marked."""

STAGES = ("before", "after")

_DESCRIBED_BOARDS = 3
_SVG_COLOURS = (
    f":root{{{format_ramp_css(LIGHT)}--ink:#1b1d22;--muted:#5b606b;--ground:#f7f7f5;--line:#d5d7dc}}"
    f"@media (prefers-color-scheme:dark){{:root{{{format_ramp_css(DARK)}--ink:#eceef2;--muted:#a3a9b5;"
    "--ground:#1b1d22;--line:#3a3e47}}"
    "text{font-family:system-ui,sans-serif}"
)


@dataclass(frozen=True)
class Marks:
    """Marked boards by address, with their share of the excess if known, and marked lines (address, axis, index)."""

    boards: Mapping[int, float | None] = field(default_factory=dict)
    lines: frozenset[tuple[int, str, int]] = frozenset()


@dataclass(frozen=True)
class Square:
    """A taxel. x, y: upper left corner, relative to the board. step: step of the colour ramp; None without data."""

    x: float
    y: float
    size: float
    step: int | None
    title: str


@dataclass(frozen=True)
class Rectangle:
    """A rectangle with its upper left corner."""

    x: float
    y: float
    width: float
    height: float


@dataclass(frozen=True)
class Arrow:
    """A triangle at the end of a marked line. points: its three corners in the board, the last one at the line."""

    points: tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Label:
    """A text with its horizontal middle and its base line."""

    x: float
    y: float
    text: str


@dataclass(frozen=True)
class BoardDrawing:
    """A board. x, y: upper left corner of its taxels in the view; all shapes are relative to this corner."""

    x: float
    y: float
    columns: int
    label: str
    is_marked: bool
    frame: Rectangle
    squares: tuple[Square, ...]
    arrows: tuple[Arrow, ...]
    label_y: float = -1.4


@dataclass(frozen=True)
class ViewDrawing:
    """One picture of the hand. description: the boards with the largest mean excess, for screen readers."""

    title: str
    width: float
    height: float
    headings: tuple[Label, ...]
    boards: tuple[BoardDrawing, ...]
    description: str
    title_x: float = EDGE - 0.2
    title_y: float = 1.5


@dataclass(frozen=True)
class UnrolledHand:
    """Data of the pictures of both stages.

    Attributes:
        views: the pictures of the hand, from left to right.
        excess: before and after, counts squared, each [n] (n taxels); NaN where there are no data.
        top: upper end of the colour scale, counts.
        marks: before: boards and lines with a small p-value, boards only with a share of at least `MIN_SHARE`; after:
            boards and lines where an unexplained part remains.
    """

    views: tuple[View, ...]
    excess: tuple[list[float], list[float]]
    top: float
    marks: tuple[Marks, Marks]

    def draw(self, stage: str) -> tuple[ViewDrawing, ...]:
        """Return the drawings of a stage, one for each view. stage: "before" or "after" (with the effects added)."""
        index = STAGES.index(stage)
        return tuple(self._draw_view(view, self.excess[index], self.marks[index]) for view in self.views)

    def _draw_view(self, view: View, excess: Sequence[float], marks: Marks) -> ViewDrawing:
        """Return the drawing of one view. excess: counts squared, [n] (n taxels). marks: boards and lines to mark."""
        headings = tuple(Label(heading.x, heading.y, heading.label) for heading in view.headings)
        boards = tuple(self._draw_board(placed, excess, marks) for placed in view.boards)
        return ViewDrawing(view.title, view.width, view.height, headings, boards, _describe(view, excess))

    def _draw_board(self, placed: PlacedBoard, excess: Sequence[float], marks: Marks) -> BoardDrawing:
        """Return the drawing of a board: frame, taxels, label and arrows. excess: counts squared, [n] (n taxels), of
        all taxels. marks: boards and lines to mark.
        """
        board = placed.board
        frame = Rectangle(-FRAME, -FRAME, board.columns + 2 * FRAME, board.rows + 2 * FRAME)
        share = marks.boards.get(board.address)
        label = placed.label if share is None else f"{placed.label} {format_percent(share)}"
        squares = tuple(self._draw_squares(board, excess))
        is_marked = board.address in marks.boards
        return BoardDrawing(
            placed.x, placed.y, board.columns, label, is_marked, frame, squares, _draw_arrows(board, marks)
        )

    def _draw_squares(self, board: Board, excess: Sequence[float]) -> list[Square]:
        """Return the taxels of a board as coloured squares; their titles state the excess before and after. excess:
        counts squared, [n] (n taxels), of all taxels.
        """
        squares, margin, name = [], (1.0 - SQUARE) / 2, make_readable(board.name)
        places = zip(board.index, board.tx, board.rx, board.row, board.column, strict=True)
        for index, tx, rx, row, column in places:
            before, after = (values[index] for values in self.excess)
            step = None if math.isnan(excess[index]) else select_step(excess[index], self.top)
            title = f"{name}, TX {tx} RX {rx}: {_format_counts(before)} before, {_format_counts(after)} after"
            squares.append(Square(column + margin, row + margin, SQUARE, step, title))
        return squares


def read_unrolled_hand(report: CheckedReport) -> UnrolledHand | None:
    """Return the data of the pictures; None if the report has no excess of taxels. Raises GapInputError for a malformed
    field.
    """
    if report.excess is None:
        return None
    floors = [report.gap.optional_number("floor"), report.after.optional_number("floor")]
    top = compute_top(report.excess, max((floor for floor in floors if floor is not None), default=0.0))
    return UnrolledHand(
        arrange_views(list_boards(report)), report.excess, top, (_find_marks_before(report), _find_marks_after(report))
    )


def require_unrolled_hand(report: Mapping[str, Any]) -> UnrolledHand:
    """Return the data of the pictures. Raises GapInputError for a malformed field, and if the report has no excess of
    taxels.
    """
    hand = read_unrolled_hand(CheckedReport(report))
    if hand is None:
        raise GapInputError("report: taxel_excess", "taxels and the excess of each", "none", REMEDY)
    return hand


def unrolled_svg(report: Mapping[str, Any], stage: str = "before") -> str:
    """Return the unrolled hand of a report as a complete SVG document, light or dark as the reader prefers.

    Args:
        report: content of `report.json`, as `json.load` returns it.
        stage: "before", or "after" for the excess with the effects of the verdict added.

    Raises:
        GapInputError: a report without taxels and their excess, or a malformed field.
        ValueError: another stage.
    """
    if stage not in STAGES:
        raise ValueError(f"stage: expected one of {', '.join(STAGES)}, found {stage!r}")
    drawings = require_unrolled_hand(report).draw(stage)
    height = max(view.height for view in drawings)
    views, width = [], 0.0
    for view in drawings:
        views.append((width, height - view.height, view))
        width += view.width
    style = f"{_SVG_COLOURS}{format_step_css()}{read_resource('hand.css')}"
    return render("hand.svg", width=width, height=height, stage=stage, style=style, views=views)


def _find_marks_before(report: CheckedReport) -> Marks:
    """Return the boards and lines to mark in the picture of the stage "before".

    A board is marked if its p-value is below `SMALL_P` and its share is at least `MIN_SHARE`; a line is marked by its
    p-value alone. The share of a board is its part of the excess of all boards, 0 to 1; the label of the board shows
    the share.
    """
    where = report.where
    entries = [entry for entry in where.optional_list("sensors") if _is_marked(entry)]
    boards = {get_address(entry): entry.number("share") for entry in entries}
    lines = {read_line(entry) for entry in where.optional_list("lines") if is_small(entry.optional_number("p_value"))}
    return Marks(boards, frozenset(lines))


def _is_marked(entry: ReportValue) -> bool:
    """Return whether a board has a small p-value and at least `MIN_SHARE` of the excess.

    The p-value alone is not sufficient: a difference of the noise between the two datasets gives all boards a small
    p-value.
    """
    return is_small(entry.optional_number("p_value")) and entry.number("share") >= MIN_SHARE


def _find_marks_after(report: CheckedReport) -> Marks:
    """Return the boards and lines to mark in the picture of the stage "after": those with an unexplained part.

    Nothing is marked if the unexplained part is not significant. The marks have no shares.
    """
    unexplained = report.root.field("unexplained")
    if not is_small(unexplained.optional_number("p_value")):
        return Marks()
    locations = [
        location
        for location in unexplained.optional_list("where")
        if isinstance(location.content, dict) and location.optional("address")
    ]
    lines = {read_line(location) for location in locations if location.optional("axis")}
    boards = {
        get_address(location): None
        for location in locations
        if not location.optional("axis") and not location.optional("index")
    }
    return Marks(boards, frozenset(lines))


def _draw_arrows(board: Board, marks: Marks) -> tuple[Arrow, ...]:
    """Return arrows at the marked lines of a board: beside each row, or above each column, whichever are fewer."""
    beside: set[int] = set()
    above: set[int] = set()
    for address, axis, index in marks.lines:
        if address != board.address:
            continue
        lines = board.tx if axis == "tx" else board.rx
        places = [place for place, line in enumerate(lines) if line == index]
        rows, columns = ({values[place] for place in places} for values in (board.row, board.column))
        is_beside = len(rows) < len(columns) or (len(rows) == len(columns) and axis == "tx")
        beside, above = (beside | rows, above) if is_beside else (beside, above | columns)
    # An arrow beside a row is an arrow above a column with x and y exchanged.
    return (
        *(Arrow(tuple((y, x) for x, y in _make_arrow(row))) for row in sorted(beside)),
        *(Arrow(_make_arrow(column)) for column in sorted(above)),
    )


def _make_arrow(place: int) -> tuple[tuple[float, float], ...]:
    """Return the three corners of an arrow above the column `place`."""
    middle = place + 0.5
    return (middle - 0.34, -0.96), (middle + 0.34, -0.96), (middle, -0.34)


def _describe(view: View, excess: Sequence[float]) -> str:
    """Return a description for screen readers: the boards with the largest mean excess. excess: counts squared, [n] (n
    taxels).
    """
    means = []
    for placed in view.boards:
        known = [excess[index] for index in placed.board.index if not math.isnan(excess[index])]
        if known:
            means.append((sum(known) / len(known), placed.board))
    largest = sorted(means, key=lambda item: (-item[0], item[1].address))[:_DESCRIBED_BOARDS]
    boards = [f"{make_readable(board.name)} ({_format_counts(mean)})" for mean, board in largest]
    return f"{format_count(len(view.boards), 'board')}; the mean excess is largest on {join_words(boards) or 'none'}."


def _format_counts(excess: float) -> str:
    """Return the root of an excess (counts squared) as text in counts; "at the floor" for an excess of at most 0."""
    if math.isnan(excess):
        return "no data"
    return f"{format_number(math.sqrt(excess))} counts" if excess > 0 else "at the floor"
