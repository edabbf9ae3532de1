"""Positions of the taxels of a board that lies flat, for probes that move over it."""

import numpy as np
from numpy.typing import NDArray

from taxel.hand.boards import BoardKind

PARALLEL = 1e-6
"""Largest difference between the directions of two taxels of a flat board, 1 minus the cosine: rounding of the file."""


def compute_flat_positions(kind: BoardKind, pitch_m: float) -> NDArray[np.float64] | None:
    """Compute the taxel centres of a flat board, f64[taxel_count, 2], metres: along its rows and along its columns.

    A board without a described layout has the same pitch everywhere; its origin is row 0, column 0. The pitch of a
    board with a layout varies: its positions are the centres of its taxels, and its origin is its first taxel. None if
    such a board is bent, because the description does not contain its shape when it is unrolled.
    """
    if kind.layout is None or kind.surface is None:
        return pitch_m * np.stack([kind.row, kind.column], axis=1).astype(np.float64)
    normal, distal = kind.surface.normal, kind.surface.distal
    if min((normal @ normal[0]).min(), (distal @ distal[0]).min()) < 1.0 - PARALLEL:
        return None
    axes = np.stack([-distal[0], np.cross(distal[0], normal[0])])
    return np.asarray((kind.surface.position - kind.surface.position[0]) @ axes.T)
