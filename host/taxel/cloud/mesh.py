"""A closed triangle mesh: where its surface is, how far points are from it, and points on it."""

from __future__ import annotations

import atexit
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final
from weakref import WeakSet

import igl
import numpy as np
import numpy.typing as npt

from taxel.cloud.contact_cloud import unusable, usable
from taxel.cloud.errors import MeshError
from taxel.types import FloatArray, IntArray

ON_SURFACE: Final = 1e-9
"""Share of the mesh's size; a point nearer than this lies on the surface, and the surface's normal is that of its
face."""

ON_EDGE: Final = 1e-6
"""Barycentric coordinate below which a point of a face lies on its edge."""


_WITH_TREE: WeakSet[TriangleMesh] = WeakSet()


@atexit.register
def _drop_trees() -> None:
    """The library complains on standard error about trees that outlive it."""
    for mesh in _WITH_TREE:
        mesh.__dict__.pop("_tree", None)


@dataclass(frozen=True, eq=False)
class Closest:
    """Of N points: the nearest point of a surface.

    distance: f64[N], metres. point: f64[N, 3]. normal: f64[N, 3], unit, from the nearest point to the point; the face's
    own where the point lies on the surface. face: i64[N], on which the nearest point lies.
    """

    distance: FloatArray
    point: FloatArray
    normal: FloatArray
    face: IntArray


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """A surface without holes.

    name: for messages. vertices: f64[v, 3], metres. faces: i64[f, 3], wound outward; a mesh that is wound inward
    throughout is turned around.

    Raises MeshError for vertices that are not finite, faces of vertices that are not there, an edge that is not shared
    by two faces with opposite directions (a hole, a flap, faces wound against each other), or no volume.
    """

    name: str
    vertices: FloatArray
    faces: npt.NDArray[np.signedinteger[Any]]

    def __post_init__(self) -> None:
        vertices = np.ascontiguousarray(self.vertices, dtype=np.float64)
        faces = np.ascontiguousarray(self.faces, dtype=np.int64)
        _check_arrays(self.name, vertices, faces)
        _check_closed(self.name, faces)
        volume = _volume(vertices, faces)
        if abs(volume) < 1e-12 * float(np.ptp(vertices, axis=0).max()) ** 3:
            raise MeshError(self.name, "faces", "a solid with a volume", "a flat surface", "use a mesh of a solid")
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "faces", faces if volume > 0 else np.ascontiguousarray(faces[:, ::-1]))

    def __reduce__(self) -> tuple[type[TriangleMesh], tuple[str, FloatArray, IntArray]]:
        return TriangleMesh, (self.name, self.vertices, self.faces)  # without the tree, which cannot be pickled

    @cached_property
    def bounds(self) -> FloatArray:
        """Smallest and largest coordinates, f64[2, 3]."""
        return np.stack([self.vertices.min(axis=0), self.vertices.max(axis=0)])

    @cached_property
    def size(self) -> float:
        """Diagonal of the bounds, metres."""
        return float(np.linalg.norm(self.bounds[1] - self.bounds[0]))

    @cached_property
    def _crosses(self) -> FloatArray:
        a, b, c = (self.vertices[self.faces[:, corner]] for corner in range(3))
        return np.cross(b - a, c - a)

    @cached_property
    def areas(self) -> FloatArray:
        """f64[f], square metres."""
        return np.asarray(0.5 * np.linalg.norm(self._crosses, axis=1))

    @cached_property
    def normals(self) -> FloatArray:
        """Outward unit normals of the faces, f64[f, 3]; 0 for a face without an area."""
        twice = 2.0 * self.areas[:, None]
        return np.divide(self._crosses, twice, out=np.zeros_like(self._crosses), where=twice > 0)

    @cached_property
    def _tree(self) -> Any:
        tree = igl.AABB()
        tree.init(self.vertices, self.faces)
        _WITH_TREE.add(self)
        return tree

    def closest(self, points: FloatArray) -> Closest:
        """The nearest points of the surface to points f64[N, 3], exact. Points must be finite."""
        squared, face, nearest = self._tree.squared_distance(
            self.vertices, self.faces, np.ascontiguousarray(points, dtype=np.float64)
        )
        distance = np.sqrt(squared)
        on = distance <= ON_SURFACE * self.size
        normal = np.where(on[:, None], self.normals[face], points - nearest)
        normal /= np.where(on, 1.0, distance)[:, None]
        return Closest(distance, nearest, normal, face)

    def on_edges(self, near: Closest) -> tuple[IntArray, FloatArray, IntArray]:
        """Which nearest points lie on an edge, i64[e], and its unit direction, f64[e, 3]; which on a corner, i64[c].

        Those inside a face are neither; a point on the surface itself counts as such.
        """
        corners = self.vertices[self.faces[near.face]]
        outside = near.distance > ON_SURFACE * self.size
        zero = _weights(corners, near.point) < ON_EDGE
        zeros = zero.sum(axis=1)
        edge = np.flatnonzero(outside & (zeros == 1))
        across = zero[edge].argmax(axis=1)
        ends = corners[edge, (across + 1) % 3], corners[edge, (across + 2) % 3]
        direction = ends[1] - ends[0]
        return edge, direction / np.linalg.norm(direction, axis=1)[:, None], np.flatnonzero(outside & (zeros == 2))

    def signed_distance(self, points: FloatArray) -> FloatArray:
        """Distance to the surface, negative inside, f64[N], metres. points: f64[N, 3], finite."""
        if not len(points):
            return np.empty(0)
        places = np.ascontiguousarray(points, dtype=np.float64)
        kind = igl.SIGNED_DISTANCE_TYPE_PSEUDONORMAL
        return np.asarray(igl.signed_distance(places, self.vertices, self.faces, kind)[0])

    def sample(self, count: int, seed: int = 0) -> FloatArray:
        """Points spread evenly over the surface at random, f64[count, 3]; the same seed gives the same points."""
        rng = np.random.default_rng(seed)
        faces = self.faces[rng.choice(len(self.faces), count, p=self.areas / self.areas.sum())]
        # A square root, so that points are spread evenly over the triangle's area (Osada et al. 2002).
        root, along = np.sqrt(rng.random((count, 1))), rng.random((count, 1))
        a, b, c = (self.vertices[faces[:, corner]] for corner in range(3))
        return np.asarray((1.0 - root) * a + root * (1.0 - along) * b + root * along * c)

    def moved(self, transform: FloatArray) -> TriangleMesh:
        """The mesh mapped by a rigid transform, f64[4, 4]."""
        return TriangleMesh(self.name, self.vertices @ transform[:3, :3].T + transform[:3, 3], self.faces)


