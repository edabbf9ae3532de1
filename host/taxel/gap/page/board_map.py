"""Where each board stands in the picture of the unrolled hand. Lengths are in cells: one taxel pitch on the picture.

A board is the rectangle of its TX lines (rows, TX 0 on top) and RX lines (columns, RX 0 on the left), seen from outside
with the distal end on top, as the hand descriptions have it. The boards of the default hand are laid out like a right
hand, its palm side and its back; any others stand in rows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from taxel.gap.page.report import Report
from taxel.hand.unrolled_layout import SIDES, get_short_name

LABEL = 3.1  # above each board: its name, and the marks of its RX lines
HEADING = 2.6  # above each column: its finger
TITLE = 2.0  # above all
GAP_X = 2.4
GAP_Y = 0.6
EDGE = 1.0
ROW_WIDTH = 46.0
LETTER = 0.8  # mean width of a letter of a board's label
LONGEST_NAME = 18


@dataclass(frozen=True)
class Board:
    """A board: its address, its name, and of each of its taxels the index in the report and the TX and RX line."""

    address: int
    name: str
    index: tuple[int, ...]
    tx: tuple[int, ...]
    rx: tuple[int, ...]

    @property
    def rows(self) -> int:
        """Number of TX lines, as far as taxels show."""
        return max(self.tx) + 1

    @property
    def columns(self) -> int:
        """Number of RX lines, as far as taxels show."""
        return max(self.rx) + 1


@dataclass(frozen=True)
class Placed:
    """A board in a view: the left and upper edge of its block, and the words over it."""

    board: Board
    label: str
    x: float
    y: float


@dataclass(frozen=True)
class Heading:
    """Words over a column of boards: their middle and their lower edge."""

    label: str
    x: float
    y: float


@dataclass(frozen=True)
class View:
    """One picture: its title (empty if it is the only one), its size, its boards, and the headings of its columns."""

    title: str
    width: float
    height: float
    boards: tuple[Placed, ...]
    headings: tuple[Heading, ...] = ()


def boards_of(report: Report) -> tuple[Board, ...]:
    """The boards of a report that says where its taxels are, by address; none otherwise. Raises GapInputError."""
    if report.taxels is None:
        return ()
    members: dict[int, list[int]] = {}
    addresses, tx, rx = report.taxels
    for index, address in enumerate(addresses):
        members.setdefault(address, []).append(index)
    return tuple(
        Board(
            address,
            report.names.get(address, f"board {address}"),
            tuple(own),
            tuple(tx[index] for index in own),
            tuple(rx[index] for index in own),
        )
        for address, own in sorted(members.items())
    )


def views_of(boards: Sequence[Board]) -> tuple[View, ...]:
    """The pictures of these boards: both sides of the default hand, or one of rows."""
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
    placed: list[Placed] = []
    headings: dict[str, Heading] = {}
    top = TITLE + HEADING
    for row in grid:
        here = [(column, by_name[name]) for column, name in enumerate(row) if name in by_name]
        if not here:
            continue
        tallest = max(board.rows for _, board in here)
        top += LABEL
        for column, board in here:
            x = lefts[column] + (widths[column] - board.columns) / 2
            y = top + tallest - board.rows
            placed.append(Placed(board, get_short_name(board.name), x, y))
            if board.name.endswith(f"_{fingers[column]}") and fingers[column] not in headings:
                middle = lefts[column] + widths[column] / 2
                headings[fingers[column]] = Heading(fingers[column], middle, y - LABEL)
        top += tallest + GAP_Y
    return View(title, left - GAP_X + EDGE, top + EDGE - GAP_Y, tuple(placed), tuple(headings.values()))


def _rows(boards: Sequence[Board]) -> View:
    placed: list[Placed] = []
    row: list[Placed] = []
    left, top, widest = EDGE, LABEL, 0.0
    for board in boards:
        label = board.name.replace("_", " ")
        label = label if len(label) <= LONGEST_NAME else f"{label[: LONGEST_NAME - 1]}\N{HORIZONTAL ELLIPSIS}"
        width = max(board.columns, LETTER * (len(label) + 6))  # room for the board's share beside its name
        if row and left + width > ROW_WIDTH:
            top += max(item.board.rows for item in row) + LABEL + GAP_Y
            left, row = EDGE, []
        row.append(Placed(board, label, left + (width - board.columns) / 2, top))
        placed.append(row[-1])
        left += width + GAP_X
        widest = max(widest, left - GAP_X)
    height = top + max(item.board.rows for item in row) + EDGE
    return View("", widest + EDGE, height, tuple(placed))
