"""Signed distance to a mesh in bins, on a grid about it: many thousand poses of a cloud are tried against one mesh."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from taxel.cloud.mesh import TriangleMesh
from taxel.types import ByteArray, Float32Array, FloatArray

LOW_M: Final = -0.010
HIGH_M: Final = 0.014
"""Distances are counted in bins between these; beyond them in the first and the last."""

BIN_M: Final = 0.00025
BINS: Final = round((HIGH_M - LOW_M) / BIN_M)

CELL_M: Final = 0.0005
"""Edge of a cell, all of which has the bin of its middle: distances are off by 0.14 mm (standard deviation)."""

WORKED_OUT_M: Final = 0.002
"""Between places where the distance to the mesh is worked out; interpolation between them blurs edges that are rounded
by 2.5 mm by about 0.1 mm."""

MOST_PLACES: Final = 1_000_000
MOST_CELLS: Final = 2**24
"""Both lengths grow for an object so large that there were more. Up to this number f32 holds whole numbers exactly."""

AT_ONCE: Final = 30_000
"""Places that are looked up together: they stay in the processor's caches."""


@dataclass(frozen=True, eq=False)
class DistanceGrid:
    """Bins of cells, u8[x, y, z], of edge cell_m; the grid begins at `low`, f64[3], metres."""

    bins: ByteArray
    low: FloatArray
    cell_m: float

    @classmethod
    def of(cls, mesh: TriangleMesh) -> DistanceGrid:
        """Of a mesh and what lies within HIGH_M of its bounds."""
        low = mesh.bounds[0] - HIGH_M
        extent = mesh.bounds[1] + HIGH_M - low
        coarse = max(WORKED_OUT_M, float(np.cbrt(np.prod(extent) / MOST_PLACES)))
        cell = CELL_M
        while np.prod(np.floor(extent / cell) + 1.0) > MOST_CELLS:
            cell *= 1.1
        along = [low[axis] + coarse * np.arange(int(extent[axis] / coarse) + 2) for axis in range(3)]
        places = np.stack(np.meshgrid(*along, indexing="ij"), axis=-1).reshape(-1, 3)
        worked_out = mesh.signed_distance(places).reshape([len(steps) for steps in along]).astype(np.float32)
        weights = [_linear(int(extent[axis] / cell) + 1, cell / coarse, len(along[axis])) for axis in range(3)]
        bins = np.empty([len(each) for each in weights], np.uint8)
        for row, weight in enumerate(weights[0]):  # a plane at a time, to bound the memory
            distance = weights[1] @ np.tensordot(weight, worked_out, 1) @ weights[2].T
            bins[row] = np.clip((distance - LOW_M) / BIN_M, 0.0, BINS - 1.0)
        return cls(bins, low, cell)

    def counted(self, places: Float32Array, first: int, turns: FloatArray, shifts: FloatArray) -> npt.NDArray[np.int64]:
        """How many of the places f32[n, 3] lie in each bin when they are turned by turns f64[P, 3, 3] about the origin
        and shifted by shifts f64[P, 3]: i64[P, 2 BINS], the `first` of them and then the others.
        """
        step = max(1, AT_ONCE // len(places))
        parts = [slice(low, low + step) for low in range(0, len(turns), step)]
        return np.concatenate([self._counted(places, first, turns[part], shifts[part]) for part in parts])

    def _counted(
        self, places: Float32Array, first: int, turns: FloatArray, shifts: FloatArray
    ) -> npt.NDArray[np.int64]:
        moved = (turns / self.cell_m).astype(np.float32)
        begin = ((shifts - self.low) / self.cell_m).astype(np.float32)
        cell = np.zeros((len(turns), len(places)), np.float32)
        for axis, size in enumerate(self.bins.shape):
            along = moved[:, axis] @ places.T
            along += begin[:, axis, None]
            np.clip(along, 0.0, size - 1.0, out=along)  # beyond the grid: what its border has, the last bin
            np.floor(along, out=along)
            cell *= size
            cell += along
        found = self.bins.ravel().take(cell.astype(np.intp)).astype(np.intp)
        found[:, first:] += BINS
        found += (2 * BINS * np.arange(len(turns)))[:, None]
        return np.bincount(found.ravel(), minlength=2 * BINS * len(turns)).reshape(len(turns), 2 * BINS)


def _linear(cells: int, step: float, nodes: int) -> Float32Array:
    """Weights of nodes 0, 1 ... in the middles of cells of width `step`, by linear interpolation: f32[cells, nodes]."""
    middle = (np.arange(cells) + 0.5) * step
    return np.asarray(np.maximum(1.0 - np.abs(middle[:, None] - np.arange(nodes)), 0.0), np.float32)
