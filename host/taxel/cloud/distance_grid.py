"""Signed distances to a mesh, in bins on a grid around the mesh, to compare many thousand poses of a cloud with it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from taxel.cloud.mesh import TriangleMesh
from taxel.types import ByteArray, Float32Array, FloatArray

MIN_DISTANCE_M: Final = -0.010
MAX_DISTANCE_M: Final = 0.014
"""Range of the bins, metres; smaller and larger distances are counted in the first and in the last bin."""

BIN_WIDTH_M: Final = 0.00025
BIN_COUNT: Final = round((MAX_DISTANCE_M - MIN_DISTANCE_M) / BIN_WIDTH_M)

CELL_WIDTH_M: Final = 0.0005
"""Edge length of a grid cell. All points in a cell have the distance bin of the cell's centre, which causes an error of
the distance of 0.14 mm (standard deviation)."""

SAMPLE_SPACING_M: Final = 0.002
"""Spacing of the points at which the distance to the mesh is computed. Interpolation between these points shifts edges
with a radius of 2.5 mm by about 0.1 mm."""

MAX_SAMPLES: Final = 1_000_000
MAX_CELLS: Final = 2**24
"""Largest numbers of samples and of cells; the spacings are larger for an object that would need more. f32 represents
integers up to MAX_CELLS exactly."""

BATCH_POINTS: Final = 30_000
"""Number of points that are looked up together, small enough for the processor's caches."""


@dataclass(frozen=True, eq=False)
class DistanceGrid:
    """Grid of cells that contain the binned signed distance to a shape.

    bins: u8[x, y, z], number of the distance bin of each cell. origin: f64[3], corner of the first cell, metres.
    cell_m: edge length of a cell, metres.
    """

    bins: ByteArray
    origin: FloatArray
    cell_m: float

    @classmethod
    def from_mesh(cls, mesh: TriangleMesh) -> DistanceGrid:
        """Make a grid of binned signed distances to a mesh, over its bounding box extended by MAX_DISTANCE_M.

        The distance is computed at coarsely spaced samples and interpolated linearly to the centres of the cells.
        """
        origin = mesh.bounds[0] - MAX_DISTANCE_M
        extent = mesh.bounds[1] + MAX_DISTANCE_M - origin
        spacing = max(SAMPLE_SPACING_M, float(np.cbrt(np.prod(extent) / MAX_SAMPLES)))
        cell = CELL_WIDTH_M
        while np.prod(np.floor(extent / cell) + 1.0) > MAX_CELLS:
            cell *= 1.1
        axes = [origin[axis] + spacing * np.arange(int(extent[axis] / spacing) + 2) for axis in range(3)]
        samples = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        distances = mesh.compute_signed_distance(samples).reshape([len(steps) for steps in axes]).astype(np.float32)
        weights = [_linear_weights(int(extent[axis] / cell) + 1, cell / spacing, len(axes[axis])) for axis in range(3)]
        bins = np.empty([len(axis_weights) for axis_weights in weights], np.uint8)
        for row, weight in enumerate(weights[0]):  # one plane at a time, to bound the memory
            distance = weights[1] @ np.tensordot(weight, distances, 1) @ weights[2].T
            bins[row] = np.clip((distance - MIN_DISTANCE_M) / BIN_WIDTH_M, 0.0, BIN_COUNT - 1.0)
        return cls(bins, origin, cell)

    def count_points(
        self, points: Float32Array, active_count: int, rotations: FloatArray, shifts: FloatArray
    ) -> npt.NDArray[np.int64]:
        """Count the points of a cloud in each distance bin, for P poses of the cloud: i64[P, 2 BIN_COUNT].

        The first BIN_COUNT columns count the first `active_count` points, the other columns count the remaining points.
        points: f32[n, 3]. rotations: f64[P, 3, 3], about the origin. shifts: f64[P, 3], metres, applied after the
        rotation.
        """
        step = max(1, BATCH_POINTS // len(points))
        batches = [slice(low, low + step) for low in range(0, len(rotations), step)]
        counts = [self._count_batch(points, active_count, rotations[batch], shifts[batch]) for batch in batches]
        return np.concatenate(counts)

    def _count_batch(
        self, points: Float32Array, active_count: int, rotations: FloatArray, shifts: FloatArray
    ) -> npt.NDArray[np.int64]:
        """Count the active and inactive points in each distance bin for a batch of poses, i64[poses, 2 BIN_COUNT].

        points: f32[N, 3], the first `active_count` of them active. rotations: f64[poses, 3, 3]. shifts: f64[poses, 3],
        metres. Each moved point falls in a cell of the grid, whose value is the number of the distance bin.
        """
        scaled = (rotations / self.cell_m).astype(np.float32)
        offset = ((shifts - self.origin) / self.cell_m).astype(np.float32)
        cell = np.zeros((len(rotations), len(points)), np.float32)
        for axis, size in enumerate(self.bins.shape):
            along = scaled[:, axis] @ points.T
            along += offset[:, axis, None]
            np.clip(along, 0.0, size - 1.0, out=along)  # points beyond the grid take its border: the last bin
            np.floor(along, out=along)
            cell *= size  # index of the cell in the flattened grid, exact in f32 (see MAX_CELLS)
            cell += along
        columns = self.bins.ravel().take(cell.astype(np.intp)).astype(np.intp)
        # Every pose has its own range of numbers, so that one call of bincount counts the points of all poses.
        columns[:, active_count:] += BIN_COUNT
        columns += (2 * BIN_COUNT * np.arange(len(rotations)))[:, None]
        counts = np.bincount(columns.ravel(), minlength=2 * BIN_COUNT * len(rotations))
        return counts.reshape(len(rotations), 2 * BIN_COUNT)


def _linear_weights(cells: int, step: float, nodes: int) -> Float32Array:
    """Compute the weights of linear interpolation from nodes at 0, 1, 2 ... to the centres of cells, f32[cells, nodes].

    step: width of a cell, in node spacings.
    """
    centre = (np.arange(cells) + 0.5) * step
    return np.asarray(np.maximum(1.0 - np.abs(centre[:, None] - np.arange(nodes)), 0.0), np.float32)
