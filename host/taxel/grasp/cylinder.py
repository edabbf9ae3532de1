"""Upright cylinder with exact rays and distances."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from taxel.grasp.shape import ShapeError, as_points, check_sizes
from taxel.types import FloatArray, Int32Array


@dataclass(frozen=True)
class Cylinder:
    """Upright cylinder about the z axis with its bottom at z = 0; metres. Raises ShapeError for invalid sizes."""

    radius: float
    height: float

    def __post_init__(self) -> None:
        """Check that the sizes are above 0. Raises ShapeError."""
        check_sizes("cylinder", radius=self.radius, height=self.height)

    @property
    def bounds(self) -> FloatArray:
        """Smallest and largest coordinates of the cylinder, f64[2, 3], metres."""
        r = self.radius
        return np.array([[-r, -r, 0.0], [r, r, self.height]])

    def mesh(self, resolution: int = 64) -> tuple[FloatArray, Int32Array]:
        """Triangulate the cylinder: vertices f64[v, 3] and triangles i32[f, 3] with outward orientation.

        resolution: number of vertices on each circle, at least 3 (else ShapeError).
        """
        if resolution < 3:
            raise ShapeError("cylinder", "a resolution of at least 3", str(resolution))
        angles = 2 * np.pi * np.arange(resolution) / resolution
        circle = self.radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        low = np.column_stack([circle, np.zeros(resolution)])
        high = np.column_stack([circle, np.full(resolution, self.height)])
        # The last two vertices are the centres of the caps.
        vertices = np.concatenate([low, high, [[0.0, 0.0, 0.0], [0.0, 0.0, self.height]]])
        i = np.arange(resolution)
        j = (i + 1) % resolution
        bottom, top = np.full_like(i, 2 * resolution), np.full_like(i, 2 * resolution + 1)
        parts = [(i, j, j + resolution), (i, j + resolution, i + resolution), (bottom, j, i)]
        parts.append((top, i + resolution, j + resolution))
        return vertices, np.concatenate([np.stack(part, axis=1) for part in parts]).astype(np.int32)

    def ray_separation(self, points: npt.ArrayLike, directions: npt.ArrayLike) -> FloatArray:
        """Compute the distance from points to the cylinder along unit directions, f64[...] metres.

        points, directions: f64[..., 3]. Negative inside the cylinder; +inf for a miss. Implements
        `Shape.ray_separation`.
        """
        return self._clip_lines(points, directions)[0]

    def ray_entry(self, points: npt.ArrayLike, directions: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Compute where rays enter the cylinder: distance f64[...], metres, and outward unit normal f64[..., 3].

        points, directions: f64[..., 3]. A miss has the distance +inf and the normal 0. Implements `Shape.ray_entry`.
        """
        separation, is_lateral = self._clip_lines(points, directions)
        is_hit = np.isfinite(separation)
        p, d = np.broadcast_arrays(as_points(points), as_points(directions))
        normal = (p + np.where(is_hit, separation, 0.0)[..., None] * d) / self.radius
        normal[..., 2] = 0.0
        cap = np.where(is_lateral, 0.0, -np.sign(d[..., 2]))[..., None] * np.array([0.0, 0.0, 1.0])
        return separation, np.where(is_hit[..., None], np.where(is_lateral[..., None], normal, cap), 0.0)

    def _clip_lines(self, points: npt.ArrayLike, directions: npt.ArrayLike) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
        """Clip lines by the lateral surface and the caps of the cylinder.

        points, directions: f64[..., 3]. Returns the distance to the entry, f64[...], inf for a miss, and whether each
        line enters through the lateral surface.
        """
        p, d = np.broadcast_arrays(as_points(points), as_points(directions))
        lateral_in, lateral_out = self._clip_lateral(p, d)
        z, dz = p[..., 2], d[..., 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            low, high = -z / dz, (self.height - z) / dz
        is_horizontal = dz == 0
        is_between = (z >= 0) & (z <= self.height)
        cap_in = np.where(is_horizontal, np.where(is_between, -np.inf, np.inf), np.minimum(low, high))
        cap_out = np.where(is_horizontal, np.where(is_between, np.inf, -np.inf), np.maximum(low, high))
        enter, leave = np.maximum(lateral_in, cap_in), np.minimum(lateral_out, cap_out)
        return np.where((enter <= leave) & (leave >= 0), enter, np.inf), lateral_in >= cap_in

    def _clip_lateral(self, p: FloatArray, d: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Compute where lines p + t d enter and leave the infinitely long cylinder, as two values of t.

        p, d: f64[..., 3]. The result is (inf, -inf) for a miss.
        """
        x, y, dx, dy = p[..., 0], p[..., 1], d[..., 0], d[..., 1]
        a, b, c = dx * dx + dy * dy, x * dx + y * dy, x * x + y * y - self.radius**2
        # b^2 - a c by Lagrange's identity, which avoids cancellation far from the cylinder.
        discriminant = a * self.radius**2 - (x * dy - y * dx) ** 2
        root = np.sqrt(np.maximum(discriminant, 0.0))
        q = -(b + np.copysign(root, b))
        with np.errstate(divide="ignore", invalid="ignore"):
            root_1 = q / a
            # q is 0 only at a point of tangency, where both roots are 0.
            root_2 = np.where(q == 0, root_1, c / q)
        is_vertical = a == 0
        is_inside = c <= 0
        is_miss = np.where(is_vertical, ~is_inside, discriminant < 0)
        enter = np.where(is_vertical, -np.inf, np.minimum(root_1, root_2))
        leave = np.where(is_vertical, np.inf, np.maximum(root_1, root_2))
        return np.where(is_miss, np.inf, enter), np.where(is_miss, -np.inf, leave)

    def view_faces(self, tops: FloatArray, axes: FloatArray, min_slope: float) -> tuple[FloatArray, FloatArray]:
        """Compute how deep m columns of a soft layer lie below the wall, the bottom and the top of the cylinder.

        tops, axes: upper ends and outward unit directions of the columns, f64[m, 3]. Returns the depths f64[m, 3],
        distances from the upper end to each face against the axis, metres, and the outward unit normals of the faces,
        f64[m, 3, 3]. min_slope: least cosine between axis and inward normal, so that a side face has a finite depth.
        The wall is a plane tangential to the cylinder. Implements `Shape.view_faces`.
        """
        radius = np.hypot(tops[:, 0], tops[:, 1])
        outward = np.divide(
            tops[:, :2], radius[:, None], out=np.tile([1.0, 0.0], (len(tops), 1)), where=radius[:, None] > 0
        )
        # The line against the axis leaves the wall where |p - t d| = R in the plane across the cylinder.
        a, b = (axes[:, :2] ** 2).sum(axis=1), (tops[:, :2] * axes[:, :2]).sum(axis=1)
        root = np.sqrt(np.maximum(b * b + a * (self.radius**2 - radius**2), 0.0))
        with np.errstate(divide="ignore", invalid="ignore"):
            crossing = np.where((radius < self.radius) & (a > 0), (b + root) / a, np.inf)
        wall = self.radius - radius
        is_crossing = crossing < wall / min_slope
        slope_outside = np.where(wall > 0, 0.0, -(outward * axes[:, :2]).sum(axis=1))
        depth = np.where(is_crossing, crossing, wall / np.maximum(slope_outside, min_slope))
        at_wall = (tops[:, :2] - np.where(is_crossing, crossing, 0.0)[:, None] * axes[:, :2]) / self.radius
        normals = np.zeros((len(tops), 3, 3))
        normals[:, 0, :2] = np.where(is_crossing[:, None], at_wall, outward)
        normals[:, 1:, 2] = (-1.0, 1.0)
        bottom = tops[:, 2] / np.maximum(axes[:, 2], min_slope)
        top = (self.height - tops[:, 2]) / np.maximum(-axes[:, 2], min_slope)
        return np.column_stack([depth, bottom, top]), normals

    def signed_distance(self, points: npt.ArrayLike) -> FloatArray:
        """Compute the distance of points f64[..., 3] to the cylinder's surface, f64[...] metres; negative inside."""
        p = as_points(points)
        radial = np.hypot(p[..., 0], p[..., 1]) - self.radius
        axial = np.abs(p[..., 2] - self.height / 2) - self.height / 2
        outside = np.hypot(np.maximum(radial, 0.0), np.maximum(axial, 0.0))
        return outside + np.minimum(np.maximum(radial, axial), 0.0)

    def distance_bound(self, points: npt.ArrayLike) -> FloatArray:
        """Compute a lower bound of the signed distance, f64[...]; for a cylinder, the distance itself."""
        return self.signed_distance(points)