def _weights(corners: FloatArray, points: FloatArray) -> FloatArray:
    """Barycentric coordinates of points f64[N, 3] in their triangles f64[N, 3, 3]: f64[N, 3]."""
    one, two, arm = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], points - corners[:, 0]
    aa, ab, bb = (np.einsum("ij,ij->i", x, y) for x, y in ((one, one), (one, two), (two, two)))
    pa, pb = np.einsum("ij,ij->i", arm, one), np.einsum("ij,ij->i", arm, two)
    with np.errstate(divide="ignore", invalid="ignore"):
        second = (bb * pa - ab * pb) / (aa * bb - ab * ab)
        third = (aa * pb - ab * pa) / (aa * bb - ab * ab)
    return np.stack([1.0 - second - third, second, third], axis=1)


def _check_arrays(name: str, vertices: FloatArray, faces: IntArray) -> None:
    if vertices.ndim != 2 or vertices.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] != 3:
        found = f"{list(vertices.shape)} and {list(faces.shape)}"
        raise MeshError(name, "mesh", "vertices [v, 3] and faces [f, 3]", found, "correct it")
    wrong = vertices[~usable(vertices)]
    if len(wrong):
        raise MeshError(name, "vertices", "finite coordinates", unusable(wrong), "correct the mesh")
    if not len(faces):
        raise MeshError(name, "faces", "triangles", "none", "use a mesh, not a cloud")
    if faces.min() < 0 or faces.max() >= len(vertices):
        found = f"{faces.min()} to {faces.max()}"
        raise MeshError(name, "faces", f"vertex numbers from 0 to {len(vertices) - 1}", found, "correct the mesh")


def _check_closed(name: str, faces: IntArray) -> None:
    """Every edge of two faces, which pass along it in opposite directions."""
    ahead = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    ahead = ahead[ahead[:, 0] != ahead[:, 1]]  # a face with a corner twice has no area and bounds nothing
    count = int(faces.max()) + 1
    low, high = ahead.min(axis=1), ahead.max(axis=1)
    _, times = np.unique(low * count + high, return_counts=True)
    holes, many = int((times == 1).sum()), int((times > 2).sum())
    if holes:
        raise MeshError(name, "faces", "a closed surface", f"{holes} edges of one face only", "close the mesh's holes")
    if many:
        raise MeshError(name, "faces", "edges of two faces", f"{many} edges of more", "mend the mesh")
    _, times = np.unique(ahead[:, 0] * count + ahead[:, 1], return_counts=True)
    against = int((times > 1).sum())
    if against:
        found = f"{against} edges between faces wound against each other"
        raise MeshError(name, "faces", "faces wound alike", found, "mend the mesh")


def _volume(vertices: FloatArray, faces: IntArray) -> float:
    a, b, c = (vertices[faces[:, corner]] - vertices[0] for corner in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)
