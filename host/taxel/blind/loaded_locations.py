"""Boards, lines and taxels that a simulated campaign loads: only faults on these are observable."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Self

import numpy as np
from numpy.typing import NDArray

from taxel.blind.hidden import FaultLocation
from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_tables import TaxelTable

LOADED_COUNTS: Final = 150.0
"""Simulated signal above which a taxel is treated as loaded."""

OBSERVABLE_COUNTS: Final = 60.0
"""Simulated signal above which the absence of the signal is clearly outside the noise."""


@dataclass(frozen=True, eq=False)
class SimulatedLoads:
    """Largest simulated signal of each taxel over all grasps, f64[n] counts, with the table of the taxels."""

    table: TaxelTable
    max_signal: NDArray[np.float64]

    @classmethod
    def read(cls, sim: Path) -> Self:
        """Read the loads of a simulated dataset; the baseline is the mean of the first ten frames. Raises
        DatasetError.
        """
        with GraspDataset(sim) as data:
            table, max_signal = data.taxels, np.zeros(len(data.taxels.sensor))
            for grasp in data:
                counts = grasp.raw_counts.astype(np.float64)
                max_signal = np.maximum(max_signal, (counts[:10].mean(axis=0) - counts).max(axis=0))
        return cls(table, max_signal)

    def select_loaded(self, locations: Sequence[FaultLocation]) -> list[FaultLocation]:
        """Select the locations (a board, a line or a taxel) of which at least one taxel has a load."""
        return [
            location
            for location in locations
            if self.max_signal[_taxels_at(location, self.table)].max(initial=0.0) > LOADED_COUNTS
        ]

    def find_observable(self, location: FaultLocation) -> list[int]:
        """List the taxels of a location whose missing signal would be observable."""
        return np.flatnonzero(_taxels_at(location, self.table) & (self.max_signal > OBSERVABLE_COUNTS)).tolist()

    def compute_board_share(self, addresses: Collection[int]) -> float:
        """Compute the share of the boards with these I2C addresses in the sum of the taxels' largest signals, 0 to
        1.
        """
        total = max(float(self.max_signal.sum()), np.finfo(float).tiny)
        return float(self.max_signal[np.isin(self.table.sensor, list(addresses))].sum()) / total


def loaded_locations(locations: Sequence[FaultLocation], sim: Path) -> list[FaultLocation]:
    """Select the fault locations that a simulated dataset loads (`SimulatedLoads.select_loaded`)."""
    return SimulatedLoads.read(sim).select_loaded(locations)


def find_observable_taxels(location: FaultLocation, sim: Path) -> list[int]:
    """List the observable taxels of a fault location in a simulated dataset (`SimulatedLoads.find_observable`)."""
    return SimulatedLoads.read(sim).find_observable(location)


def _taxels_at(location: FaultLocation, table: TaxelTable) -> NDArray[np.bool_]:
    """Select the taxels of a fault location (a board, a TX or RX line, or one taxel): mask bool[n]."""
    if location.axis == "taxel":
        return np.asarray(np.arange(len(table.sensor)) == location.index)
    is_on_board = table.sensor == location.address
    is_on_line = (table.tx if location.axis == "tx" else table.rx) == location.index
    return np.asarray(is_on_board & is_on_line if location.axis else is_on_board)
