"""Boards, lines and taxels that a simulated campaign loads: only faults on these are observable."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.blind.hidden import FaultLocation
from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_tables import TaxelTable

LOADED_COUNTS: Final = 150.0
"""Simulated signal above which a taxel counts as loaded."""

OBSERVABLE_COUNTS: Final = 60.0
"""Simulated signal above which the absence of the signal is clearly outside the noise."""


def loaded_locations(locations: Sequence[FaultLocation], sim: Path) -> list[FaultLocation]:
    """Select the fault locations (a board, a line or a taxel) of which at least one taxel has a simulated load.

    sim: simulated dataset.
    """
    table, max_signal = _max_signals(sim)
    return [
        location for location in locations if max_signal[_taxels_at(location, table)].max(initial=0.0) > LOADED_COUNTS
    ]


def find_observable_taxels(location: FaultLocation, sim: Path) -> list[int]:
    """List the taxels of a fault location whose missing signal would be observable in the dataset `sim`."""
    table, max_signal = _max_signals(sim)
    return np.flatnonzero(_taxels_at(location, table) & (max_signal > OBSERVABLE_COUNTS)).tolist()


def _max_signals(sim: Path) -> tuple[TaxelTable, NDArray[np.float64]]:
    """Return the taxel table of a dataset, and the largest signal of each taxel over all grasps, f64[n] counts."""
    with GraspDataset(sim) as data:
        table, max_signal = data.taxels, np.zeros(len(data.taxels.sensor))
        for grasp in data:
            counts = grasp.raw_counts.astype(np.float64)
            max_signal = np.maximum(max_signal, (counts[:10].mean(axis=0) - counts).max(axis=0))
    return table, max_signal


def _taxels_at(location: FaultLocation, table: TaxelTable) -> NDArray[np.bool_]:
    """Select the taxels of a fault location (a board, a TX or RX line, or one taxel): mask bool[n]."""
    if location.axis == "taxel":
        return np.asarray(np.arange(len(table.sensor)) == location.index)
    is_on_board = table.sensor == location.address
    is_on_line = (table.tx if location.axis == "tx" else table.rx) == location.index
    return np.asarray(is_on_board & is_on_line if location.axis else is_on_board)
