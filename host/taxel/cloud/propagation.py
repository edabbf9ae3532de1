"""Contact propagation, which the thesis adds to simulated clouds (5.6.2): active taxels activate their neighbours.

On the hand the elastic layer propagates contact; the simulator of the thesis is rigid. The thesis states "the taxels in
the immediate neighbourhood" and no distance.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from taxel.recording.grasp_tables import TaxelTable
from taxel.types import BoolArray, FloatArray, IndexArray

MAX_SPACING_RATIO: Final = 2.0
"""Largest distance between two adjacent taxels, relative to the distance of each of them to its nearest taxel. Pairs
with a larger distance lie on two sides of a gap between parts of the board. The pitches of rows and columns differ by a
factor of up to 1.7 on the boards of the original hand."""


@dataclass(frozen=True)
class Propagation:
    """Rule by which taxels activate others.

    reach_m: taxels of the same board up to this distance are activated; None: the adjacent taxels, whatever the pitch
    (`_find_adjacent`). min_signal_counts: only taxels whose signal exceeds this value activate others; 0, as in the
    thesis: every active taxel does.
    """

    reach_m: float | None = None
    min_signal_counts: float = 0.0

    def find_neighbours(self, taxels: TaxelTable) -> csr_array:
        """Find the pairs of taxels on one board that are near enough to activate each other.

        Two taxels form a pair if their distance is at most `reach_m`, or if they are adjacent (`_find_adjacent`) when
        `reach_m` is None. Returns a symmetric sparse matrix f64[n, n] with a one for each pair and a zero diagonal.
        """
        pairs = [np.empty((0, 2), np.int64)]
        for board in np.unique(taxels.sensor):
            of_board = np.flatnonzero(taxels.sensor == board)
            position = taxels.position[of_board]
            if self.reach_m is None:
                pairs.append(of_board[_find_adjacent(position)])
            else:
                pairs.append(of_board[cKDTree(position).query_pairs(self.reach_m, output_type="ndarray")])
        one_way = np.concatenate(pairs)
        rows, columns = np.concatenate([one_way, one_way[:, ::-1]]).T
        return csr_array((np.ones(len(rows)), (rows, columns)), shape=(taxels.n, taxels.n))

    def apply(self, active: BoolArray, signal: FloatArray, neighbours: csr_array) -> tuple[BoolArray, FloatArray]:
        """Apply contact propagation: an active taxel also activates its neighbours.

        active: bool[n]. signal: f64[n], counts. neighbours: from `find_neighbours`. Returns the active taxels, bool[n],
        and their signals, f64[n] counts. An activated neighbour takes the signal of the strongest active taxel next to
        it, since its own signal is below the threshold.
        """
        strength = np.where(active & (np.nan_to_num(signal) > self.min_signal_counts), signal, 0.0)
        strongest = np.zeros(len(strength))
        # Row of each stored element of the sparse (CSR) matrix; `neighbours.indices` contains the columns.
        rows = np.repeat(np.arange(len(strength)), np.diff(neighbours.indptr))
        np.maximum.at(strongest, rows, strength[neighbours.indices])
        return active | (strongest > 0.0), np.where(active, signal, strongest)


def _find_adjacent(position: FloatArray) -> IndexArray:
    """Find the pairs of adjacent points in the relative neighbourhood graph (Toussaint 1980).

    position: f64[n, 3]. Returns the indices of each pair once, i64[m, 2]. Two points are adjacent if no third point is
    nearer to both than they are to each other. On a grid, a point is adjacent to its four neighbours even if the
    pitches of rows and columns differ, but not to diagonal points. Pairs across a gap (`MAX_SPACING_RATIO`) are left
    out.
    """
    distance = np.linalg.norm(position[:, None] - position, axis=2)
    np.fill_diagonal(distance, np.inf)
    nearest = distance.min(axis=1, initial=np.inf)
    first, second = np.nonzero(np.triu(np.isfinite(distance) & (distance <= MAX_SPACING_RATIO * nearest[:, None])))
    is_mutual = distance[first, second] <= MAX_SPACING_RATIO * nearest[second]
    first, second = first[is_mutual], second[is_mutual]
    between = np.maximum(distance[first], distance[second]).min(axis=1, initial=np.inf)
    # The tolerance keeps pairs whose distance equals that of a third point up to rounding.
    is_adjacent = distance[first, second] <= between * (1.0 + 1e-6)
    return np.column_stack([first[is_adjacent], second[is_adjacent]])
