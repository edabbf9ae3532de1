"""Where the taxels of a board lie beside each other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.recording.grasp_tables import TaxelTable

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class BoardLayout:
    """One board. taxels: i64[m], in the recording. apart_m: f64[m, m], distances. pitch_m: of neighbours."""

    taxels: NDArray[np.intp]
    apart_m: Array
    pitch_m: float


def layouts_of(sensor: NDArray[np.intp], table: TaxelTable) -> tuple[BoardLayout, ...]:
    """Every board. sensor: i64[n], the board of each taxel."""
    layouts = []
    for taxels in groups_of(sensor):
        places = table.position[taxels]
        apart = np.linalg.norm(places[:, None] - places, axis=2)
        layouts.append(BoardLayout(taxels, apart, pitch_m(places, table.size[taxels])))
    return tuple(layouts)


def groups_of(index: NDArray[np.intp]) -> list[NDArray[np.intp]]:
    """Members of each group: positions of 0, of 1, ..."""
    order = np.argsort(index, kind="stable")
    return np.split(order, np.cumsum(np.bincount(index))[:-1])


def pitch_m(position: Array, size: Array) -> float:
    """Distance of neighbouring taxels of a board, metres. position: f64[m, 3], size: f64[m]."""
    if len(position) < 2:
        return float(size.mean())
    apart = np.linalg.norm(position[:, None] - position, axis=2)
    apart[apart == 0] = np.inf
    return float(np.median(apart.min(axis=1)))
