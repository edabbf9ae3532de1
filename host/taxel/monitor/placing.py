"""Where each board stands on a terminal. Lengths are in characters; a taxel is `scale` wide and half as high."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from taxel.hand import Board, Hand
from taxel.hand.unrolled_layout import BACK, FINGERS, PALM_SIDE, get_short_name

GAP = 2
SIDE_GAP = 4
_NAMES = {"back_of_hand": "back of hand", "fingertip_thumb": "tip thumb"}
_SHORT = (
    ("fingertip_", "tip "),
    ("proximal_front_", "proxF "),
    ("proximal_back_", "proxB "),
    ("medial_front_", "medF "),
    ("medial_back_", "medB "),
)
_TIPS_AND_HAND = (*PALM_SIDE[0], "fingertip_thumb", "palm", "back_of_hand")
LONGEST_NAME = 12


@dataclass(frozen=True)
class Placed:
    """A board: the left upper corner of its block, and where its `label` begins in the row above."""

    board: Board
    label: str
    x: int
    y: int
    label_x: int


@dataclass(frozen=True)
class Words:
    """Words on the picture that belong to no board."""

    text: str
    x: int
    y: int


@dataclass(frozen=True)
class Placing:
    """A picture: its size, its boards, its headings; `scale`: characters that a taxel is wide."""

    width: int
    height: int
    scale: int
    boards: tuple[Placed, ...]
    words: tuple[Words, ...] = ()


def _height(board: Board, scale: int) -> int:
    """Characters that the block of a board is high."""
    return -(-board.kind.tx_count * scale // 2)


def unrolled(hand: Hand, scale: int = 1) -> Placing | None:
    """Both sides of the default hand beside each other, as a viewer sees them; None for any other hand."""
    by_name = {board.name: board for board in hand.boards}
    rows = [(*palm, *back) for palm, back in zip(PALM_SIDE, (("", "", ""), *BACK), strict=True)]
    if not by_name.keys() <= {name for row in rows for name in row}:
        return None
    columns = [[by_name[name] for name in column if name in by_name] for column in zip(*rows, strict=True)]
    widths = [max((scale * board.kind.rx_count for board in column), default=0) for column in columns]
    fingers = (*FINGERS, *FINGERS[::-1])
    lefts: list[int] = []
    left = 0
    for number, width in enumerate(widths):
        left += SIDE_GAP - GAP if number == len(FINGERS) else 0
        lefts.append(left)
        left += width + GAP
    words: list[Words] = []
    named: set[int] = set()
    placed: list[Placed] = []
    top = 1
    for row in rows:
        here = [(column, by_name[name]) for column, name in enumerate(row) if name in by_name]
        if not here:
            continue
        tallest = max(_height(board, scale) for _, board in here)
        for column, board in here:
            x = lefts[column] + (widths[column] - scale * board.kind.rx_count) // 2
            y = top + 1 + tallest - _height(board, scale)
            label = get_short_name(board.name)
            placed.append(Placed(board, label, x, y, lefts[column] + _centred(label, widths[column])))
            if column not in named and board.name.endswith(fingers[column]):
                named.add(column)
                words.append(Words(fingers[column], lefts[column] + _centred(fingers[column], widths[column]), y - 2))
        top += tallest + 1
    if any(name in by_name for row in BACK for name in row):
        words.append(Words("back of the hand", lefts[len(FINGERS)], 0))
    return Placing(left - GAP, top, scale, tuple(placed), tuple(words))


def in_rows(hand: Hand, width: int, scale: int = 1) -> Placing:
    """Boards in rows, like heights together, each under its name; for small terminals and any hand."""
    placed: list[Placed] = []
    row: list[Board] = []
    top = widest = 0

    def finish() -> None:
        nonlocal top, widest
        tallest = max(_height(board, scale) for board in row)
        left = 0
        for board in row:
            label = _label(board.name)
            block = scale * board.kind.rx_count
            cell = max(block, len(label))
            y = top + 1 + tallest - _height(board, scale)
            placed.append(Placed(board, label, left + (cell - block) // 2, y, left + _centred(label, cell)))
            left += cell + 1
        widest = max(widest, left - 1)
        top += tallest + 1
        row.clear()

    used = 0
    for group in _groups(hand.boards):
        for number, board in enumerate(group):
            cell = max(scale * board.kind.rx_count, len(_label(board.name)))
            if row and (number == 0 or used + 1 + cell > width):
                finish()
                used = 0
            used += cell + (1 if row else 0)
            row.append(board)
    if row:
        finish()
    return Placing(widest, top, scale, tuple(placed))


def _groups(boards: Sequence[Board]) -> list[list[Board]]:
    """The default hand's tips and plates, proximal and medial boards; the boards of another hand all together."""
    known = dict(_SHORT)
    groups: dict[str, list[Board]] = {}
    for board in boards:
        part = board.name.split("_", 1)[0]
        is_known = board.name in _NAMES or board.name == "palm" or any(board.name.startswith(name) for name in known)
        key = "plates" if board.name in _TIPS_AND_HAND else part if is_known else ""
        groups.setdefault(key, []).append(board)
    if "plates" in groups:
        groups["plates"].sort(key=lambda board: _TIPS_AND_HAND.index(board.name))
    return list(groups.values())


def _label(name: str) -> str:
    for long, short in _SHORT:
        if name.startswith(long):
            return name.replace(long, short)
    words = _NAMES.get(name, name.replace("_", " "))
    return words if len(words) <= LONGEST_NAME else words[: LONGEST_NAME - 1] + "…"


def _centred(text: str, width: int) -> int:
    return max(0, (width - len(text)) // 2)
