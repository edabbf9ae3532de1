"""Upright prisms, and the exact nearest surface point of any point.

A prism is a flat profile in x and y, extruded from z = 0 to z = height. Lengths are in millimetres.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from taxel.types import BoolArray, FloatArray


class Profile(Protocol):
    """A closed convex curve around the origin of the plane."""

    def evaluate(self, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the point and outward normal, f64[n, 2] each, at the relative arc lengths u, f64[n], 0 to 1."""
        ...

    def nearest(self, points: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Return the nearest curve point, f64[..., 2], of each point, and whether the point is inside the curve."""
        ...


@dataclass(frozen=True)
class Circle:
    """A circle of `radius` mm."""

    radius: float

    def evaluate(self, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the point and outward normal, f64[n, 2] each, of the circle at the relative arc lengths u f64[n], 0 to
        1.
        """
        angle = 2 * np.pi * u
        normal = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        return self.radius * normal, normal

    def nearest(self, points: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Return the nearest point of the circle, f64[..., 2], for each point, and whether the point is inside.

        For the centre, an arbitrary point of the circle is returned.
        """
        distance = np.sqrt(points[..., 0] ** 2 + points[..., 1] ** 2)
        scale = self.radius / np.maximum(distance, 1e-9)
        return points * scale[..., None], distance < self.radius


@dataclass(frozen=True, eq=False)
class Polygon:
    """A convex polygon. corners: f64[k, 2], mm, anticlockwise."""

    corners: FloatArray

    def evaluate(self, u: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return point and outward normal, f64[n, 2] each, of the outline at relative arc lengths u f64[n], 0 to 1."""
        edges = np.roll(self.corners, -1, axis=0) - self.corners
        lengths = np.linalg.norm(edges, axis=1)
        ends = np.cumsum(lengths)
        arc = u * ends[-1]
        index = np.minimum(np.searchsorted(ends, arc, side="right"), len(ends) - 1)
        along = (edges / lengths[:, None])[index]
        points = self.corners[index] + along * (arc - ends[index] + lengths[index])[:, None]
        return points, np.stack([along[:, 1], -along[:, 0]], axis=-1)

    def nearest(self, points: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Return the nearest point f64[..., 2] of the outline to each point, and whether the point is inside the
        polygon.
        """
        x, y = points[..., 0], points[..., 1]
        smallest = np.full(x.shape, np.inf)
        nearest = np.empty_like(points)
        is_inside = np.ones(x.shape, dtype=bool)
        for (x0, y0), (x1, y1) in zip(self.corners, np.roll(self.corners, -1, axis=0), strict=True):
            ex, ey, dx, dy = x1 - x0, y1 - y0, x - x0, y - y0
            part = np.clip((dx * ex + dy * ey) / (ex * ex + ey * ey), 0.0, 1.0)
            qx, qy = part * ex, part * ey
            squared = (dx - qx) ** 2 + (dy - qy) ** 2
            is_closer = squared < smallest
            smallest = np.where(is_closer, squared, smallest)
            nearest[..., 0] = np.where(is_closer, x0 + qx, nearest[..., 0])
            nearest[..., 1] = np.where(is_closer, y0 + qy, nearest[..., 1])
            is_inside &= ex * dy - ey * dx >= 0.0
        return nearest, is_inside


@dataclass(frozen=True, eq=False)
class Prism:
    """A profile extruded over `height` mm, closed at both ends."""

    profile: Profile
    height: float

    def nearest(self, points: FloatArray) -> FloatArray:
        """Return the nearest surface point, f64[..., 3], of each point, f64[..., 3], mm."""
        z = points[..., 2]
        side, is_inside = self.profile.nearest(points[..., :2])
        cap_z = np.where(z > self.height / 2, self.height, 0.0)
        is_between_caps = (z > 0.0) & (z < self.height)
        to_side = np.sqrt((points[..., 0] - side[..., 0]) ** 2 + (points[..., 1] - side[..., 1]) ** 2)
        to_cap = np.abs(z - cap_z)
        on_cap = is_inside & (~is_between_caps | (to_cap < to_side))
        result = np.empty_like(points)
        result[..., :2] = np.where(on_cap[..., None], points[..., :2], side)
        result[..., 2] = np.where(on_cap | ~is_between_caps, cap_z, z)
        return result


def make_box(width: float, depth: float, height: float) -> Prism:
    """Create a rectangular prism centred on the z axis; lengths in mm."""
    half = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * 0.5
    return Prism(Polygon(half * [width, depth]), height)


def make_cylinder(radius: float, height: float) -> Prism:
    """Create a cylinder about the z axis; lengths in mm."""
    return Prism(Circle(radius), height)


def make_triangle(base: float, leg: float, height: float) -> Prism:
    """Create a triangular prism with the sides base, leg and leg, and its centroid on the z axis; lengths in mm."""
    rise = float(np.sqrt(leg**2 - base**2 / 4))
    corners = np.array([[-base / 2, -rise / 3], [base / 2, -rise / 3], [0.0, 2 * rise / 3]])
    return Prism(Polygon(corners), height)
