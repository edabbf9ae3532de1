"""Closed triangle mesh: nearest points, signed distances, and random points of the surface."""

from __future__ import annotations

import atexit
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final
from weakref import WeakSet

import igl
import numpy as np
import numpy.typing as npt

from taxel.cloud.contact_cloud import describe_unusable, has_usable_coordinates
from taxel.cloud.errors import MeshError
from taxel.types import FloatArray, IntArray

ON_SURFACE: Final = 1e-9
"""Distance, relative to the diagonal of the mesh, up to which a point is treated as a point of the surface. The normal
of such a point is the normal of its face."""

ON_EDGE: Final = 1e-6
"""Barycentric coordinate below which a point of a face is treated as a point of the edge."""


_MESHES_WITH_TREE: WeakSet[TriangleMesh] = WeakSet()


@atexit.register
def _delete_trees() -> None:
    """Delete the search trees of all meshes before the interpreter ends.

    The library libigl would report trees that still exist on standard error.
    """
    for mesh in _MESHES_WITH_TREE:
        mesh.__dict__.pop("_tree", None)


@dataclass(frozen=True, eq=False)
class ClosestPoints:
    """Nearest points of a surface for N query points.

    distance: f64[N], metres. point: f64[N, 3]. normal: f64[N, 3], unit vector from the nearest point to the query
    point; for a query point on the surface the normal of the face. face: i64[N], face of the nearest point.
    """

    distance: FloatArray
    point: FloatArray
    normal: FloatArray
    face: IntArray


@dataclass(frozen=True, eq=False)
class TriangleMesh:
    """A closed surface of triangles.

    name: name in messages. vertices: f64[v, 3], metres. faces: i64[f, 3], vertex indices, oriented outward; a mesh
    whose faces are all oriented inward is reversed.

    Raises MeshError for vertices that are not finite, for vertex indices out of range, for an edge that is not shared
    by exactly two faces of consistent orientation, and for a mesh without volume.
    """

    name: str
    vertices: FloatArray
    faces: npt.NDArray[np.signedinteger[Any]]

    def __post_init__(self) -> None:
        """Check that the mesh is closed and consistent, and orient its faces outwards. Raises MeshError."""
        vertices = np.ascontiguousarray(self.vertices, dtype=np.float64)
        faces = np.ascontiguousarray(self.faces, dtype=np.int64)
        _check_arrays(self.name, vertices, faces)
        _check_closed(self.name, faces)
        volume = _compute_volume(vertices, faces)
        if abs(volume) < 1e-12 * float(np.ptp(vertices, axis=0).max()) ** 3:
            raise MeshError(self.name, "faces", "a solid with a volume", "a flat surface", "use a mesh of a solid")
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "faces", faces if volume > 0 else np.ascontiguousarray(faces[:, ::-1]))

    def __reduce__(self) -> tuple[type[TriangleMesh], tuple[str, FloatArray, IntArray]]:
        """Return how to pickle the mesh: its constructor and arguments."""
        return TriangleMesh, (self.name, self.vertices, self.faces)  # without the tree, which cannot be pickled

    @cached_property
    def bounds(self) -> FloatArray:
        """Smallest and largest coordinates of the mesh, f64[2, 3], metres."""
        return np.stack([self.vertices.min(axis=0), self.vertices.max(axis=0)])

    @cached_property
    def size(self) -> float:
        """Diagonal of the bounding box of the mesh, metres."""
        return float(np.linalg.norm(self.bounds[1] - self.bounds[0]))

    @cached_property
    def _cross_products(self) -> FloatArray:
        """Cross product of two edges of each triangle, f64[f, 3]: twice its area along its normal."""
        a, b, c = (self.vertices[self.faces[:, corner]] for corner in range(3))
        return np.cross(b - a, c - a)

    @cached_property
    def areas(self) -> FloatArray:
        """Areas of the triangles, f64[f], square metres."""
        return np.asarray(0.5 * np.linalg.norm(self._cross_products, axis=1))

    @cached_property
    def normals(self) -> FloatArray:
        """Outward unit normals of the triangles, f64[f, 3]; 0 for a triangle without an area."""
        twice = 2.0 * self.areas[:, None]
        return np.divide(self._cross_products, twice, out=np.zeros_like(self._cross_products), where=twice > 0)

    @cached_property
    def _tree(self) -> Any:
        """Search tree of the triangles for nearest-point queries, built at the first use."""
        tree = igl.AABB()
        tree.init(self.vertices, self.faces)
        _MESHES_WITH_TREE.add(self)
        return tree

    def find_closest(self, points: FloatArray) -> ClosestPoints:
        """Find the exact nearest points of the mesh's surface to finite points f64[N, 3].

        The normal is the unit vector from the nearest point to the given point; for a point on the surface, it is the
        normal of the face.
        """
        squared, face, nearest = self._tree.squared_distance(
            self.vertices, self.faces, np.ascontiguousarray(points, dtype=np.float64)
        )
        distance = np.sqrt(squared)
        is_on_surface = distance <= ON_SURFACE * self.size
        normal = np.where(is_on_surface[:, None], self.normals[face], points - nearest)
        normal /= np.where(is_on_surface, 1.0, distance)[:, None]
        return ClosestPoints(distance, nearest, normal, face)

    def find_edges_and_corners(self, closest: ClosestPoints) -> tuple[IntArray, FloatArray, IntArray]:
        """Find which nearest points of the mesh's surface are on edges and which are on corners.

        closest: result of `find_closest`. Returns three arrays: the rows of `closest` with a nearest point on an edge,
        i64[e]; the unit directions of these edges, f64[e, 3]; and the rows with a nearest point on a corner, i64[c].
        Other rows are omitted: those with the nearest point inside a face, and those of query points on the surface. A
        point is on an edge if one of its barycentric coordinates is 0, and on a corner if two are 0.
        """
        corners = self.vertices[self.faces[closest.face]]
        is_outside = closest.distance > ON_SURFACE * self.size
        is_zero = _compute_barycentric(corners, closest.point) < ON_EDGE
        zeros = is_zero.sum(axis=1)
        edge = np.flatnonzero(is_outside & (zeros == 1))
        opposite = is_zero[edge].argmax(axis=1)
        ends = corners[edge, (opposite + 1) % 3], corners[edge, (opposite + 2) % 3]
        direction = ends[1] - ends[0]
        unit = direction / np.linalg.norm(direction, axis=1)[:, None]
        return edge, unit, np.flatnonzero(is_outside & (zeros == 2))

    def compute_signed_distance(self, points: FloatArray) -> FloatArray:
        """Compute the distance of finite points f64[N, 3] to the mesh's surface, negative inside, f64[N], metres."""
        if not len(points):
            return np.empty(0)
        contiguous = np.ascontiguousarray(points, dtype=np.float64)
        kind = igl.SIGNED_DISTANCE_TYPE_PSEUDONORMAL
        return np.asarray(igl.signed_distance(contiguous, self.vertices, self.faces, kind)[0])

    def sample(self, count: int, seed: int = 0) -> FloatArray:
        """Sample random points, uniformly distributed over the mesh's surface, f64[count, 3].

        The same seed always gives the same points.
        """
        rng = np.random.default_rng(seed)
        faces = self.faces[rng.choice(len(self.faces), count, p=self.areas / self.areas.sum())]
        # The square root makes the points uniform over the area of the triangle (Osada et al. 2002).
        root, along = np.sqrt(rng.random((count, 1))), rng.random((count, 1))
        a, b, c = (self.vertices[faces[:, corner]] for corner in range(3))
        return np.asarray((1.0 - root) * a + root * (1.0 - along) * b + root * along * c)

    def transform(self, matrix: FloatArray) -> TriangleMesh:
        """Return the mesh mapped by a rigid transform, f64[4, 4]."""
        return TriangleMesh(self.name, self.vertices @ matrix[:3, :3].T + matrix[:3, 3], self.faces)


