"""Picture of the whole skin: every board as its matrix of taxels, coloured by a value."""

import os
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.hand.boards import Board
from taxel.hand.description import Hand
from taxel.output.figure import save_figure

COLUMNS = 6
TAXEL_SIDE = 0.86
"""Side of a drawn taxel, in pitches."""

SIGNAL_COLOURS = ("#e6eaf0", "#73a2e7", "#0453b4", "#00265a")
"""Colours from no signal to the largest signal; the first is pale, so that a contact on a large skin stands out."""


def save_heat_map(
    hand: Hand,
    values: NDArray[np.float64],
    active: NDArray[np.bool_],
    path: str | os.PathLike[str],
    title: str,
    label: str = "signal",
) -> None:
    """Draw the values of all taxels of a hand as coloured squares, board by board, and save the picture.

    values: f64[n], NaN where missing. active: bool[n], taxels drawn with a frame. path: its suffix selects PNG, SVG or
    PDF. label: label of the colour bar.
    """
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    rows = -(-len(hand.boards) // COLUMNS)
    figure, axes = plt.subplots(
        rows, COLUMNS, figsize=(2.5 * COLUMNS, 2.75 * rows + 0.6), layout="constrained", squeeze=False
    )
    # The scale ends at the default activation threshold (150 counts) or above: noise then does not look like a contact.
    limit = max(150.0, float(np.nanmax(values, initial=0.0)))
    image = None
    for board, axis in zip(hand.boards, axes.flat, strict=False):
        where = hand.get_slice(board.address)
        image = _draw_board(axis, board, values[where], active[where], limit)
    for axis in list(axes.flat)[len(hand.boards) :]:
        axis.axis("off")
    if image is not None:
        figure.colorbar(image, ax=axes, shrink=0.6, label=label, pad=0.01)
    figure.suptitle(title, fontsize=13)
    save_figure(figure, path, dpi=110)
    plt.close(figure)


def _draw_board(axis: Any, board: Board, values: NDArray[np.float64], active: NDArray[np.bool_], limit: float) -> Any:
    """Draw the taxels of a board on an axis of matplotlib.

    values: f64[n], counts. active: bool[n], taxels drawn with a border. limit: end of the colour scale, counts. Returns
    the collection of the squares, from which the colour bar is made.
    """
    from matplotlib.collections import PatchCollection
    from matplotlib.colors import LinearSegmentedColormap, Normalize
    from matplotlib.patches import Rectangle

    kind = board.kind
    squares = [
        Rectangle((column - TAXEL_SIDE / 2, row - TAXEL_SIDE / 2), TAXEL_SIDE, TAXEL_SIDE)
        for row, column in zip(kind.row.tolist(), kind.column.tolist(), strict=True)
    ]
    collection = PatchCollection(
        squares, cmap=LinearSegmentedColormap.from_list("signal", SIGNAL_COLOURS), norm=Normalize(0.0, limit)
    )
    collection.set_array(np.ma.masked_invalid(values))
    collection.cmap.set_bad("0.75")
    collection.set_edgecolor(["#d62728" if is_active else "none" for is_active in active])
    collection.set_linewidth([1.6 if is_active else 0.0 for is_active in active])
    axis.add_collection(collection)
    rows, columns = kind.layout_shape
    axis.set_xlim(-0.7, columns - 0.3)
    axis.set_ylim(rows - 0.3, -0.7)
    axis.set_aspect("equal")
    axis.set_xticks([])
    axis.set_yticks([])
    count = int(active.sum())
    axis.set_title(f"{board.name.replace('_', ' ')}\n0x{board.address:02X} · {count} active", fontsize=8.5)
    axis.set_xlabel("RX" if kind.layout is None else "across", fontsize=7, labelpad=1)
    axis.set_ylabel("TX" if kind.layout is None else "distal up", fontsize=7, labelpad=1)
    return collection
