"""Intersections of rays with the mesh of an object: half-spaces for a convex object, else its triangles."""

from __future__ import annotations

from typing import Final

import numpy as np

from taxel.grasp.polytope import make_convex_polytope
from taxel.recording.grasp_tables import ObjectMesh
from taxel.types import FloatArray

MIN_DETERMINANT_M2: Final = 1e-15
"""Smallest determinant of ray and triangle, square metres: twice the area of the triangle in the projection along the
ray. A triangle with a smaller determinant is treated as parallel to the ray, without an intersection."""

MAX_RAY_TRIANGLE_PAIRS: Final = 200_000
"""Largest number of rays times triangles that are computed together. Chosen: the arrays fit into a core's cache."""


class RayMesh:
    """Mesh of an object, prepared for intersections with rays."""

    def __init__(self, mesh: ObjectMesh) -> None:
        self._triangles = mesh.vertices[mesh.faces]
        self._shape = make_convex_polytope(mesh.vertices, mesh.faces)

    def compute_separation(self, points: FloatArray, directions: FloatArray) -> FloatArray:
        """Return the signed distances along rays from points to the surface at which the ray enters the object, metres,
        f64[m, e]; negative for a point inside the object, infinite where the ray misses the object.

        points: f64[m, e, 3], metres, e points of each of m taxels. directions: f64[m, 3], unit vectors, one for all
        points of a taxel.
        """
        if self._shape is not None:
            return self._shape.ray_separation(points, directions[:, None])
        rays = np.repeat(directions, points.shape[1], axis=0)
        return _compute_triangle_separation(self._triangles, points.reshape(-1, 3), rays).reshape(points.shape[:2])


def _compute_triangle_separation(triangles: FloatArray, points: FloatArray, directions: FloatArray) -> FloatArray:
    """Return the signed distance from each point along its ray to the nearest entry into the triangles, f64[m] (m
    taxels of the board).

    points, directions: f64[m, 3]. triangles: f64[t, 3, 3]. Intersection by Moller and Trumbore (1997), with the triple
    products as matrix products of a factor of the rays and a factor of the triangles.
    """
    corner = triangles[:, 0]
    first, second = triangles[:, 1] - corner, triangles[:, 2] - corner
    normal, second_moment, first_moment = np.cross(first, second), np.cross(second, corner), np.cross(corner, first)
    level = np.einsum("ti,ti->t", corner, normal)
    nearest = np.full(len(points), np.inf)
    # Blocks of rays limit the memory; the number of blocks, -(-a // b), is rounded up.
    for rows in np.array_split(np.arange(len(points)), -(-len(points) * len(triangles) // MAX_RAY_TRIANGLE_PAIRS) or 1):
        ray, moment = directions[rows], np.cross(points[rows], directions[rows])
        determinant = -(ray @ normal.T)
        u = moment @ second.T - ray @ second_moment.T
        v = -(moment @ first.T) - ray @ first_moment.T
        # The determinant is positive if the ray enters the object.
        is_hit = (determinant > MIN_DETERMINANT_M2) & (u >= 0) & (v >= 0) & (u + v <= determinant)
        ray_index, triangle = np.nonzero(is_hit)
        distance = (points[rows][ray_index] * normal[triangle]).sum(axis=1) - level[triangle]
        distance /= determinant[ray_index, triangle]
        order = np.argsort(np.abs(distance), kind="stable")[::-1]
        # Of several values for a ray the last one remains, which is the nearest.
        nearest[rows[ray_index[order]]] = distance[order]
    return nearest
