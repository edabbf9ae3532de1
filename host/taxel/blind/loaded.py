"""Which boards, lines and taxels a simulated campaign presses: only there a break can be asked for."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.blind.hidden import Place
from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_tables import TaxelTable

LOADED_COUNTS: Final = 150.0
"""A taxel on which the simulator expects as much was pressed."""

SHOWN_COUNTS: Final = 60.0
"""And one of which as much is expected stands out of noise, so that its silence tells something."""


def loaded(places: Sequence[Place], sim: Path) -> list[Place]:
    """Those of the places on which the simulator's dataset `sim` expects a press."""
    table, most = _expected(sim)
    return [place for place in places if most[_at(place, table)].max(initial=0.0) > LOADED_COUNTS]


def taxels_that_show(place: Place, sim: Path) -> list[int]:
    """Taxels of a place whose silence would be noticed in the presses of `sim`."""
    table, most = _expected(sim)
    return np.flatnonzero(_at(place, table) & (most > SHOWN_COUNTS)).tolist()


def _expected(sim: Path) -> tuple[TaxelTable, NDArray[np.float64]]:
    """The taxels of a dataset, and the largest signal of each in all grasps, counts, f64[n]."""
    with GraspDataset(sim) as data:
        table, most = data.taxels, np.zeros(len(data.taxels.sensor))
        for grasp in data:
            counts = grasp.raw_counts.astype(np.float64)
            most = np.maximum(most, (counts[:10].mean(axis=0) - counts).max(axis=0))
    return table, most


def _at(place: Place, table: TaxelTable) -> NDArray[np.bool_]:
    """Its taxels, bool[n]."""
    if place.axis == "taxel":
        return np.asarray(np.arange(len(table.sensor)) == place.index)
    own = table.sensor == place.address
    line = (table.tx if place.axis == "tx" else table.rx) == place.index
    return np.asarray(own & line if place.axis else own)
