"""Places of taxels: a regular grid, or arrays of a file."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from taxel.recording.general.format import TaxelPlaces


@dataclass(frozen=True)
class Grid:
    """A regular grid of taxels, which are numbered row by row.

    pitch_m: distance between neighbouring taxels, metres. pads: number of equal grids, one for each pad of the sensor.
    """

    rows: int
    columns: int
    pitch_m: float
    pads: int = 1


def make_grid_places(grid: Grid) -> TaxelPlaces:
    """Return the places of the taxels of grids in the plane z = 0, with the first taxel at the origin.

    x increases along a row and y along a column; the outward normal is +z. All pads have the same positions; the sensor
    number of a taxel is the number of its pad, None with one pad.
    """
    count = grid.rows * grid.columns
    row, column = np.divmod(np.arange(count), grid.columns)
    position = np.column_stack([column * grid.pitch_m, row * grid.pitch_m, np.zeros(count)])
    total = count * grid.pads
    return TaxelPlaces(
        sensor=np.repeat(np.arange(grid.pads), count) if grid.pads > 1 else None,
        position=np.tile(position, (grid.pads, 1)),
        normal=np.tile([0.0, 0.0, 1.0], (total, 1)),
        size=np.full(total, grid.pitch_m),
    )
