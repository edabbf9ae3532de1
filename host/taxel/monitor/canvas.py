"""A screen of characters: text, and taxels as half blocks, two a character."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from rich.color import Color
from rich.console import Console, ConsoleOptions
from rich.segment import Segment
from rich.style import Style

from taxel.monitor.colours import TABLE, UNKNOWN

NOTHING = -1
"""In a picture: there is no taxel here."""

_KINDS = UNKNOWN + 2
_FIRST_PAIR = 1 << 16  # style numbers below are those of texts
_UPPER, _LOWER, _FULL, _DOT = "▀", "▄", "█", "·"


class Canvas:
    """`height` rows of `width` characters; what does not fit is cut off. A rich renderable.

    `has_colour` False: an active taxel is a filled half block, any other character with a taxel is a dot.
    """

    def __init__(self, width: int, height: int, has_colour: bool = True) -> None:
        self.width, self.height = width, height
        self._has_colour = has_colour
        self._glyphs = np.full((height, width), " ", dtype="<U1")
        self._styles = np.zeros((height, width), dtype=np.int64)
        self._names: list[str] = [""]

    def write(self, row: int, column: int, text: str, style: str = "") -> int:
        """Put text, with a rich style; returns the column after it."""
        end = column + len(text)
        if 0 <= row < self.height and column < self.width and text:
            if style not in self._names:
                self._names.append(style)
            part = text[max(0, -column) : self.width - column]
            where = slice(max(0, column), max(0, column) + len(part))
            self._glyphs[row, where] = list(part)
            self._styles[row, where] = self._names.index(style)
        return end

    def paint(self, row: int, column: int, steps: NDArray[np.intp], active: NDArray[np.bool_]) -> None:
        """Put a picture: rows of `TABLE` or NOTHING, [2 * k, w], two rows of it a row of characters.

        `active` [2 * k, w] says which are active, for a canvas without colour.
        """
        height, width = steps.shape[0] // 2, steps.shape[1]
        height, width = min(height, self.height - row), min(width, self.width - column)
        if height <= 0 or width <= 0:
            return
        upper, lower = steps[: 2 * height : 2, :width], steps[1 : 2 * height : 2, :width]
        has_upper, has_lower = upper != NOTHING, lower != NOTHING
        if self._has_colour:
            glyphs = np.where(has_upper, _UPPER, _LOWER)
            numbers = _FIRST_PAIR + (upper + 1) * _KINDS + lower + 1
        else:
            on_upper, on_lower = active[: 2 * height : 2, :width], active[1 : 2 * height : 2, :width]
            glyphs = np.where(on_upper, np.where(on_lower, _FULL, _UPPER), np.where(on_lower, _LOWER, _DOT))
            numbers = np.zeros_like(upper)
        here = has_upper | has_lower
        self._glyphs[row : row + height, column : column + width][here] = glyphs[here]
        self._styles[row : row + height, column : column + width][here] = numbers[here]

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> Iterator[Segment]:
        for number, (glyphs, styles) in enumerate(zip(self._glyphs, self._styles, strict=True)):
            cuts = [0, *(np.flatnonzero(np.diff(styles)) + 1).tolist(), self.width]
            text = "".join(glyphs.tolist())
            for begin, end in pairwise(cuts):
                yield Segment(text[begin:end], self._style(int(styles[begin])))
            if number < self.height - 1:
                yield Segment.line()

    def _style(self, number: int) -> Style:
        if number < _FIRST_PAIR:
            return _named(self._names[number])
        upper, lower = divmod(number - _FIRST_PAIR, _KINDS)
        return _pair(upper - 1, lower - 1)


@lru_cache(maxsize=256)
def _named(style: str) -> Style:
    return Style.parse(style)


@lru_cache(maxsize=4096)
def _pair(upper: int, lower: int) -> Style:
    """The style of a half block: `▀` with the upper taxel in front, or `▄` if there is no upper one."""
    if upper == NOTHING:
        return Style(color=_colour(lower))
    return Style(color=_colour(upper), bgcolor=None if lower == NOTHING else _colour(lower))


def _colour(step: int) -> Color:
    red, green, blue = (int(value) for value in TABLE[step])
    return Color.from_rgb(red, green, blue)
