"""A reading on a terminal of a given size: header, heat maps of the boards, table of the boards."""

import math
from collections.abc import Callable, Sequence

import numpy as np

from taxel.hand import Hand
from taxel.monitor.board_layout import BoardLayout, PlacedBoard
from taxel.monitor.canvas import Canvas
from taxel.monitor.colours import INACTIVE_STEPS, STEPS, ColourScale, colour_steps
from taxel.monitor.map_picture import list_layouts, paint_taxels
from taxel.monitor.reading import BoardReading, SkinReading
from taxel.monitor.summary_text import Part, format_errors, format_load, format_rates

HEADER_ROWS = 4
KEYS = "q quit   b baseline again   t table or map"
BAD = "bold red"
DIM = "dim"
ADVICE = "bold yellow"
BANNER = "bold white on red"
LEGEND_WIDTH = 16
TABLE_GAP = 3
_COLUMNS: tuple[tuple[str, int, Callable[[BoardReading], str]], ...] = (
    ("board", -21, lambda b: b.board.name.replace("_", " ")),
    ("addr", 4, lambda b: f"0x{b.board.address:02X}"),
    ("Hz", 5, lambda b: f"{b.rate_hz:.1f}"),
    ("active", 6, lambda b: str(b.active) if b.baseline_progress >= 1.0 else f"{100 * b.baseline_progress:.0f} %"),
    ("signal", 6, lambda b: "-" if math.isnan(b.largest_signal) else f"{b.largest_signal:.0f}"),
    ("missing", 7, lambda b: str(b.missing)),
    ("damaged", 7, lambda b: str(b.damaged)),
    ("bus", 5, lambda b: "-" if b.bus_faults is None else str(b.bus_faults)),
    ("state", -12, lambda b: b.state),
)
"""Heading, width (negative: aligned to the left) and text of each column of the table."""

TABLE_WIDTH = sum(abs(width) for _, width, _ in _COLUMNS) + len(_COLUMNS) - 1


class Screen:
    """Drawer of the readings of one hand as text: header, map of the taxels, table of the boards.

    The attribute `shows_table` selects the table instead of the map on a screen without space for both.
    """

    def __init__(self, hand: Hand, title: str, threshold: float) -> None:
        """Create a drawer. title: text of the first line. threshold: activation threshold, counts."""
        self._hand = hand
        self._title = title
        self._scale = ColourScale(threshold)
        self.shows_table = False

    def draw(self, reading: SkinReading, width: int, height: int, has_colour: bool = True) -> Canvas:
        """Draw a reading of the hand on a new text canvas of `width` x `height` characters.

        If map and table do not fit together, `shows_table` selects the table instead of the map. The table is also
        drawn if there is no space for a map.
        """
        canvas = Canvas(width, height, has_colour)
        top = self._scale.update(reading.largest_signal, reading.watched_s)
        self._draw_header(canvas, reading, top, has_colour)
        table_height = len(self._hand.boards) + 1
        layout, table_corner = _arrange(self._hand, width, height - HEADER_ROWS, table_height)
        if table_corner is None and (self.shows_table or layout is None):
            self._draw_table(canvas, reading, HEADER_ROWS, 0)
            return canvas
        if layout is not None:
            self._draw_map(canvas, reading, layout, top)
        if table_corner is not None:
            self._draw_table(canvas, reading, HEADER_ROWS + table_corner[0], table_corner[1])
        return canvas

    def _draw_header(self, canvas: Canvas, reading: SkinReading, top: float, has_colour: bool) -> None:
        """Draw title, duration, rates, errors, legend and advice. top: end of the colour scale, counts."""
        minutes, seconds = divmod(int(reading.watched_s), 60)
        clock = f" {minutes:02d}:{seconds:02d}"
        column = canvas.write(0, 0, " taxel monitor ", "reverse")
        space = canvas.width - column - len(clock) - 1
        canvas.write(0, column + 1, _truncate(self._title, space), "bold")
        canvas.write(0, canvas.width - len(clock), clock, DIM)
        if reading.no_data_since_s is None:
            _write_parts(canvas, 1, format_rates(reading))
        else:
            banner = "   ".join(text for text, _ in format_rates(reading))
            canvas.write(1, 0, _truncate(f" {banner} ".ljust(canvas.width), canvas.width), BANNER)
        end = _write_parts(canvas, 2, [*format_errors(reading), *format_load(reading)])
        top_text = f" {top:g} counts"
        # 7: the characters "0 " and the threshold between two spaces, such as " 150 ".
        legend_column = canvas.width - len(top_text) - LEGEND_WIDTH - 7
        if has_colour and legend_column > end + 1:
            self._draw_legend(canvas, legend_column, top_text)
        if reading.advice:
            canvas.write(3, 0, _truncate(reading.advice, canvas.width), ADVICE)
        else:
            canvas.write(3, 0, KEYS, DIM)

    def _draw_legend(self, canvas: Canvas, first_column: int, top_text: str) -> None:
        """Draw the colour scale from 0 through the threshold to `top_text`, beginning at a column of line 2.

        The legend is drawn as taxels of all steps. The last argument of `paint`, which marks active taxels, is False
        for all of them, because no step exceeds `STEPS`.
        """
        inactive_width = LEGEND_WIDTH // 4
        bar = np.concatenate(
            [
                np.linspace(0, INACTIVE_STEPS - 1, inactive_width),
                np.linspace(INACTIVE_STEPS, STEPS - 1, LEGEND_WIDTH - inactive_width),
            ]
        ).astype(np.intp)
        inactive, active = np.tile(bar[:inactive_width], (2, 1)), np.tile(bar[inactive_width:], (2, 1))
        threshold = f" {self._scale.threshold:g} "
        column = canvas.write(2, first_column, "0 ", DIM)
        canvas.paint(2, column, inactive, inactive > STEPS)
        column = canvas.write(2, column + inactive_width, threshold, DIM)
        canvas.paint(2, column, active, active > STEPS)
        canvas.write(2, column + LEGEND_WIDTH - inactive_width, top_text, DIM)

    def _draw_map(self, canvas: Canvas, reading: SkinReading, layout: BoardLayout, top: float) -> None:
        """Draw the taxels in the colours of their signals, with headings and labels of the boards.

        top: end of the colour scale, counts.
        """
        steps = colour_steps(reading.signal_counts, self._scale.threshold, top)
        paint_taxels(canvas, self._hand, layout, HEADER_ROWS, steps, reading.active)
        by_address = {board.board.address: board for board in reading.boards}
        for placed in layout.boards:
            self._draw_label(canvas, placed, by_address[placed.board.address])

    def _draw_label(self, canvas: Canvas, placed: PlacedBoard, board: BoardReading) -> None:
        """Draw the label of a board above its taxels; the style shows whether the board is active or faulty."""
        style = "bold green" if board.active else DIM if board.is_streaming else BAD
        canvas.write(HEADER_ROWS + placed.y - 1, placed.label_x, placed.label, style)

    def _draw_table(self, canvas: Canvas, reading: SkinReading, row: int, column: int) -> None:
        """Draw the table of boards with its upper left corner at (row, column)."""
        _write_row(canvas, row, column, [heading for heading, _, _ in _COLUMNS], "bold")
        for number, board in enumerate(reading.boards):
            style = BAD if not board.is_streaming else "bold green" if board.active else ""
            _write_row(canvas, row + 1 + number, column, [text(board) for _, _, text in _COLUMNS], style)


