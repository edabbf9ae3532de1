"""A screen of characters with text and with taxels as half blocks, two taxels in one character."""

from collections.abc import Iterator
from functools import lru_cache
from itertools import pairwise

import numpy as np
from rich.color import Color
from rich.console import Console, ConsoleOptions
from rich.segment import Segment
from rich.style import Style

from taxel.monitor.colours import TABLE, UNKNOWN
from taxel.types import BoolArray, IndexArray

NOTHING = -1
"""Value of a pixel without a taxel."""

_STEP_VALUES = UNKNOWN + 2
_FIRST_PAIR = 1 << 16  # smaller style numbers are indices of text styles
_UPPER, _LOWER, _FULL, _DOT = "▀", "▄", "█", "·"


class Canvas:
    """Text canvas of `height` rows of `width` characters, which the package rich can print; text outside is clipped.

    has_colour: whether taxels are half blocks in the colour of their step. Otherwise an active taxel is a filled half
    block, and other characters with a taxel are dots.
    """

    def __init__(self, width: int, height: int, has_colour: bool = True) -> None:
        """Create an empty text canvas of `height` rows and `width` columns of characters.

        has_colour: whether taxels are half blocks in the colour of their step. Otherwise an active taxel is a filled
        half block, and any other character with a taxel is a dot.
        """
        self.width, self.height = width, height
        self._has_colour = has_colour
        self._glyphs = np.full((height, width), " ", dtype="<U1")
        self._styles = np.zeros((height, width), dtype=np.int64)
        self._style_names: list[str] = [""]  # Style number 0, the initial value of `_styles`, is the default style.

    def write(self, row: int, column: int, text: str, style: str = "") -> int:
        """Write text at a row and column of the canvas in a style of the package rich; return the column after it.

        Text outside the canvas is clipped.
        """
        end = column + len(text)
        if 0 <= row < self.height and column < self.width and text:
            if style not in self._style_names:
                self._style_names.append(style)
            visible = text[max(0, -column) : self.width - column]
            columns = slice(max(0, column), max(0, column) + len(visible))
            self._glyphs[row, columns] = list(visible)
            self._styles[row, columns] = self._style_names.index(style)
        return end

    def paint(self, row: int, column: int, steps: IndexArray, active: BoolArray) -> None:
        """Draw a picture of taxels with its upper left corner at (row, column) of the canvas.

        steps: int[2 * k, w], for each pixel a row of the colour table `TABLE`, or NOTHING; two rows of pixels fill one
        row of characters. active: bool[2 * k, w], active taxels, drawn differently on a canvas without colour.
        """
        height, width = steps.shape[0] // 2, steps.shape[1]
        height, width = min(height, self.height - row), min(width, self.width - column)
        if height <= 0 or width <= 0:
            return
        upper, lower = steps[: 2 * height : 2, :width], steps[1 : 2 * height : 2, :width]
        has_upper, has_lower = upper != NOTHING, lower != NOTHING
        if self._has_colour:
            glyphs = np.where(has_upper, _UPPER, _LOWER)
            # One style number for each pair of steps; `_get_style` splits it again. NOTHING is -1, so 1 is added.
            numbers = _FIRST_PAIR + (upper + 1) * _STEP_VALUES + lower + 1
        else:
            active_upper, active_lower = active[: 2 * height : 2, :width], active[1 : 2 * height : 2, :width]
            glyphs = np.where(active_upper, np.where(active_lower, _FULL, _UPPER), np.where(active_lower, _LOWER, _DOT))
            numbers = np.zeros_like(upper)
        has_taxel = has_upper | has_lower
        self._glyphs[row : row + height, column : column + width][has_taxel] = glyphs[has_taxel]
        self._styles[row : row + height, column : column + width][has_taxel] = numbers[has_taxel]

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> Iterator[Segment]:
        """Yield the canvas row by row, as segments of one style each, to the package rich, which prints them."""
        for number, (glyphs, styles) in enumerate(zip(self._glyphs, self._styles, strict=True)):
            borders = [0, *(np.flatnonzero(np.diff(styles)) + 1).tolist(), self.width]
            text = "".join(glyphs.tolist())
            for start, end in pairwise(borders):
                yield Segment(text[start:end], self._get_style(int(styles[start])))
            if number < self.height - 1:
                yield Segment.line()

    def _get_style(self, number: int) -> Style:
        """Return the rich style of a style number of the canvas: a text style, or the colours of two half blocks."""
        if number < _FIRST_PAIR:
            return _parse_style(self._style_names[number])
        upper, lower = divmod(number - _FIRST_PAIR, _STEP_VALUES)
        return _make_pair_style(upper - 1, lower - 1)


@lru_cache(maxsize=256)
def _parse_style(style: str) -> Style:
    """Parse a style of the package rich, such as "bold green"; the result is cached."""
    return Style.parse(style)


@lru_cache(maxsize=4096)
def _make_pair_style(upper: int, lower: int) -> Style:
    """Return the style of a character that shows two taxels, one above the other, as half blocks.

    upper, lower: rows of the colour table `TABLE`, or NOTHING. The character is `▀` with the upper taxel as foreground
    colour, or `▄` if there is no upper taxel.
    """
    if upper == NOTHING:
        return Style(color=_colour(lower))
    return Style(color=_colour(upper), bgcolor=None if lower == NOTHING else _colour(lower))


def _colour(step: int) -> Color:
    """Return the terminal colour of a row of the colour table `TABLE`."""
    red, green, blue = (int(value) for value in TABLE[step])
    return Color.from_rgb(red, green, blue)
