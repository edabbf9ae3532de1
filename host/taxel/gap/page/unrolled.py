"""The hand unrolled: each board as its TX x RX matrix, each taxel coloured by its excess."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from taxel.gap.errors import GapInputError
from taxel.gap.page.board_map import EDGE, Board, Placed, View, boards_of, views_of
from taxel.gap.page.colours import DARK, LIGHT, ramp_css, step_css, step_of, top_of
from taxel.gap.page.fields import REMEDY, Value
from taxel.gap.page.places import line_of
from taxel.gap.page.report import Report, address_of
from taxel.gap.page.text import escaped, is_small, listed, number, percent, plural

CELL = 10  # units of the picture
SQUARE = 8.6  # side of a taxel, units
MARGIN = 0.7
LARGEST_CELL_PX = 11
LEAST_SHARE = 0.01  # of the excess, of a board that is marked
_NAMED = 3  # boards that the words for a picture name

_STAGES = ("before", "after")
_STYLE = (
    f":root{{{ramp_css(LIGHT)}--ink:#1b1d22;--muted:#5b606b;--ground:#f7f7f5;--line:#d5d7dc}}"
    f"@media (prefers-color-scheme:dark){{:root{{{ramp_css(DARK)}--ink:#eceef2;--muted:#a3a9b5;"
    "--ground:#1b1d22;--line:#3a3e47}}"
    "text{font-family:system-ui,sans-serif}"
)


@dataclass(frozen=True)
class Marks:
    """What is marked: boards by address, with their share of the excess if known, and lines (address, axis, number)."""

    boards: Mapping[int, float | None] = field(default_factory=dict)
    lines: frozenset[tuple[int, str, int]] = frozenset()


@dataclass(frozen=True)
class Unrolled:
    """What the pictures of both stages share.

    Attributes:
        views: the pictures of the hand, drawn beside each other.
        excess: before and after, counts squared, each [n]; NaN where nothing is known.
        top: the end of the colour scale, counts.
        marks: before, boards and lines of small p-value, the boards of no small share; after, those where something
            unexplained is left.
    """

    views: tuple[View, ...]
    excess: tuple[list[float], list[float]]
    top: float
    marks: tuple[Marks, Marks]

    def stage(self, stage: str) -> tuple[list[float], Marks]:
        """Excess and marks of a stage."""
        index = _STAGES.index(stage)
        return self.excess[index], self.marks[index]


def unrolled_of(report: Report) -> Unrolled | None:
    """What the pictures show; None if the report says nothing of taxels. Raises GapInputError."""
    if report.excess is None:
        return None
    floors = [report.gap.maybe_number("floor"), report.after.maybe_number("floor")]
    top = top_of(report.excess, max((floor for floor in floors if floor is not None), default=0.0))
    return Unrolled(views_of(boards_of(report)), report.excess, top, (_marks_before(report), _marks_after(report)))


def _marks_before(report: Report) -> Marks:
    where = report.where
    boards = {address_of(entry): entry.number("share") for entry in where.maybe_list("sensors") if _is_marked(entry)}
    lines = {line_of(entry) for entry in where.maybe_list("lines") if is_small(entry.maybe_number("p_value"))}
    return Marks(boards, frozenset(lines))


def _is_marked(entry: Value) -> bool:
    """Whether a board's share of the excess is no chance, and can be seen: where noise is all that differs, it does so
    surely on every board.
    """
    return is_small(entry.maybe_number("p_value")) and entry.number("share") >= LEAST_SHARE


def _marks_after(report: Report) -> Marks:
    left = report.root.field("unexplained")
    if not is_small(left.maybe_number("p_value")):
        return Marks()
    places = [place for place in left.maybe_list("where") if isinstance(place.content, dict) and place.maybe("address")]
    lines = {line_of(place) for place in places if place.maybe("axis")}
    whole = {address_of(place): None for place in places if not place.maybe("axis") and not place.maybe("index")}
    return Marks(whole, frozenset(lines))


def required_unrolled(report: Mapping[str, Any]) -> Unrolled:
    """What the pictures show. Raises GapInputError, also if the report says nothing of taxels."""
    found = unrolled_of(Report(report))
    if found is None:
        raise GapInputError("report: taxel_excess", "taxels and the excess of each", "none", REMEDY)
    return found


def unrolled_svg(report: Mapping[str, Any], stage: str = "before") -> str:
    """The unrolled hand of a report as an SVG document that stands alone; light or dark as its reader prefers.

    Args:
        report: as `json.load` gives it.
        stage: "before", or "after" the verdict's effects are added.

    Raises:
        GapInputError: a report without taxels and their excess, or a field that is malformed.
        ValueError: another stage.
    """
    if stage not in _STAGES:
        raise ValueError(f"stage: expected one of {', '.join(_STAGES)}, found {stage!r}")
    unrolled = required_unrolled(report)
    width = sum(view.width for view in unrolled.views)
    height = max(view.height for view in unrolled.views)
    body, left = "", 0.0
    for view in unrolled.views:
        shift = f"translate({CELL * left:g} {CELL * (height - view.height):g})"
        body += f'<g transform="{shift}">{view_shapes(unrolled, view, stage)}</g>'
        left += view.width
    title = f"<title>The hand unrolled, {stage} the effects are added</title>"
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {CELL * width:g} {CELL * height:g}" role="img">'
        f"{title}<style>{_STYLE}{shape_css()}</style>"
        f'<rect width="100%" height="100%" fill="var(--ground)"/>{body}</svg>\n'
    )


def shape_css() -> str:
    """The style that the shapes ask for; colours are the custom properties of `colours` and four of the page."""
    return (
        f"{step_css()}.none{{fill:none;stroke:var(--muted);stroke-dasharray:1.5 1.5}}"
        ".block{fill:none;stroke:var(--line)}.block.marked{stroke:var(--ink);stroke-width:2.2}"
        ".side{font-size:16px;fill:var(--muted)}.finger{font-size:16px;font-weight:650;fill:var(--ink)}"
        ".finger,.name{text-anchor:middle}.name{font-size:15px;fill:var(--muted)}"
        ".name.marked{fill:var(--ink);font-weight:650}.arrow{fill:var(--ink)}"
    )


def view_svg(unrolled: Unrolled, view: View, stage: str, anchor: str) -> str:
    """One view as an element of the page, with its words; `anchor` makes its ids unique."""
    excess, _ = unrolled.stage(stage)
    width, height = CELL * view.width, CELL * view.height
    return (
        f'<svg class="hand" viewBox="0 0 {width:g} {height:g}" style="max-width:{LARGEST_CELL_PX * view.width:.0f}px;'
        f'flex:{view.width:.2f} 1 {5 * view.width:.0f}px" role="img" aria-labelledby="{anchor}-t {anchor}-d">'
        f'<title id="{anchor}-t">{view.title or "boards"}, {stage}</title>'
        f'<desc id="{anchor}-d">{view_words(view, excess)}</desc>{view_shapes(unrolled, view, stage)}</svg>'
    )


def view_words(view: View, excess: Sequence[float]) -> str:
    """A view in words, escaped: the boards with the largest mean excess."""
    means = []
    for placed in view.boards:
        known = [excess[index] for index in placed.board.index if not math.isnan(excess[index])]
        if known:
            means.append((sum(known) / len(known), placed.board))
    largest = sorted(means, key=lambda item: (-item[0], item[1].address))[:_NAMED]
    named = [f"{escaped(board.name.replace('_', ' '))} ({_counts(mean)})" for mean, board in largest]
    return f"{plural(len(view.boards), 'board')}; the mean excess is largest on {listed(named) or 'none'}."


def view_shapes(unrolled: Unrolled, view: View, stage: str) -> str:
    """The shapes of one view."""
    _, marks = unrolled.stage(stage)
    words = f'<text class="side" x="{CELL * EDGE - 2:g}" y="15">{view.title}</text>' if view.title else ""
    for heading in view.headings:
        words += f'<text class="finger" x="{CELL * heading.x:g}" y="{CELL * heading.y:g}">{heading.label}</text>'
    return words + "".join(_board(unrolled, placed, stage, marks) for placed in view.boards)


def labelled(placed: Placed, marks: Marks) -> str:
    """The words over a board: its label, and its share if it is marked."""
    share = marks.boards.get(placed.board.address)
    return placed.label if share is None else f"{placed.label} {percent(share)}"


def _board(unrolled: Unrolled, placed: Placed, stage: str, marks: Marks) -> str:
    board = placed.board
    mark = " marked" if board.address in marks.boards else ""
    label = escaped(labelled(placed, marks))
    width, height = CELL * board.columns, CELL * board.rows
    x, y = CELL * placed.x, CELL * placed.y
    return (
        f'<g transform="translate({x:g} {y:g})">'
        f'<text class="name{mark}" x="{width / 2:g}" y="-14">{label}</text>'
        f'<rect class="block{mark}" x="-2.2" y="-2.2" width="{width + 4.4:g}" height="{height + 4.4:g}" rx="3"/>'
        f"{_squares(unrolled, board, stage)}{_arrows(board, marks)}</g>"
    )


def _squares(unrolled: Unrolled, board: Board, stage: str) -> str:
    shapes = []
    name = escaped(board.name.replace("_", " "))
    for index, tx, rx in zip(board.index, board.tx, board.rx, strict=True):
        before, after = (values[index] for values in unrolled.excess)
        shown = before if stage == "before" else after
        kind = "none" if math.isnan(shown) else f"q{step_of(shown, unrolled.top)}"
        place = f'x="{CELL * rx + MARGIN:g}" y="{CELL * tx + MARGIN:g}" width="{SQUARE}" height="{SQUARE}"'
        words = f"{name}, TX {tx} RX {rx}: {_counts(before)} before, {_counts(after)} after"
        shapes.append(f'<rect class="{kind}" {place}><title>{words}</title></rect>')
    return "".join(shapes)


def _arrows(board: Board, marks: Marks) -> str:
    """An arrow at the end of each marked line."""
    shapes = ""
    for address, axis, index in sorted(marks.lines):
        if address == board.address and index < (board.rows if axis == "tx" else board.columns):
            middle = CELL * (index + 0.5)
            place = f"-3.4 {middle:g}) rotate(-90" if axis == "tx" else f"{middle:g} -3.4"
            shapes += f'<path class="arrow" transform="translate({place})" d="M-3.4 -6.2H3.4L0 0Z"/>'
    return shapes


def _counts(excess: float) -> str:
    """An excess in words, as its root."""
    if math.isnan(excess):
        return "not known"
    return f"{number(math.sqrt(excess))} counts" if excess > 0 else "at the floor"