def _arrange(
    hand: Hand, width: int, height: int, table_height: int
) -> tuple[BoardLayout | None, tuple[int, int] | None]:
    """Select the largest layout of the boards that fits on the screen together with the table, and place the table.

    width, height: size of the available space, characters. table_height: number of rows of the table. Returns the
    layout and the upper left corner (row, column) of the table beside or below the layout. If no layout has space for
    the table, the corner is None and the layout is the largest one that fits alone; None if none fits.
    """
    layouts = [layout for layout in list_layouts(hand, width) if layout.width <= width and layout.height <= height]
    for layout in layouts:
        if layout.width + TABLE_GAP + TABLE_WIDTH <= width and table_height <= height:
            return layout, (0, layout.width + TABLE_GAP)
        if layout.height + 1 + table_height <= height and width >= TABLE_WIDTH:
            return layout, (layout.height + 1, 0)
    return (layouts[0] if layouts else None), None


def _write_parts(canvas: Canvas, row: int, parts: Sequence[Part]) -> int:
    """Write the parts of a status line in a row of the canvas, separated by dots, and return the column after the last.

    parts: pairs of a text and a bool, whether the text reports a problem.
    """
    column = 0
    for number, (text, is_bad) in enumerate(parts):
        column = canvas.write(row, column, " · " if number else "", DIM)
        column = canvas.write(row, column, text, BAD if is_bad else "")
    return column


def _write_row(canvas: Canvas, row: int, column: int, texts: Sequence[str], style: str) -> None:
    """Write one row of the table of boards on the canvas, each text padded to the width of its column."""
    for (_, width, _), full_text in zip(_COLUMNS, texts, strict=True):
        text = _truncate(full_text, abs(width))
        canvas.write(row, column, text.ljust(-width) if width < 0 else text.rjust(width), style)
        column += abs(width) + 1


def _truncate(text: str, width: int) -> str:
    """Shorten a string that is longer than `width` characters to this width, with an ellipsis at its end."""
    return text if len(text) <= width else text[: max(0, width - 1)] + "…"
