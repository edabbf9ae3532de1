"""A reading on a terminal of a given size: header, boards as heat maps, a table of boards."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np

from taxel.hand import Hand
from taxel.monitor.canvas import NOTHING, Canvas
from taxel.monitor.colours import QUIET_STEPS, STEPS, Scale, steps_of
from taxel.monitor.header import Part, errors, figures, load
from taxel.monitor.placing import Placed, Placing, in_rows, unrolled
from taxel.monitor.reading import BoardReading, SkinReading

HEADER = 4
KEYS = "q quit   b baseline again   t table or map"
BAD = "bold red"
DIM = "dim"
WORST = "bold yellow"
LEGEND_BAR = 16
TABLE_GAP = 3
_COLUMNS: tuple[tuple[str, int, Callable[[BoardReading], str]], ...] = (
    ("board", -21, lambda b: b.board.name.replace("_", " ")),
    ("addr", 4, lambda b: f"0x{b.board.address:02X}"),
    ("Hz", 5, lambda b: f"{b.rate_hz:.1f}"),
    ("active", 6, lambda b: str(b.active) if b.baseline >= 1.0 else f"{100 * b.baseline:.0f} %"),
    ("signal", 6, lambda b: "-" if math.isnan(b.largest_signal) else f"{b.largest_signal:.0f}"),
    ("missing", 7, lambda b: str(b.missing)),
    ("damaged", 7, lambda b: str(b.damaged)),
    ("bus", 5, lambda b: "-" if b.bus_faults is None else str(b.bus_faults)),
    ("state", -12, lambda b: b.state),
)
"""Heading, width (negative: to the left) and words of each column of the table."""

TABLE_WIDTH = sum(abs(width) for _, width, _ in _COLUMNS) + len(_COLUMNS) - 1


class Screen:
    """Draws readings of one hand; `title` is what the first line names. `shows_table`: the table instead of the map,
    where there is no room for both.
    """

    def __init__(self, hand: Hand, title: str, threshold: float) -> None:
        self._hand = hand
        self._title = title
        self._scale = Scale(threshold)
        self.shows_table = False

    def draw(self, reading: SkinReading, width: int, height: int, has_colour: bool = True) -> Canvas:
        """The screen, `width` x `height` characters."""
        canvas = Canvas(width, height, has_colour)
        top = self._scale.update(reading.largest_signal, reading.watched_s)
        self._head(canvas, reading, top, has_colour)
        table_height = len(self._hand.boards) + 1
        placing, place = _arrange(self._hand, width, height - HEADER, table_height)
        if place is None and (self.shows_table or placing is None):
            self._table(canvas, reading, HEADER, 0)
            return canvas
        if placing is not None:
            self._map(canvas, reading, placing, top)
        if place is not None:
            self._table(canvas, reading, HEADER + place[0], place[1])
        return canvas

    def _head(self, canvas: Canvas, reading: SkinReading, top: float, has_colour: bool) -> None:
        minutes, seconds = divmod(int(reading.watched_s), 60)
        clock = f" {minutes:02d}:{seconds:02d}"
        column = canvas.write(0, 0, " taxel monitor ", "reverse")
        room = canvas.width - column - len(clock) - 1
        canvas.write(0, column + 1, _cut(self._title, room), "bold")
        canvas.write(0, canvas.width - len(clock), clock, DIM)
        _parts(canvas, 1, figures(reading))
        end = _parts(canvas, 2, [*errors(reading), *load(reading)])
        words = f" {top:g} counts"
        left = canvas.width - len(words) - LEGEND_BAR - 7
        if has_colour and left > end + 1:
            self._legend(canvas, left, words)
        if reading.advice:
            canvas.write(3, 0, _cut(reading.advice, canvas.width), WORST)
        else:
            canvas.write(3, 0, KEYS, DIM)

    def _legend(self, canvas: Canvas, left: int, words: str) -> None:
        quiet = LEGEND_BAR // 4
        bar = np.concatenate(
            [np.linspace(0, QUIET_STEPS - 1, quiet), np.linspace(QUIET_STEPS, STEPS - 1, LEGEND_BAR - quiet)]
        ).astype(np.intp)
        inactive, active = np.tile(bar[:quiet], (2, 1)), np.tile(bar[quiet:], (2, 1))
        threshold = f" {self._scale.threshold:g} "
        column = canvas.write(2, left, "0 ", DIM)
        canvas.paint(2, column, inactive, inactive > STEPS)
        column = canvas.write(2, column + quiet, threshold, DIM)
        canvas.paint(2, column, active, active > STEPS)
        canvas.write(2, column + LEGEND_BAR - quiet, words, DIM)

    def _map(self, canvas: Canvas, reading: SkinReading, placing: Placing, top: float) -> None:
        steps = steps_of(reading.signal_counts, self._scale.threshold, top)
        scale, rows, columns = placing.scale, *_cells(self._hand, placing)
        picture = np.full((2 * placing.height, placing.width), NOTHING, dtype=np.intp)
        active = np.zeros_like(picture, dtype=bool)
        for down in range(scale):
            for right in range(scale):
                picture[rows + down, columns + right] = steps
                active[rows + down, columns + right] = reading.active
        canvas.paint(HEADER, 0, picture, active)
        for words in placing.words:
            canvas.write(HEADER + words.y, words.x, words.text, "bold")
        by_address = {board.board.address: board for board in reading.boards}
        for placed in placing.boards:
            self._label(canvas, placed, by_address[placed.board.address])

    def _label(self, canvas: Canvas, placed: Placed, board: BoardReading) -> None:
        style = "bold green" if board.active else DIM if board.is_well else BAD
        canvas.write(HEADER + placed.y - 1, placed.label_x, placed.label, style)

    def _table(self, canvas: Canvas, reading: SkinReading, row: int, column: int) -> None:
        _row(canvas, row, column, [heading for heading, _, _ in _COLUMNS], "bold")
        for number, board in enumerate(reading.boards):
            style = BAD if not board.is_well else "bold green" if board.active else ""
            _row(canvas, row + 1 + number, column, [words(board) for _, _, words in _COLUMNS], style)


def _arrange(hand: Hand, width: int, height: int, table_height: int) -> tuple[Placing | None, tuple[int, int] | None]:
    """The largest picture that fits, and where the table goes beside or below it (row, column), if it has room."""
    pictures = [picture for picture in _pictures(hand, width) if picture.width <= width and picture.height <= height]
    for picture in pictures:
        if picture.width + TABLE_GAP + TABLE_WIDTH <= width and table_height <= height:
            return picture, (0, picture.width + TABLE_GAP)
        if picture.height + 1 + table_height <= height and width >= TABLE_WIDTH:
            return picture, (picture.height + 1, 0)
    return (pictures[0] if pictures else None), None


@lru_cache(maxsize=8)
def _pictures(hand: Hand, width: int) -> Sequence[Placing]:
    """Pictures of a hand, the best first."""
    found = [unrolled(hand, 2), unrolled(hand, 1)]
    placings = [placing for placing in found if placing is not None]
    if not placings:
        placings.append(in_rows(hand, width, 2))
    return (*placings, in_rows(hand, width, 1))


@lru_cache(maxsize=8)
def _cells(hand: Hand, placing: Placing) -> tuple[np.ndarray, np.ndarray]:
    """Row (in half characters) and column of each taxel's left upper cell, [n] each."""
    rows = np.zeros(hand.n_taxels, dtype=np.intp)
    columns = np.zeros(hand.n_taxels, dtype=np.intp)
    for placed in placing.boards:
        kind, where = placed.board.kind, hand.get_slice(placed.board.address)
        spare = (kind.tx_count * placing.scale) % 2  # an odd number of lines stands on the bottom of its block
        rows[where] = 2 * placed.y + spare + placing.scale * kind.tx.astype(np.intp)
        columns[where] = placed.x + placing.scale * kind.rx.astype(np.intp)
    return rows, columns


def _parts(canvas: Canvas, row: int, parts: Sequence[Part]) -> int:
    column = 0
    for number, (text, is_bad) in enumerate(parts):
        column = canvas.write(row, column, " · " if number else "", DIM)
        column = canvas.write(row, column, text, BAD if is_bad else "")
    return column


def _row(canvas: Canvas, row: int, column: int, cells: Sequence[str], style: str) -> None:
    for (_, width, _), cell in zip(_COLUMNS, cells, strict=True):
        text = _cut(cell, abs(width))
        canvas.write(row, column, text.ljust(-width) if width < 0 else text.rjust(width), style)
        column += abs(width) + 1


def _cut(text: str, width: int) -> str:
    return text if len(text) <= width else text[: max(0, width - 1)] + "…"
