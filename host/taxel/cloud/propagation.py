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
from taxel.types import BoolArray, FloatArray

NEIGHBOUR_DISTANCE_M: Final = 0.0055
"""Largest distance of neighbours on a board: the four taxels at the pitch of 5 mm, without the diagonal ones."""


@dataclass(frozen=True)
class Propagation:
    """Rule by which taxels activate others.

    reach_m: taxels of the same board up to this distance are activated. min_signal_counts: only taxels whose signal
    exceeds this value activate others; 0, as in the thesis: every active taxel does.
    """

    reach_m: float = NEIGHBOUR_DISTANCE_M
    min_signal_counts: float = 0.0

    def find_neighbours(self, taxels: TaxelTable) -> csr_array:
        """Find the pairs of taxels on one board that are near enough to activate each other.

        Returns a sparse matrix f64[n, n] with a one for each pair, without the diagonal.
        """
        pairs = [np.empty((0, 2), np.int64)]
        for board in np.unique(taxels.sensor):
            of_board = np.flatnonzero(taxels.sensor == board)
            pairs.append(of_board[cKDTree(taxels.position[of_board]).query_pairs(self.reach_m, output_type="ndarray")])
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
        rows = np.repeat(np.arange(len(strength)), np.diff(neighbours.indptr))
        np.maximum.at(strongest, rows, strength[neighbours.indices])
        return active | (strongest > 0.0), np.where(active, signal, strongest)
