"""Positions of the boards in the picture of the unrolled hand. The unit of length is one taxel pitch of the picture.

A board is the rectangle of its TX lines (rows, TX 0 on top) and RX lines (columns, RX 0 on the left), seen from outside
with the distal end on top, as in the hand descriptions. The boards of the default hand are arranged like a right hand,
with its palm side and its back; the boards of other hands are arranged in rows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from taxel.gap.page.text import readable
from taxel.gap.report.checked_report import CheckedReport
from taxel.hand.unrolled_layout import SIDES, get_short_name

LABEL = 3.1  # height above each board for its name and the marks of its RX lines
HEADING = 2.6  # height above each column for the name of its finger
TITLE = 2.0  # height of the title
GAP_X = 2.4
GAP_Y = 0.6
EDGE = 1.0
ROW_WIDTH = 46.0
LETTER = 0.8  # mean width of a letter of a label
MAX_NAME = 18  # characters


@dataclass(frozen=True)
class Board:
    """A board. index, tx, rx: index in the report, TX line and RX line of each of its taxels."""

    address: int
    name: str
    index: tuple[int, ...]
    tx: tuple[int, ...]
    rx: tuple[int, ...]

    @property
    def rows(self) -> int:
        """Number of TX lines up to the last one with a taxel."""
        return max(self.tx) + 1

    @property
    def columns(self) -> int:
        """Number of RX lines up to the last one with a taxel."""
        return max(self.rx) + 1


@dataclass(frozen=True)
class PlacedBoard:
    """A board in a view: left and upper edge of its block, and its label."""

    board: Board
    label: str
    x: float
    y: float


@dataclass(frozen=True)
class Heading:
    """Heading of a column of boards. x, y: its middle and its lower edge."""

    label: str
    x: float
    y: float


@dataclass(frozen=True)
class View:
    """One picture of the hand. title: empty if it is the only picture."""

    title: str
    width: float
    height: float
    boards: tuple[PlacedBoard, ...]
    headings: tuple[Heading, ...] = ()


def boards_of(report: CheckedReport) -> tuple[Board, ...]:
    """The boards of a report by address; none if the report has no taxel table. Raises GapInputError."""
    if report.taxels is None:
        return ()
    members: dict[int, list[int]] = {}
    addresses, tx, rx = report.taxels
    for index, address in enumerate(addresses):
        members.setdefault(address, []).append(index)
    return tuple(
        Board(
            address,
            report.board_names.get(address, f"board {address}"),
            tuple(indices),
            tuple(tx[index] for index in indices),
            tuple(rx[index] for index in indices),
        )
        for address, indices in sorted(members.items())
    )


def views_of(boards: Sequence[Board]) -> tuple[View, ...]:
    """The pictures of these boards: both sides of the default hand, or one picture with rows of boards."""
    by_name = {board.name: board for board in boards}
    known = {name for _, grid, _ in SIDES for row in grid for name in row if name}
    if not boards or len(by_name) < len(boards) or not by_name.keys() <= known:
        return (_rows(boards),) if boards else ()
    views = (_grid(title, grid, fingers, by_name) for title, grid, fingers in SIDES)
    return tuple(view for view in views if view.boards)


def _grid(title: str, grid: Sequence[Sequence[str]], fingers: Sequence[str], by_name: dict[str, Board]) -> View:
    columns = [[by_name[name] for name in column if name in by_name] for column in zip(*grid, strict=True)]
    widths = [max((board.columns for board in column), default=0) for column in columns]
    left, lefts = EDGE, []
    for width in widths:
        lefts.append(left)
        left += width + GAP_X if width else 0.0
    placed: list[PlacedBoard] = []
    headings: dict[str, Heading] = {}
    top = TITLE + HEADING
    for row in grid:
        boards_of_row = [(column, by_name[name]) for column, name in enumerate(row) if name in by_name]
        if not boards_of_row:
            continue
        tallest = max(board.rows for _, board in boards_of_row)
        top += LABEL
        for column, board in boards_of_row:
            x = lefts[column] + (widths[column] - board.columns) / 2
            y = top + tallest - board.rows
            placed.append(PlacedBoard(board, get_short_name(board.name), x, y))
            if board.name.endswith(f"_{fingers[column]}") and fingers[column] not in headings:
                middle = lefts[column] + widths[column] / 2
                headings[fingers[column]] = Heading(fingers[column], middle, y - LABEL)
        top += tallest + GAP_Y
    return View(title, left - GAP_X + EDGE, top + EDGE - GAP_Y, tuple(placed), tuple(headings.values()))


def _rows(boards: Sequence[Board]) -> View:
    placed: list[PlacedBoard] = []
    row: list[PlacedBoard] = []
    left, top, widest = EDGE, LABEL, 0.0
    for board in boards:
        label = readable(board.name)
        label = label if len(label) <= MAX_NAME else f"{label[: MAX_NAME - 1]}\N{HORIZONTAL ELLIPSIS}"
        width = max(board.columns, LETTER * (len(label) + 6))  # includes space for the board's share after its name
        if row and left + width > ROW_WIDTH:
            top += max(item.board.rows for item in row) + LABEL + GAP_Y
            left, row = EDGE, []
        row.append(PlacedBoard(board, label, left + (width - board.columns) / 2, top))
        placed.append(row[-1])
        left += width + GAP_X
        widest = max(widest, left - GAP_X)
    height = top + max(item.board.rows for item in row) + EDGE
    return View("", widest + EDGE, height, tuple(placed))
