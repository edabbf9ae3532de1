"""The unrolled hand before and after as a PNG, for documents and terminals."""

from __future__ import annotations

import math
import os
import textwrap
from collections.abc import Mapping
from typing import Any

from taxel.gap.page.board_map import EDGE, Placed
from taxel.gap.page.colours import LIGHT, STEPS, step_of
from taxel.gap.page.report import Report
from taxel.gap.page.text import SMALL_P, number
from taxel.gap.page.unrolled import CELL, LEAST_SHARE, SQUARE, Marks, Unrolled, labelled, required_unrolled

_INCHES_PER_CELL = 0.09
_DPI = 150
_TITLE = 5.5  # cells for the verdict, two lines
_STAGE = 3.0  # cells for the words over a stage
_SCALE = 7.0  # cells for the colour scale
_GAP = 3.0  # cells between views
_SIDE = SQUARE / CELL
_RAMP = 30.0  # cells, length of the colour scale
_LETTERS_PER_CELL = 0.9
_LEAST_WIDTH = 70.0
_INK, _MUTED, _EDGE, _GROUND = "#1b1d22", "#5b606b", "#d5d7dc", "#ffffff"


def unrolled_png(report: Mapping[str, Any], path: str | os.PathLike[str]) -> None:
    """Draw the unrolled hand before and after on one scale, under the verdict, and save it as `path`.

    Args:
        report: as `json.load` gives it.
        path: the PNG to write.

    Raises:
        GapInputError: a report without taxels and their excess, or a field that is malformed.
        OSError: the file cannot be written.
    """
    unrolled = required_unrolled(report)
    checked = Report(report)
    verdict = checked.verdict.text("one_line")
    captions = {
        "before": f"Before: {number(checked.after.maybe_number('before'))} counts",
        "after": f"After: {number(checked.after.maybe_number('value'))} counts",
    }
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    stage_width = sum(view.width + _GAP for view in unrolled.views)
    tall = max(view.height for view in unrolled.views)
    width, height = max(2 * stage_width, _LEAST_WIDTH), _TITLE + _STAGE + tall + _SCALE
    figure = plt.figure(figsize=(_INCHES_PER_CELL * width, _INCHES_PER_CELL * height), facecolor=_GROUND)
    axis = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axis.set_xlim(0.0, width)
    axis.set_ylim(height, 0.0)
    axis.axis("off")
    title = textwrap.fill(verdict, int(_LETTERS_PER_CELL * width), max_lines=2, placeholder=" ...")
    _write(axis, _GAP, 1.2, title, fontsize=11, fontweight="bold", verticalalignment="top")
    for number_of, (stage, caption) in enumerate(captions.items()):
        left = _GAP / 2 + number_of * width / 2
        _write(axis, left + 1.0, _TITLE + 2.0, caption, fontsize=10)
        _draw_stage(axis, unrolled, stage, left, _TITLE + _STAGE + tall)
    _draw_scale(axis, unrolled.top, height - _SCALE + 2.0)
    try:
        figure.savefig(path, dpi=_DPI, format="png", facecolor=_GROUND, metadata={"Software": None})
    finally:
        plt.close(figure)


def _draw_stage(axis: Any, unrolled: Unrolled, stage: str, left: float, bottom: float) -> None:
    excess, marks = unrolled.stage(stage)
    for view in unrolled.views:
        top = bottom - view.height
        _write(axis, left + EDGE, top + 1.5, view.title, fontsize=7, color=_MUTED)
        for heading in view.headings:
            style = {"fontsize": 7, "fontweight": "bold", "horizontalalignment": "center"}
            _write(axis, left + heading.x, top + heading.y, heading.label, **style)
        for placed in view.boards:
            corner = (left + placed.x, bottom - view.height + placed.y)
            _draw_board(axis, placed, corner, [excess[index] for index in placed.board.index], unrolled.top, marks)
        left += view.width + _GAP


def _draw_board(
    axis: Any, placed: Placed, corner: tuple[float, float], excess: list[float], top: float, marks: Marks
) -> None:
    from matplotlib.collections import PatchCollection
    from matplotlib.patches import Rectangle

    board, (x, y) = placed.board, corner
    margin = (1.0 - _SIDE) / 2
    squares = [
        Rectangle((x + rx + margin, y + tx + margin), _SIDE, _SIDE) for tx, rx in zip(board.tx, board.rx, strict=True)
    ]
    colours = ["none" if math.isnan(value) else LIGHT[step_of(value, top)] for value in excess]
    edges = [_MUTED if math.isnan(value) else "none" for value in excess]
    axis.add_collection(PatchCollection(squares, facecolor=colours, edgecolor=edges, linewidth=0.5))
    strong = board.address in marks.boards
    frame = Rectangle((x - 0.22, y - 0.22), board.columns + 0.44, board.rows + 0.44, facecolor="none")
    frame.set_edgecolor(_INK if strong else _EDGE)
    frame.set_linewidth(1.4 if strong else 0.7)
    axis.add_patch(frame)
    style = {"fontweight": "bold", "color": _INK} if strong else {"color": _MUTED}
    _write(
        axis,
        x + board.columns / 2,
        y - 1.2,
        labelled(placed, marks),
        fontsize=6.5,
        horizontalalignment="center",
        **style,
    )
    for address, direction, index in sorted(marks.lines):
        if address == board.address and index < (board.rows if direction == "tx" else board.columns):
            place, shape = (
                ((x - 0.65, y + index + 0.5), ">") if direction == "tx" else ((x + index + 0.5, y - 0.65), "v")
            )
            axis.plot(*place, shape, color=_INK, markersize=3.2, markeredgewidth=0)


def _draw_scale(axis: Any, top: float, y: float) -> None:
    from matplotlib.patches import Rectangle

    step = _RAMP / STEPS
    for index, colour in enumerate(LIGHT):
        axis.add_patch(Rectangle((_GAP + index * step, y), step, 1.2, facecolor=colour))
    for share in (0.0, 0.5, 1.0):
        text = number(share * top)
        _write(axis, _GAP + share * _RAMP, y + 2.9, text, fontsize=7, color=_MUTED, horizontalalignment="center")
    of_boards = f"with {100 * LEAST_SHARE:.0f} % of it at least"
    words = f"root of the excess, counts; p < {SMALL_P}: arrow, line; bold frame, board {of_boards}"
    _write(axis, _GAP + _RAMP + 2.5, y + 1.1, words, fontsize=7, color=_MUTED)


def _write(axis: Any, x: float, y: float, text: str, **style: Any) -> None:
    """Words as they are: a dollar sign of a name starts no formula."""
    plain = "".join(letter if letter.isprintable() or letter == "\n" else " " for letter in text)
    axis.text(x, y, plain, parse_math=False, **{"color": _INK, **style})
