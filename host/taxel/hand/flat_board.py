"""Positions of the taxels of a board that lies flat, for probes that move over it."""

import numpy as np
from numpy.typing import NDArray

from taxel.hand.boards import BoardKind

PARALLEL = 1e-6
"""Largest difference between the directions of two taxels of a flat board, 1 minus the cosine: rounding of the file."""


def compute_flat_positions(kind: BoardKind, pitch_m: float) -> NDArray[np.float64] | None:
    """Compute the taxel centres of a flat board, f64[taxel_count, 2], metres; None for a bent board with a layout.

    The first coordinate increases with the row of a taxel, the second one with its column. Without a described layout,
    the pitch is the same everywhere, and the origin is row 0, column 0. With a layout, the pitch varies: the positions
    are those of the described surface, and the origin is the first taxel. The description does not contain the
    positions on a bent board after unrolling.
    """
    if kind.layout is None or kind.surface is None:
        return pitch_m * np.stack([kind.row, kind.column], axis=1).astype(np.float64)
    normal, distal = kind.surface.normal, kind.surface.distal
    if min((normal @ normal[0]).min(), (distal @ distal[0]).min()) < 1.0 - PARALLEL:
        return None
    axes = np.stack([-distal[0], np.cross(distal[0], normal[0])])
    return np.asarray((kind.surface.position - kind.surface.position[0]) @ axes.T)
