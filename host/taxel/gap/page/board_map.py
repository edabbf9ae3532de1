"""Positions of the boards in the picture of the unrolled hand. The unit of length is one taxel pitch of the picture.

A board is drawn by the layout of its kind: the places of its taxels on the unrolled sheet, seen from outside with the
distal end on top. Without a layout, TX lines are rows (TX 0 on top) and RX lines are columns (RX 0 on the left). The
boards of the default hand are arranged like a right hand, with its palm side and its back; the boards of other hands
are arranged in rows.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from taxel.gap.page.board_places import find_places
from taxel.gap.page.locations import format_board
from taxel.gap.page.text import make_readable
from taxel.gap.report.checked_report import CheckedReport
from taxel.hand.unrolled_layout import SIDES, get_short_name

# Lengths in taxel pitches of the picture, chosen such that labels do not overlap.
LABEL = 3.1  # height above each board for its name and the marks of its RX lines
HEADING = 2.6  # height above each column for the name of its finger
TITLE = 2.0  # height of the title
GAP_X = 2.4  # between boards side by side
GAP_Y = 0.6  # between boards one above the other, in addition to LABEL
EDGE = 1.0  # margin of a view
ROW_WIDTH = 46.0  # largest width of a row of boards
LETTER = 0.8  # mean width of a letter of a label
MAX_NAME = 18  # characters


@dataclass(frozen=True)
class Board:
    """A board in the picture. The other fields have one value for each of its taxels: index in the report, TX line, RX
    line, and row and column on the unrolled sheet.
    """

    address: int
    name: str
    index: tuple[int, ...]
    tx: tuple[int, ...]
    rx: tuple[int, ...]
    row: tuple[int, ...]
    column: tuple[int, ...]

    @property
    def rows(self) -> int:
        """Number of rows up to the last one with a taxel."""
        return max(self.row) + 1

    @property
    def columns(self) -> int:
        """Number of columns up to the last one with a taxel."""
        return max(self.column) + 1


@dataclass(frozen=True)
class PlacedBoard:
    """A board in a view. x, y: upper left corner of its taxels, taxel pitches. label: its name as shown."""

    board: Board
    label: str
    x: float
    y: float


@dataclass(frozen=True)
class Heading:
    """Heading of a column of boards. x: its middle. y: its base line. Both in taxel pitches."""

    label: str
    x: float
    y: float


@dataclass(frozen=True)
class View:
    """One picture of the hand, such as its palm side. title: empty if it is the only picture. width, height: taxel
    pitches.
    """

    title: str
    width: float
    height: float
    boards: tuple[PlacedBoard, ...]
    headings: tuple[Heading, ...] = ()


def list_boards(report: CheckedReport) -> tuple[Board, ...]:
    """Return the boards of a report, sorted by address; empty if the report has no taxel table. Raises GapInputError
    for a malformed field.
    """
    if report.taxels is None:
        return ()
    members: dict[int, list[int]] = {}
    addresses, tx, rx = report.taxels
    for index, address in enumerate(addresses):
        members.setdefault(address, []).append(index)
    boards = []
    for address, indices in sorted(members.items()):
        own_tx, own_rx = (tuple(axis[index] for index in indices) for axis in (tx, rx))
        row, column = find_places(report.board_kinds.get(address, ""), own_tx, own_rx)
        name = report.board_names.get(address) or format_board(report, address)
        boards.append(Board(address, name, tuple(indices), own_tx, own_rx, row, column))
    return tuple(boards)


def arrange_views(boards: Sequence[Board]) -> tuple[View, ...]:
    """Return the pictures of these boards: both sides of the default hand, or one picture with rows of boards for any
    other hand. Empty without boards.
    """
    by_name = {board.name: board for board in boards}
    hand_boards = {name for _, grid, _ in SIDES for row in grid for name in row if name}
    if not boards or len(by_name) < len(boards) or not by_name.keys() <= hand_boards:
        return (_arrange_in_rows(boards),) if boards else ()
    views = (_arrange_as_hand(title, grid, fingers, by_name) for title, grid, fingers in SIDES)
    return tuple(view for view in views if view.boards)


def _arrange_as_hand(
    title: str, grid: Sequence[Sequence[str]], fingers: Sequence[str], by_name: dict[str, Board]
) -> View:
    """Return the picture of one side of the default hand.

    grid: names of the boards by row and column, "" for an empty place. fingers: names of the columns. by_name: the
    boards of the report. The boards of a column are centred, and those of a row have a common lower edge. All lengths
    are in taxel pitches.
    """
    columns = [[by_name[name] for name in column if name in by_name] for column in zip(*grid, strict=True)]
    widths = [max((board.columns for board in column), default=0) for column in columns]
    right_edge, x_of_columns = EDGE, []
    for width in widths:
        x_of_columns.append(right_edge)
        right_edge += width + GAP_X if width else 0.0
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
            x = x_of_columns[column] + (widths[column] - board.columns) / 2
            y = top + tallest - board.rows
            placed.append(PlacedBoard(board, get_short_name(board.name), x, y))
            if board.name.endswith(f"_{fingers[column]}") and fingers[column] not in headings:
                middle = x_of_columns[column] + widths[column] / 2
                headings[fingers[column]] = Heading(fingers[column], middle, y - LABEL)
        top += tallest + GAP_Y
    return View(title, right_edge - GAP_X + EDGE, top + EDGE - GAP_Y, tuple(placed), tuple(headings.values()))


def _arrange_in_rows(boards: Sequence[Board]) -> View:
    """Return a picture with the boards side by side, in rows of at most `ROW_WIDTH` taxel pitches."""
    placed: list[PlacedBoard] = []
    row: list[PlacedBoard] = []
    x, top, right_edge = EDGE, LABEL, 0.0
    for board in boards:
        label = make_readable(board.name)
        label = label if len(label) <= MAX_NAME else f"{label[: MAX_NAME - 1]}\N{HORIZONTAL ELLIPSIS}"
        width = max(board.columns, LETTER * (len(label) + 6))  # includes space for the board's share after its name
        if row and x + width > ROW_WIDTH:
            top += max(item.board.rows for item in row) + LABEL + GAP_Y
            x, row = EDGE, []
        row.append(PlacedBoard(board, label, x + (width - board.columns) / 2, top))
        placed.append(row[-1])
        x += width + GAP_X
        right_edge = max(right_edge, x - GAP_X)
    height = top + max(item.board.rows for item in row) + EDGE
    return View("", right_edge + EDGE, height, tuple(placed))
