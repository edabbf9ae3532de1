"""An upright cylinder."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from taxel.grasp.shape import ShapeError, as_points, check_sizes
from taxel.types import FloatArray, Int32Array


@dataclass(frozen=True)
class Cylinder:
    """An upright cylinder about the z axis, bottom at z = 0; metres. Raises ShapeError for a size of 0."""

    radius: float
    height: float

    def __post_init__(self) -> None:
        check_sizes("cylinder", radius=self.radius, height=self.height)

    @property
    def bounds(self) -> FloatArray:
        """Smallest and largest coordinates, f64[2, 3]."""
        r = self.radius
        return np.array([[-r, -r, 0.0], [r, r, self.height]])

    def mesh(self, resolution: int = 64) -> tuple[FloatArray, Int32Array]:
        """See `Shape`. `resolution`: corners of each cap, which lie on the circle; at least 3 (ShapeError)."""
        if resolution < 3:
            raise ShapeError("cylinder", "a resolution of at least 3", str(resolution))
        angles = 2 * np.pi * np.arange(resolution) / resolution
        ring = self.radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        low = np.column_stack([ring, np.zeros(resolution)])
        high = np.column_stack([ring, np.full(resolution, self.height)])
        vertices = np.concatenate([low, high, [[0.0, 0.0, 0.0], [0.0, 0.0, self.height]]])
        i = np.arange(resolution)
        j = (i + 1) % resolution
        bottom, top = np.full_like(i, 2 * resolution), np.full_like(i, 2 * resolution + 1)
        parts = [(i, j, j + resolution), (i, j + resolution, i + resolution), (bottom, j, i)]
        parts.append((top, i + resolution, j + resolution))
        return vertices, np.concatenate([np.stack(part, axis=1) for part in parts]).astype(np.int32)

    def ray_separation(self, points: npt.ArrayLike, directions: npt.ArrayLike) -> FloatArray:
        """See `Shape`."""
        return self._clip(points, directions)[0]

    def ray_entry(self, points: npt.ArrayLike, directions: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """See `Shape`."""
        separation, by_wall = self._clip(points, directions)
        hit = np.isfinite(separation)
        p, d = np.broadcast_arrays(as_points(points), as_points(directions))
        normal = (p + np.where(hit, separation, 0.0)[..., None] * d) / self.radius
        normal[..., 2] = 0.0
        cap = np.where(by_wall, 0.0, -np.sign(d[..., 2]))[..., None] * np.array([0.0, 0.0, 1.0])
        return separation, np.where(hit[..., None], np.where(by_wall[..., None], normal, cap), 0.0)

    def _clip(self, points: npt.ArrayLike, directions: npt.ArrayLike) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
        """Separation, and whether by the wall: the line clipped by the round wall and by the two caps."""
        p, d = np.broadcast_arrays(as_points(points), as_points(directions))
        wall_in, wall_out = self._wall(p, d)
        z, dz = p[..., 2], d[..., 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            low, high = -z / dz, (self.height - z) / dz
        level = dz == 0
        between = (z >= 0) & (z <= self.height)
        cap_in = np.where(level, np.where(between, -np.inf, np.inf), np.minimum(low, high))
        cap_out = np.where(level, np.where(between, np.inf, -np.inf), np.maximum(low, high))
        enter, leave = np.maximum(wall_in, cap_in), np.minimum(wall_out, cap_out)
        return np.where((enter <= leave) & (leave >= 0), enter, np.inf), wall_in >= cap_in

    def _wall(self, p: FloatArray, d: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Where lines enter and leave the endless cylinder; an empty interval where they miss it."""
        x, y, dx, dy = p[..., 0], p[..., 1], d[..., 0], d[..., 1]
        a, b, c = dx * dx + dy * dy, x * dx + y * dy, x * x + y * y - self.radius**2
        # b^2 - a c by Lagrange's identity: no cancellation far from the cylinder.
        discriminant = a * self.radius**2 - (x * dy - y * dx) ** 2
        root = np.sqrt(np.maximum(discriminant, 0.0))
        q = -(b + np.copysign(root, b))
        with np.errstate(divide="ignore", invalid="ignore"):
            one = q / a
            # q is 0 only for a point at which the line touches: both roots are 0.
            two = np.where(q == 0, one, c / q)
        upright = a == 0
        inside = c <= 0
        miss = np.where(upright, ~inside, discriminant < 0)
        enter = np.where(upright, -np.inf, np.minimum(one, two))
        leave = np.where(upright, np.inf, np.maximum(one, two))
        return np.where(miss, np.inf, enter), np.where(miss, -np.inf, leave)

    def signed_distance(self, points: npt.ArrayLike) -> FloatArray:
        """See `Shape`."""
        p = as_points(points)
        radial = np.hypot(p[..., 0], p[..., 1]) - self.radius
        axial = np.abs(p[..., 2] - self.height / 2) - self.height / 2
        outside = np.hypot(np.maximum(radial, 0.0), np.maximum(axial, 0.0))
        return outside + np.minimum(np.maximum(radial, axial), 0.0)

    def distance_bound(self, points: npt.ArrayLike) -> FloatArray:
        """See `Shape`."""
        return self.signed_distance(points)
