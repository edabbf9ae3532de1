"""Where the taxels of a board lie beside each other."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.recording.grasp_tables import TaxelTable
from taxel.types import FloatArray

PIECES: Final = 3
"""Pieces along a taxel's side: an edge that passes over a taxel presses a part of it."""


@dataclass(frozen=True, eq=False)
class BoardLayout:
    """One board. taxels: i64[m], in the recording. apart_m: f64[m, m], distances. pitch_m: of neighbours. pieces:
    f64[m, PIECES^2, 3], metres, the middles of each taxel's pieces, bracket frame.
    """

    taxels: NDArray[np.intp]
    apart_m: FloatArray
    pitch_m: float
    pieces: FloatArray

    @cached_property
    def columns(self) -> NDArray[np.intp] | slice:
        """Its taxels, see `columns_of`."""
        return columns_of(self.taxels)


def layouts_of(sensor: NDArray[np.intp], table: TaxelTable) -> tuple[BoardLayout, ...]:
    """Every board. sensor: i64[n], the board of each taxel."""
    layouts = []
    for taxels in groups_of(sensor):
        places = table.position[taxels]
        apart = np.linalg.norm(places[:, None] - places, axis=2)
        pitch = pitch_m(places, table.size[taxels])
        layouts.append(BoardLayout(taxels, apart, pitch, _pieces(places, table.normal[taxels], pitch)))
    return tuple(layouts)


def _pieces(position: FloatArray, normal: FloatArray, pitch: float) -> FloatArray:
    helper = np.where(np.abs(normal[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    first = np.cross(normal, helper)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(normal, first)
    steps = ((np.arange(PIECES) + 0.5) / PIECES - 0.5)[:, None]
    along, across = (grid.ravel() * pitch for grid in np.meshgrid(steps, steps, indexing="ij"))
    return np.asarray(position[:, None] + along[:, None] * first[:, None] + across[:, None] * second[:, None])


def groups_of(index: NDArray[np.intp]) -> list[NDArray[np.intp]]:
    """Members of each group: positions of 0, of 1, ..."""
    order = np.argsort(index, kind="stable")
    return np.split(order, np.cumsum(np.bincount(index))[:-1])


def columns_of(taxels: NDArray[np.intp]) -> NDArray[np.intp] | slice:
    """A slice where they lie together in the recording: no copy is then made of what is theirs."""
    first, last = int(taxels[0]), int(taxels[-1])
    together = np.array_equal(taxels, np.arange(first, last + 1))
    return slice(first, last + 1) if together else taxels


def pitch_m(position: FloatArray, size: FloatArray) -> float:
    """Distance of neighbouring taxels of a board, metres. position: f64[m, 3], size: f64[m]."""
    if len(position) < 2:
        return float(size.mean())
    apart = np.linalg.norm(position[:, None] - position, axis=2)
    apart[apart == 0] = np.inf
    return float(np.median(apart.min(axis=1)))
