"""Layout of the taxels of each board: distances, pitch, and the centres of the pieces of each taxel."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.recording.grasp_tables import TaxelTable
from taxel.types import FloatArray

PIECES_PER_SIDE: Final = 3
"""Pieces along the side of a taxel (chosen). A taxel is divided into pieces because the edge of an object can load only
a part of the taxel."""


@dataclass(frozen=True, eq=False)
class BoardLayout:
    """Layout of the m taxels of one board.

    Attributes:
        taxels: i64[m], indices of the taxels in the recording.
        distance_m: f64[m, m], distances between the taxels, metres.
        pitch_m: distance of neighbouring taxels, metres.
        piece_centres: f64[m, PIECES_PER_SIDE^2, 3], centres of the pieces of each taxel in the bracket frame, metres.
    """

    taxels: NDArray[np.intp]
    distance_m: FloatArray
    pitch_m: float
    piece_centres: FloatArray

    @cached_property
    def columns(self) -> NDArray[np.intp] | slice:
        """Index of the taxels of the board, see `make_column_index`."""
        return make_column_index(self.taxels)


def make_board_layouts(sensor: NDArray[np.intp], table: TaxelTable) -> tuple[BoardLayout, ...]:
    """Return the layout of every board. sensor: i64[n] (n taxels), board of each taxel."""
    layouts = []
    for taxels in list_group_members(sensor):
        position = table.position[taxels]
        distance_m = np.linalg.norm(position[:, None] - position, axis=2)
        pitch = compute_pitch_m(position, table.size[taxels])
        piece_centres = _compute_piece_centres(position, table.normal[taxels], pitch)
        layouts.append(BoardLayout(taxels, distance_m, pitch, piece_centres))
    return tuple(layouts)


def _compute_piece_centres(position: FloatArray, normal: FloatArray, pitch: float) -> FloatArray:
    """Return the centres of the pieces of m taxels, f64[m, PIECES_PER_SIDE^2, 3], metres.

    The square area of each taxel is divided into PIECES_PER_SIDE^2 equal squares, the pieces.

    position: centres of the taxels, f64[m, 3], metres. normal: f64[m, 3]. pitch: side of the square area of a taxel,
    metres. The direction of the sides around the normal is arbitrary.
    """
    # The helper is any axis that is not parallel to the normal; the cross products span the plane of the taxel.
    helper = np.where(np.abs(normal[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    first = np.cross(normal, helper)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(normal, first)
    steps = ((np.arange(PIECES_PER_SIDE) + 0.5) / PIECES_PER_SIDE - 0.5)[:, None]
    along, across = (grid.ravel() * pitch for grid in np.meshgrid(steps, steps, indexing="ij"))
    return np.asarray(position[:, None] + along[:, None] * first[:, None] + across[:, None] * second[:, None])


def list_group_members(index: NDArray[np.intp]) -> list[NDArray[np.intp]]:
    """Return the indices of the members of each group, one array for each group.

    index: [n], number of the group, from 0, to which each of the n members (such as taxels) belongs.
    """
    order = np.argsort(index, kind="stable")
    return np.split(order, np.cumsum(np.bincount(index))[:-1])


def make_column_index(taxels: NDArray[np.intp]) -> NDArray[np.intp] | slice:
    """Return an index that selects taxels from an array: a slice if the taxels are contiguous, otherwise `taxels`
    itself.

    Indexing an array by a slice makes no copy.
    """
    first, last = int(taxels[0]), int(taxels[-1])
    is_contiguous = np.array_equal(taxels, np.arange(first, last + 1))
    return slice(first, last + 1) if is_contiguous else taxels


def compute_pitch_m(position: FloatArray, size: FloatArray) -> float:
    """Return the median distance between each taxel of a board and its nearest taxel, metres; for a single taxel, its
    size.

    position: f64[m, 3], metres. size: f64[m], metres.
    """
    if len(position) < 2:
        return float(size.mean())
    distance_m = np.linalg.norm(position[:, None] - position, axis=2)
    distance_m[distance_m == 0] = np.inf  # the taxel itself, and taxels at the same position
    return float(np.median(distance_m.min(axis=1)))
