"""Positions of the boards on a terminal. Lengths are in characters; a taxel is `scale` wide and half as high."""

from collections.abc import Sequence
from dataclasses import dataclass

from taxel.hand import Board, Hand
from taxel.hand.unrolled_layout import BACK, FINGERS, PALM_SIDE, get_short_name

GAP = 2
SIDE_GAP = 4
_SPECIAL_LABELS = {"back_of_hand": "back of hand", "fingertip_thumb": "tip thumb"}
_SHORT_PREFIXES = (
    ("fingertip_", "tip "),
    ("proximal_front_", "proxF "),
    ("proximal_back_", "proxB "),
    ("medial_front_", "medF "),
    ("medial_back_", "medB "),
)
_TIPS_AND_HAND = (*PALM_SIDE[0], "fingertip_thumb", "palm", "back_of_hand")
LONGEST_LABEL = 12


@dataclass(frozen=True)
class PlacedBoard:
    """A board at its position on the screen, in characters.

    (x, y): upper left corner of the board's picture. label_x: start of the label in the row above the picture.
    """

    board: Board
    label: str
    x: int
    y: int
    label_x: int


@dataclass(frozen=True)
class Heading:
    """A heading above several boards on the screen; (x, y): position in characters."""

    text: str
    x: int
    y: int


@dataclass(frozen=True)
class BoardLayout:
    """Layout of the boards of a hand on the screen: size in characters, boards and headings.

    scale: width of a taxel in characters.
    """

    width: int
    height: int
    scale: int
    boards: tuple[PlacedBoard, ...]
    headings: tuple[Heading, ...] = ()


def _compute_block_height(board: Board, scale: int) -> int:
    """Compute the height of the picture of a board in characters, rounded up: two pixels fill one character.

    scale: width and height of a taxel in pixels.
    """
    return -(-board.kind.layout_shape[0] * scale // 2)


def layout_unrolled(hand: Hand, scale: int = 1) -> BoardLayout | None:
    """Place the palm side and the back of the default hand next to each other, each as seen from outside.

    The columns of the palm side are followed, after a wider gap, by those of the back. The boards of a row are aligned
    at the bottom. The topmost board of each finger has the name of the finger as heading. scale: width of a taxel in
    characters; a taxel is half as high. Returns None for a hand with other boards.
    """
    by_name = {board.name: board for board in hand.boards}
    # The back has no fingertips, so that its rows begin one row lower.
    rows = [(*palm, *back) for palm, back in zip(PALM_SIDE, (("", "", ""), *BACK), strict=True)]
    if not by_name.keys() <= {name for row in rows for name in row}:
        return None
    columns = [[by_name[name] for name in column if name in by_name] for column in zip(*rows, strict=True)]
    widths = [max((scale * board.kind.layout_shape[1] for board in column), default=0) for column in columns]
    fingers = (*FINGERS, *FINGERS[::-1])
    column_starts: list[int] = []
    start = 0
    for number, width in enumerate(widths):  # a wider gap is before the first column of the back
        start += SIDE_GAP - GAP if number == len(FINGERS) else 0
        column_starts.append(start)
        start += width + GAP
    headings: list[Heading] = []
    headed_columns: set[int] = set()
    placed: list[PlacedBoard] = []
    top = 1
    for row in rows:
        boards = [(column, by_name[name]) for column, name in enumerate(row) if name in by_name]
        if not boards:
            continue
        tallest = max(_compute_block_height(board, scale) for _, board in boards)
        for column, board in boards:
            x = column_starts[column] + (widths[column] - scale * board.kind.layout_shape[1]) // 2
            y = top + 1 + tallest - _compute_block_height(board, scale)
            label = get_short_name(board.name)
            placed.append(
                PlacedBoard(board, label, x, y, column_starts[column] + _compute_centre_offset(label, widths[column]))
            )
            # The label is in the row above the picture (y - 1), and the heading in the row above the label.
            finger = fingers[column]
            if column not in headed_columns and board.name.endswith(finger):
                headed_columns.add(column)
                headings.append(
                    Heading(finger, column_starts[column] + _compute_centre_offset(finger, widths[column]), y - 2)
                )
        top += tallest + 1
    if any(name in by_name for row in BACK for name in row):
        headings.append(Heading("back of the hand", column_starts[len(FINGERS)], 0))
    return BoardLayout(start - GAP, top, scale, tuple(placed), tuple(headings))


def layout_rows(hand: Hand, width: int, scale: int = 1) -> BoardLayout:
    """Place the boards of any hand in rows of at most `width` characters, each board under its name.

    scale: width of a taxel in characters; a taxel is half as high.
    """
    rows = _split_rows(hand, width, scale)
    placed: list[PlacedBoard] = []
    top = widest = 0
    for row in rows:
        tallest = max(_compute_block_height(board, scale) for board in row)
        start = 0
        for board in row:
            label = _shorten_name(board.name)
            block = scale * board.kind.layout_shape[1]
            column = max(block, len(label))
            y = top + 1 + tallest - _compute_block_height(board, scale)
            x = start + (column - block) // 2
            placed.append(PlacedBoard(board, label, x, y, start + _compute_centre_offset(label, column)))
            start += column + 1
        widest = max(widest, start - 1)
        top += tallest + 1
    return BoardLayout(widest, top, scale, tuple(placed))


def _split_rows(hand: Hand, width: int, scale: int) -> list[list[Board]]:
    """Divide the boards of a hand into rows of at most `width` characters; boards of another height start a new row.

    scale: width of a taxel in characters.
    """
    rows: list[list[Board]] = []
    used = 0
    for group in _group_by_height(hand.boards):
        for number, board in enumerate(group):
            column = max(scale * board.kind.layout_shape[1], len(_shorten_name(board.name)))
            if number == 0 or used + 1 + column > width:
                rows.append([])
                used = 0
            used += column + (1 if rows[-1] else 0)
            rows[-1].append(board)
    return rows


def _group_by_height(boards: Sequence[Board]) -> list[list[Board]]:
    """Group boards of similar height, so that a row of boards has little empty space.

    The boards of the default hand form three groups: fingertips with palm and back of the hand, proximal boards, and
    medial boards. All boards of other hands form one group.
    """
    prefixes = tuple(prefix for prefix, _ in _SHORT_PREFIXES)
    groups: dict[str, list[Board]] = {}
    for board in boards:
        part = board.name.split("_", 1)[0]
        is_default_name = board.name in (*_SPECIAL_LABELS, "palm") or board.name.startswith(prefixes)
        key = "plates" if board.name in _TIPS_AND_HAND else part if is_default_name else ""
        groups.setdefault(key, []).append(board)
    if "plates" in groups:
        groups["plates"].sort(key=lambda board: _TIPS_AND_HAND.index(board.name))
    return list(groups.values())


def _shorten_name(name: str) -> str:
    """Return the label of a board: with an abbreviated prefix, or cut to `LONGEST_LABEL` characters for other names."""
    label = _SPECIAL_LABELS.get(name, name.replace("_", " "))
    for prefix, short in _SHORT_PREFIXES:
        if name.startswith(prefix):
            label = short + name.removeprefix(prefix)
    return label if len(label) <= LONGEST_LABEL else label[: LONGEST_LABEL - 1] + "…"


def _compute_centre_offset(text: str, width: int) -> int:
    """Compute the number of characters before a string that is centred in `width` characters."""
    return max(0, (width - len(text)) // 2)
