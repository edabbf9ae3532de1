"""The unrolled hand as a PNG file, for documents and terminals."""

import os
import textwrap
from collections.abc import Mapping
from typing import Any

from taxel.gap.page.colours import LIGHT, STEPS
from taxel.gap.page.hand_drawing import MIN_SHARE, BoardDrawing, ViewDrawing, require_unrolled_hand
from taxel.gap.page.text import SMALL_P, format_number
from taxel.gap.report.checked_report import CheckedReport
from taxel.output.figure import save_figure

# Lengths in taxel pitches of the picture, unless the name states another unit.
_INCHES_PER_PITCH = 0.09
_DPI = 150
_TITLE = 5.5  # height of the verdict, two lines
_CAPTION = 3.0  # height of the caption of a stage
_SCALE = 7.0  # height of the colour scale
_GAP = 3.0  # between views
_RAMP = 30.0  # length of the colour scale
_LETTERS_PER_PITCH = 0.9
_MIN_WIDTH = 70.0
_INK, _MUTED, _EDGE, _GROUND = "#1b1d22", "#5b606b", "#d5d7dc", "#ffffff"


def unrolled_png(report: Mapping[str, Any], path: str | os.PathLike[str]) -> None:
    """Save a picture of the unrolled hand, whose taxels are coloured by their excess, as the PNG file `path`.

    The picture shows the excess before and after the effects of the verdict are added to the simulator, on one colour
    scale; without such effects it shows the measured excess alone. Its title is the verdict.

    Args:
        report: content of `report.json`, as `json.load` returns it.
        path: the PNG file to write.

    Raises:
        GapInputError: a report without taxels and their excess, or a malformed field.
        OSError: the file cannot be written.
    """
    hand = require_unrolled_hand(report)
    checked = CheckedReport(report)
    verdict = checked.verdict.optional_text("headline") or checked.verdict.text("one_line")
    before, after = (format_number(checked.after.optional_number(name)) for name in ("before", "value"))
    captions = (
        {"before": f"Before: {before} counts", "after": f"After: {after} counts"}
        if checked.named_effects
        else {"before": f"Gap: {before} counts"}
    )
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    stage_width = sum(view.width + _GAP for view in hand.views)
    tallest = max(view.height for view in hand.views)
    width, height = max(len(captions) * stage_width, _MIN_WIDTH), _TITLE + _CAPTION + tallest + _SCALE
    figure = plt.figure(figsize=(_INCHES_PER_PITCH * width, _INCHES_PER_PITCH * height), facecolor=_GROUND)
    axis = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axis.set_xlim(0.0, width)
    axis.set_ylim(height, 0.0)
    axis.axis("off")
    title = textwrap.fill(verdict, int(_LETTERS_PER_PITCH * width), max_lines=2, placeholder=" ...")
    _write(axis, _GAP, 1.2, title, fontsize=11, fontweight="bold", verticalalignment="top")
    for index, (stage, caption) in enumerate(captions.items()):
        x, bottom = _GAP / 2 + index * width / len(captions), _TITLE + _CAPTION + tallest
        _write(axis, x + 1.0, _TITLE + 2.0, caption, fontsize=10)
        for view in hand.draw(stage):
            _draw_view(axis, view, x, bottom - view.height)
            x += view.width + _GAP
    _draw_scale(axis, hand.top, height - _SCALE + 2.0)
    try:
        save_figure(figure, path, dpi=_DPI, format="png", facecolor=_GROUND, metadata={"Software": None})
    finally:
        plt.close(figure)


def _draw_view(axis: Any, view: ViewDrawing, x: float, y: float) -> None:
    """Draw a view on a matplotlib axis. x, y: its upper left corner, taxel pitches."""
    _write(axis, x + view.title_x, y + view.title_y, view.title, fontsize=7, color=_MUTED)
    for heading in view.headings:
        style = {"fontsize": 7, "fontweight": "bold", "horizontalalignment": "center"}
        _write(axis, x + heading.x, y + heading.y, heading.text, **style)
    for board in view.boards:
        _draw_board(axis, board, x + board.x, y + board.y)


def _draw_board(axis: Any, board: BoardDrawing, x: float, y: float) -> None:
    """Draw a board on a matplotlib axis. x, y: upper left corner of its taxels."""
    from matplotlib.collections import PatchCollection
    from matplotlib.patches import Polygon, Rectangle

    squares = [Rectangle((x + square.x, y + square.y), square.size, square.size) for square in board.squares]
    colours = ["none" if square.step is None else LIGHT[square.step] for square in board.squares]
    edges = [_MUTED if square.step is None else "none" for square in board.squares]
    axis.add_collection(PatchCollection(squares, facecolor=colours, edgecolor=edges, linewidth=0.5))
    frame = Rectangle((x + board.frame.x, y + board.frame.y), board.frame.width, board.frame.height, facecolor="none")
    frame.set_edgecolor(_INK if board.is_marked else _EDGE)
    frame.set_linewidth(1.4 if board.is_marked else 0.7)
    axis.add_patch(frame)
    style = {"fontweight": "bold", "color": _INK} if board.is_marked else {"color": _MUTED}
    middle = x + board.columns / 2
    _write(axis, middle, y + board.label_y, board.label, fontsize=6.5, horizontalalignment="center", **style)
    for arrow in board.arrows:
        axis.add_patch(Polygon([(x + dx, y + dy) for dx, dy in arrow.points], facecolor=_INK, edgecolor="none"))


def _draw_scale(axis: Any, top: float, y: float) -> None:
    """Draw the colour scale up to `top` counts, and the meaning of the marks. y: upper edge."""
    from matplotlib.patches import Rectangle

    step = _RAMP / STEPS
    for index, colour in enumerate(LIGHT):
        axis.add_patch(Rectangle((_GAP + index * step, y), step, 1.2, facecolor=colour))
    for share in (0.0, 0.5, 1.0):
        text = format_number(share * top)
        _write(axis, _GAP + share * _RAMP, y + 2.9, text, fontsize=7, color=_MUTED, horizontalalignment="center")
    marks = f"arrow: line with p < {SMALL_P}; bold frame: board with p < {SMALL_P} and {100 * MIN_SHARE:.0f} % or more"
    for line, text in enumerate(("root of the excess, counts", marks)):
        _write(axis, _GAP + _RAMP + 2.5, y + 1.1 + 1.8 * line, text, fontsize=7, color=_MUTED)


def _write(axis: Any, x: float, y: float, text: str, **style: Any) -> None:
    """Write a text without mathematical formulas, so that a dollar sign in a name stays a dollar sign."""
    printable = "".join(letter if letter.isprintable() or letter == "\n" else " " for letter in text)
    axis.text(x, y, printable, parse_math=False, **{"color": _INK, **style})
