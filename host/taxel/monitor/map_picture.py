"""The taxels of a hand as a picture of half blocks, in the layout that fits on the screen."""

from collections.abc import Sequence
from functools import lru_cache
from typing import Final

import numpy as np

from taxel.hand import Hand
from taxel.monitor.board_layout import BoardLayout, layout_rows, layout_unrolled
from taxel.monitor.canvas import NOTHING, Canvas
from taxel.monitor.colours import ColourScale, colour_steps
from taxel.types import BoolArray, FloatArray, IndexArray

LABEL: Final = "dim"
ACTIVE_LABEL: Final = "bold green"


def draw_signal_map(hand: Hand, signal_counts: FloatArray, threshold: float, width: int, has_colour: bool) -> Canvas:
    """Draw the signals of a hand as a map of its taxels, with the names of the boards.

    signal_counts: f64[n], counts, NaN where unknown. threshold: signal above which a taxel is active, counts. width:
    number of columns of the screen. The name of a board with an active taxel is bright.
    """
    layouts = list_layouts(hand, width)
    layout = next((one for one in layouts if one.width <= width), layouts[-1])
    known = signal_counts[np.isfinite(signal_counts)]
    top = ColourScale(threshold).update(float(known.max()) if known.size else float("nan"), 0.0)
    active = np.nan_to_num(signal_counts, nan=0.0) > threshold
    canvas = Canvas(min(width, layout.width), layout.height, has_colour)
    paint_taxels(canvas, hand, layout, 0, colour_steps(signal_counts, threshold, top), active)
    for placed in layout.boards:
        is_active = bool(active[hand.get_slice(placed.board.address)].any())
        canvas.write(placed.y - 1, placed.label_x, placed.label, ACTIVE_LABEL if is_active else LABEL)
    return canvas


def paint_taxels(
    canvas: Canvas, hand: Hand, layout: BoardLayout, top_row: int, steps: IndexArray, active: BoolArray
) -> None:
    """Paint the taxels of a hand and the headings of a layout on a canvas, from the row `top_row` on.

    steps: int[n], row of the colour table for each taxel. active: bool[n].
    """
    scale, rows, columns = layout.scale, *_locate_taxels(hand, layout)
    picture = np.full((2 * layout.height, layout.width), NOTHING, dtype=np.intp)
    are_active = np.zeros_like(picture, dtype=bool)
    for down in range(scale):
        for right in range(scale):
            picture[rows + down, columns + right] = steps
            are_active[rows + down, columns + right] = active
    canvas.paint(top_row, 0, picture, are_active)
    for heading in layout.headings:
        canvas.write(top_row + heading.y, heading.x, heading.text, "bold")


@lru_cache(maxsize=8)
def list_layouts(hand: Hand, width: int) -> Sequence[BoardLayout]:
    """Return the possible layouts of the boards of a hand on a screen of `width` characters, the best first."""
    unrolled = [layout_unrolled(hand, 2), layout_unrolled(hand, 1)]
    layouts = [layout for layout in unrolled if layout is not None]
    if not layouts:
        layouts.append(layout_rows(hand, width, 2))
    return (*layouts, layout_rows(hand, width, 1))


@lru_cache(maxsize=8)
def _locate_taxels(hand: Hand, layout: BoardLayout) -> tuple[IndexArray, IndexArray]:
    """Return row (in half characters) and column of the upper left corner of each taxel in a layout, int[n] each."""
    rows = np.zeros(hand.n_taxels, dtype=np.intp)
    columns = np.zeros(hand.n_taxels, dtype=np.intp)
    for placed in layout.boards:
        kind, taxels = placed.board.kind, hand.get_slice(placed.board.address)
        spare = (kind.layout_shape[0] * layout.scale) % 2  # an odd number of rows is aligned to the bottom of its block
        rows[taxels] = 2 * placed.y + spare + layout.scale * kind.row.astype(np.intp)
        columns[taxels] = placed.x + layout.scale * kind.column.astype(np.intp)
    return rows, columns
