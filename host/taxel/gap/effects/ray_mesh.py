"""An object's mesh, met by rays: as the solid between planes where it is convex, else triangle by triangle."""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from taxel.grasp.shapes import ConvexPolytope, ShapeError
from taxel.recording.grasp_tables import ObjectMesh
from taxel.types import FloatArray

LEAST_DETERMINANT: Final = 1e-15
"""Square metres; a triangle that a ray sees smaller is met edge-on."""

MOST_AT_ONCE: Final = 200_000
"""Rays times triangles: what stays in a core's cache."""

CONVEX: Final = 0.999
"""Share of its hull that a solid fills if it counts as convex."""


class Mesh:
    """An object's mesh as something that a ray can meet."""

    def __init__(self, mesh: ObjectMesh) -> None:
        self._triangles = mesh.vertices[mesh.faces]
        self._shape = _convex(mesh)

    def separation(self, points: FloatArray, directions: FloatArray) -> FloatArray:
        """Signed distances from points f64[m, e, 3] along their ray f64[m, 3] to where it enters, f64[m, e]; inf where
        it misses.
        """
        if self._shape is not None:
            return self._shape.ray_separation(points, directions[:, None])
        rays = np.repeat(directions, points.shape[1], axis=0)
        return _through_triangles(self._triangles, points.reshape(-1, 3), rays).reshape(points.shape[:2])


def _convex(mesh: ObjectMesh) -> ConvexPolytope | None:
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    volume = float(np.einsum("fi,fi->", a, np.cross(b, c))) / 6.0
    try:
        if volume < CONVEX * ConvexHull(mesh.vertices).volume:
            return None
        return ConvexPolytope.from_mesh(mesh.vertices)
    except (QhullError, ShapeError):
        return None


def _through_triangles(triangles: FloatArray, points: FloatArray, directions: FloatArray) -> FloatArray:
    """Moller and Trumbore 1997, their triple products written so that what hangs on rays and on triangles are factors
    of matrices; the entry that lies nearest to the point counts.
    """
    corner = triangles[:, 0]
    first, second = triangles[:, 1] - corner, triangles[:, 2] - corner
    normal, about_second, about_first = np.cross(first, second), np.cross(second, corner), np.cross(corner, first)
    level = np.einsum("ti,ti->t", corner, normal)
    nearest = np.full(len(points), np.inf)
    for rows in np.array_split(np.arange(len(points)), -(-len(points) * len(triangles) // MOST_AT_ONCE) or 1):
        ray, moment = directions[rows], np.cross(points[rows], directions[rows])
        determinant = -(ray @ normal.T)
        u = moment @ second.T - ray @ about_second.T
        v = -(moment @ first.T) - ray @ about_first.T
        # A positive determinant: the ray comes from outside.
        hit = (determinant > LEAST_DETERMINANT) & (u >= 0) & (v >= 0) & (u + v <= determinant)
        ray_at, triangle = np.nonzero(hit)
        at = (points[rows][ray_at] * normal[triangle]).sum(axis=1) - level[triangle]
        at /= determinant[ray_at, triangle]
        order = np.argsort(np.abs(at), kind="stable")[::-1]
        nearest[rows[ray_at[order]]] = at[order]  # the last one stays: the nearest
    return nearest