def _compute_barycentric(corners: FloatArray, points: FloatArray) -> FloatArray:
    """Compute the barycentric coordinates f64[N, 3] of points f64[N, 3] in triangles f64[N, 3, 3].

    Row i belongs to point i and triangle i. The coordinates are NaN or infinite for a triangle without area.
    """
    first, second, arm = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], points - corners[:, 0]
    aa, ab, bb = (np.einsum("ij,ij->i", x, y) for x, y in ((first, first), (first, second), (second, second)))
    pa, pb = np.einsum("ij,ij->i", arm, first), np.einsum("ij,ij->i", arm, second)
    with np.errstate(divide="ignore", invalid="ignore"):
        v = (bb * pa - ab * pb) / (aa * bb - ab * ab)
        w = (aa * pb - ab * pa) / (aa * bb - ab * ab)
    return np.stack([1.0 - v - w, v, w], axis=1)


def _check_arrays(name: str, vertices: FloatArray, faces: IntArray) -> None:
    """Raise MeshError for arrays of the wrong shape, unusable coordinates, no face, or vertices that do not exist.

    name: name of the mesh in the message.
    """
    if vertices.ndim != 2 or vertices.shape[1] != 3 or faces.ndim != 2 or faces.shape[1] != 3:
        found = f"{list(vertices.shape)} and {list(faces.shape)}"
        raise MeshError(name, "mesh", "vertices [v, 3] and faces [f, 3]", found, "correct it")
    wrong = vertices[~has_usable_coordinates(vertices)]
    if len(wrong):
        raise MeshError(name, "vertices", "finite coordinates", describe_unusable(wrong), "correct the mesh")
    if not len(faces):
        raise MeshError(name, "faces", "triangles", "none", "use a mesh, not a cloud")
    if faces.min() < 0 or faces.max() >= len(vertices):
        found = f"{faces.min()} to {faces.max()}"
        raise MeshError(name, "faces", f"vertex numbers from 0 to {len(vertices) - 1}", found, "correct the mesh")


def _check_closed(name: str, faces: IntArray) -> None:
    """Raise MeshError unless every edge belongs to exactly two faces, which traverse it in opposite directions.

    name: name of the mesh in the message. faces: vertex indices i64[f, 3].
    """
    directed = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    directed = directed[directed[:, 0] != directed[:, 1]]  # a face with a repeated corner has no area and no boundary
    count = int(faces.max()) + 1
    low, high = directed.min(axis=1), directed.max(axis=1)
    _, times = np.unique(low * count + high, return_counts=True)
    single, multiple = int((times == 1).sum()), int((times > 2).sum())
    if single:
        raise MeshError(name, "faces", "a closed surface", f"{single} edges of one face only", "close the mesh's holes")
    if multiple:
        raise MeshError(name, "faces", "edges of two faces", f"{multiple} edges of more faces", "repair the mesh")
    _, times = np.unique(directed[:, 0] * count + directed[:, 1], return_counts=True)
    inconsistent = int((times > 1).sum())
    if inconsistent:
        found = f"{inconsistent} edges between faces of opposite orientation"
        raise MeshError(name, "faces", "faces of consistent orientation", found, "repair the mesh")


def _compute_volume(vertices: FloatArray, faces: IntArray) -> float:
    """Compute the volume enclosed by a closed mesh; negative if the faces point inwards."""
    a, b, c = (vertices[faces[:, corner]] - vertices[0] for corner in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6.0)
