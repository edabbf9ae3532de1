"""Contact propagation as the thesis adds it to simulated clouds (5.6.2): active taxels activate their neighbours.

On the hand the elastic layer does so; the thesis's simulator is rigid. Its text says "the taxels in the immediate
neighbourhood"; how far that reaches is not given.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from taxel.recording.grasp_tables import TaxelTable
from taxel.types import BoolArray, FloatArray

NEIGHBOUR_M: Final = 0.0055
"""Taxels of one board that lie nearer are neighbours: the four at the pitch of 5 mm, not the diagonal ones."""


@dataclass(frozen=True)
class Propagation:
    """Which taxels activate which others.

    reach_m: to taxels of the same board that lie nearer. from_counts: only taxels whose signal exceeds it do so; the
    thesis lets every active taxel do so.
    """

    reach_m: float = NEIGHBOUR_M
    from_counts: float = 0.0

    def neighbours(self, taxels: TaxelTable) -> csr_array:
        """Which taxels reach which, sparse f64[n, n] of ones, without the diagonal."""
        pairs = [np.empty((0, 2), np.int64)]
        for board in np.unique(taxels.sensor):
            own = np.flatnonzero(taxels.sensor == board)
            pairs.append(own[cKDTree(taxels.position[own]).query_pairs(self.reach_m, output_type="ndarray")])
        found = np.concatenate(pairs)
        rows, columns = np.concatenate([found, found[:, ::-1]]).T
        return csr_array((np.ones(len(rows)), (rows, columns)), shape=(taxels.n, taxels.n))

    def applied(self, active: BoolArray, signal: FloatArray, near: csr_array) -> tuple[BoolArray, FloatArray]:
        """Activity after contact has propagated, and its counts: bool[n], f64[n].

        A neighbour has the counts of the strongest active taxel beside it: what it felt itself is below the threshold.
        signal: f64[n], counts; near: of `neighbours`.
        """
        strength = np.where(active & (np.nan_to_num(signal) > self.from_counts), signal, 0.0)
        strongest = np.zeros(len(strength))
        rows = np.repeat(np.arange(len(strength)), np.diff(near.indptr))
        np.maximum.at(strongest, rows, strength[near.indices])
        return active | (strongest > 0.0), np.where(active, signal, strongest)
