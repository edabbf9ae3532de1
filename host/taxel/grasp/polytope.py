"""Convex polytopes, such as a box or a prism, with sharp or rounded edges; exact rays and distances."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.optimize import linprog
from scipy.spatial import ConvexHull, HalfspaceIntersection, QhullError

from taxel.grasp.polytope_library import compute_separation
from taxel.grasp.shape import ShapeError, as_points, check_sizes, make_read_only
from taxel.types import FloatArray, Int32Array

_MERGE = 1e-9
"""Distance below which two vertices are merged, relative to the size of the solid; far above rounding errors."""

CONVEX_VOLUME_SHARE = 0.999
"""Smallest ratio of the volumes of a mesh and of its convex hull at which the mesh counts as convex."""


@dataclass(frozen=True, eq=False)
class ConvexPolytope:
    """Intersection of half-spaces: the points p with normals @ p <= offsets.

    normals: f64[k, 3], of any length above 0 (they are normalised). offsets: f64[k], metres for unit normals. Raises
    ShapeError if the half-spaces do not bound a solid.
    """

    normals: FloatArray
    offsets: FloatArray

    def __post_init__(self) -> None:
        """Normalise the half-spaces and check that they bound a solid. Raises ShapeError."""
        normals, offsets = np.array(self.normals, dtype=np.float64), np.array(self.offsets, dtype=np.float64)
        if normals.ndim != 2 or normals.shape[1:] != (3,) or offsets.shape != normals.shape[:1]:
            raise ShapeError("polytope", "normals [k, 3] and offsets [k]", f"{normals.shape} and {offsets.shape}")
        length = np.linalg.norm(normals, axis=1)
        if not (np.isfinite(length).all() and np.isfinite(offsets).all() and (length > 0).all()):
            raise ShapeError("polytope", "finite normals longer than 0 and finite offsets", "invalid values")
        object.__setattr__(self, "normals", make_read_only(normals / length[:, None]))
        object.__setattr__(self, "offsets", make_read_only(offsets / length))
        _ = self._faces  # computed here, so that invalid half-spaces raise in the constructor

    @classmethod
    def box(cls, width: float, depth: float, height: float) -> ConvexPolytope:
        """Make an upright box with sizes in metres: `width` along x, `depth` along y, bottom at z = 0.

        Raises ShapeError for a size that is not above 0.
        """
        check_sizes("box", width=width, depth=depth, height=height)
        normals = np.concatenate([np.eye(3), -np.eye(3)])
        return cls(normals, np.array([width / 2, depth / 2, height, width / 2, depth / 2, 0.0]))

    @classmethod
    def prism(cls, side: float, height: float) -> ConvexPolytope:
        """Make an upright equilateral triangular prism about the z axis with a side face towards +y; sizes in metres.

        `side`: side length of the triangle; each side face is side / (2 sqrt 3) from the axis. Raises ShapeError.
        """
        check_sizes("prism", side=side, height=height)
        angles = np.pi / 2 + np.arange(3) * 2 * np.pi / 3
        lateral = np.stack([np.cos(angles), np.sin(angles), np.zeros(3)], axis=1)
        normals = np.concatenate([lateral, [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]])
        return cls(normals, np.array([side / (2 * np.sqrt(3))] * 3 + [height, 0.0]))

    def rounded(self, radius: float, step_rad: float = np.radians(30.0)) -> ConvexPolytope:
        """Return the solid with rounded edges, approximated by tangential strips of at most `step_rad` radians each.

        radius: radius of the edges, metres; 0: the same solid. Raises ShapeError if a face would vanish.
        """
        if not (np.isfinite(radius) and radius >= 0):
            raise ShapeError("polytope", "a radius of at least 0 m", str(radius))
        try:
            ConvexPolytope(self.normals, self.offsets - radius)  # raises if no ball of this radius fits inside
        except ShapeError as error:
            raise ShapeError("polytope", "a radius that leaves a part of every face", f"{radius} m") from error
        normals, offsets = list(self.normals), list(self.offsets)
        for first, second in self._edge_faces if radius > 0 else []:
            pair = self.normals[[first, second]]
            # The axis of the rounding is one radius below both faces.
            axis = np.linalg.lstsq(pair, self.offsets[[first, second]] - radius, rcond=None)[0]
            angle = float(np.arccos(np.clip(pair[0] @ pair[1], -1.0, 1.0)))
            strips = int(np.ceil(angle / step_rad - 1e-9)) - 1
            for strip in range(1, strips + 1):
                # Spherical interpolation between the normals of the two faces.
                fraction = strip / (strips + 1)
                normal = (np.sin((1 - fraction) * angle) * pair[0] + np.sin(fraction * angle) * pair[1]) / np.sin(angle)
                normals.append(normal)
                offsets.append(normal @ axis + radius)
        return ConvexPolytope(np.array(normals), np.array(offsets))

    @classmethod
    def from_mesh(cls, vertices: npt.ArrayLike) -> ConvexPolytope:
        """Make the convex hull of vertices f64[v, 3], metres. Raises ShapeError for coplanar vertices."""
        points = np.asarray(vertices, dtype=np.float64)
        if points.ndim != 2 or points.shape[1:] != (3,) or not np.isfinite(points).all():
            raise ShapeError("mesh", "finite vertices [v, 3]", f"shape {points.shape}")
        try:
            equations = ConvexHull(points).equations
        except (QhullError, ValueError) as error:
            raise ShapeError(
                "mesh", "four vertices that are not coplanar", f"{len(points)} coplanar vertices"
            ) from error
        # Triangles of the same face have the same equation up to rounding.
        scale = np.array([1.0, 1.0, 1.0, 1.0 / np.ptp(points, axis=0).max()])
        _, first = np.unique(np.round(equations * scale, 9), axis=0, return_index=True)
        unique = equations[np.sort(first)]
        return cls(unique[:, :3], -unique[:, 3])

    @property
    def height(self) -> float:
        """Extent of the solid along z, metres."""
        return float(np.ptp(self.vertices[:, 2]))

    @property
    def bounds(self) -> FloatArray:
        """Smallest and largest coordinates of the solid, f64[2, 3], metres."""
        return np.stack([self.vertices.min(axis=0), self.vertices.max(axis=0)])

    @cached_property
    def vertices(self) -> FloatArray:
        """Vertices of the solid, f64[v, 3], metres."""
        return make_read_only(_compute_vertices(self.normals, self.offsets))

    @cached_property
    def _faces(self) -> list[npt.NDArray[np.intp]]:
        """Vertex indices of each face, anticlockwise seen from outside; duplicate half-spaces give one face.

        A vertex belongs to a face if its distance to the plane of the face is within the rounding of the vertices.
        """
        size = np.ptp(self.vertices, axis=0).max()
        faces: dict[frozenset[int], npt.NDArray[np.intp]] = {}
        for normal, offset in zip(self.normals, self.offsets, strict=True):
            members = np.flatnonzero(np.abs(self.vertices @ normal - offset) < 10 * _MERGE * size)
            if len(members) >= 3:
                order = _sort_around(self.vertices[members], normal)
                faces.setdefault(frozenset(members.tolist()), members[order])
        return list(faces.values())

    def mesh(self, resolution: int = 64) -> tuple[FloatArray, Int32Array]:
        """Triangulate the polytope: vertices f64[v, 3] and triangles i32[f, 3] with outward orientation.

        resolution: has no effect on flat faces; other shapes use it.
        """
        fans = [[face[0], face[i], face[i + 1]] for face in self._faces for i in range(1, len(face) - 1)]
        return self.vertices.copy(), np.array(fans, dtype=np.int32)

    def ray_separation(self, points: npt.ArrayLike, directions: npt.ArrayLike) -> FloatArray:
        """Compute the distance from points to the polytope along unit directions, f64[...] metres.

        points, directions: f64[..., 3]. Negative inside the polytope; +inf for a miss. Directions f64[..., 1, 3] shared
        by several points are evaluated once. Implements `Shape.ray_separation`.
        """
        p, d = as_points(points), as_points(directions)
        shape = np.broadcast_shapes(p.shape, d.shape)[:-1]
        if 0 in shape:
            return np.empty(shape)
        is_shared = d.shape[-2:-1] == (1,)
        points_per_line = shape[-1] if is_shared else 1
        flat_p = np.broadcast_to(p, (*shape, 3)).reshape(-1, points_per_line, 3)
        flat_d = np.broadcast_to(d, (*shape[:-1], 1, 3) if is_shared else (*shape, 3)).reshape(-1, 3)
        return compute_separation(self.normals, self.offsets, flat_p, flat_d).reshape(shape)

    def ray_entry(self, points: npt.ArrayLike, directions: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Compute where rays enter the polytope: distance f64[...], metres, and outward unit normal f64[..., 3].

        points, directions: f64[..., 3]. A miss has the distance +inf and the normal 0. Implements `Shape.ray_entry`.
        """
        separation, face = self._clip_lines(points, directions)
        return separation, np.where(np.isfinite(separation)[..., None], self.normals[face], 0.0)

    def _clip_lines(self, points: npt.ArrayLike, directions: npt.ArrayLike) -> tuple[FloatArray, npt.NDArray[np.intp]]:
        """Clip lines p + t d by all half-spaces of the polytope (Cyrus and Beck 1978).

        points, directions: f64[..., 3]. A line enters the solid at the last face that it crosses inwards, and leaves at
        the first face that it crosses outwards. Returns t at the entry, f64[...], inf for a miss, and the index of the
        entered face.
        """
        p, d = as_points(points), as_points(directions)
        enter = np.full(np.broadcast_shapes(p.shape, d.shape)[:-1], -np.inf)
        leave = -enter
        face = np.zeros(enter.shape, dtype=np.intp)
        for index, (normal, offset) in enumerate(zip(self.normals, self.offsets, strict=True)):
            depth, speed = offset - p @ normal, d @ normal
            with np.errstate(divide="ignore", invalid="ignore"):
                crossing = depth / speed
            is_later = (speed < 0) & (crossing > enter)
            enter = np.where(is_later, crossing, enter)
            face = np.where(is_later, index, face)
            leave = np.fmin(leave, np.where(speed > 0, crossing, np.inf))
            leave = np.where((speed == 0) & (depth < 0), -np.inf, leave)
        return np.where((enter <= leave) & (leave >= 0), enter, np.inf), face

    def view_faces(self, tops: FloatArray, axes: FloatArray, min_slope: float) -> tuple[FloatArray, FloatArray]:
        """Compute how deep m columns of a soft layer lie below each of the k faces of the polytope.

        tops, axes: upper ends and outward unit directions of the columns, f64[m, 3]. Returns the depths f64[m, k],
        distances from the upper end to the plane of each face against the axis, metres, and the outward unit normals of
        the faces, f64[m, k, 3]. min_slope: least cosine between axis and inward normal, so that a side face has a
        finite depth. Implements `Shape.view_faces`.
        """
        depths = (self.offsets - tops @ self.normals.T) / np.maximum(-axes @ self.normals.T, min_slope)
        return depths, np.broadcast_to(self.normals, (len(tops), *self.normals.shape))

    def signed_distance(self, points: npt.ArrayLike) -> FloatArray:
        """Compute the distance of points f64[..., 3] to the polytope's surface, f64[...] metres; negative inside.

        For a point outside, the nearest point of the surface is on a face below the point, or else on an edge.
        """
        p = as_points(points)
        height = p @ self.normals.T - self.offsets
        result: FloatArray = np.asarray(height.max(axis=-1))
        is_outside = result > 0
        if is_outside.any():
            result[is_outside] = self._compute_outside_distance(p[is_outside], height[is_outside])
        return result

    def distance_bound(self, points: npt.ArrayLike) -> FloatArray:
        """Compute a lower bound f64[...] of the signed distance of points f64[..., 3]: largest height above a face."""
        p = as_points(points)
        height = self.normals @ p.reshape(-1, 3).T - self.offsets[:, None]
        return np.asarray(height.max(axis=0).reshape(p.shape[:-1]))

    def _compute_outside_distance(self, points: FloatArray, height: FloatArray) -> FloatArray:
        """Compute the distance of points f64[m, 3] outside the polytope to its surface, f64[m].

        height: f64[m, faces], heights of the points above the plane of each face.
        """
        distance = np.full(len(points), np.inf)
        tolerance = _MERGE * np.ptp(self.vertices, axis=0).max()
        for face, normal in enumerate(self.normals):
            candidates = np.flatnonzero(height[:, face] > 0)
            # Heights of the foot of the perpendicular: it is in the face if none is above 0.
            foot = height[candidates] - height[candidates, face, None] * (self.normals @ normal)
            nearest = candidates[foot.max(axis=1) <= tolerance]
            distance[nearest] = np.minimum(distance[nearest], height[nearest, face])
        at_edges = np.flatnonzero(np.isinf(distance))
        for start, end in self._edges:
            edge = self.vertices[end] - self.vertices[start]
            offset = points[at_edges] - self.vertices[start]
            fraction = np.clip(offset @ edge / (edge @ edge), 0.0, 1.0)
            edge_distance = np.linalg.norm(offset - fraction[:, None] * edge, axis=1)
            distance[at_edges] = np.minimum(distance[at_edges], edge_distance)
        return distance

    @property
    def _edge_faces(self) -> list[tuple[int, int]]:
        """Indices of the two half-spaces whose planes meet at each edge."""
        tolerance = 10 * _MERGE * np.ptp(self.vertices, axis=0).max()
        is_on_face = np.abs(self.vertices @ self.normals.T - self.offsets) < tolerance
        pairs = [np.flatnonzero(is_on_face[start] & is_on_face[end]) for start, end in self._edges]
        return [(int(pair[0]), int(pair[1])) for pair in pairs]

    @cached_property
    def _edges(self) -> list[tuple[int, int]]:
        """The edges of the polytope as pairs of vertex indices, the smaller index first."""
        pairs = {
            (int(min(a, b)), int(max(a, b)))
            for face in self._faces
            for a, b in zip(face, np.roll(face, -1), strict=True)
        }
        return sorted(pairs)


def make_convex_polytope(vertices: npt.ArrayLike, faces: npt.ArrayLike) -> ConvexPolytope | None:
    """Make the convex polytope of a mesh; None if the mesh is not convex or has no valid hull.

    vertices: f64[v, 3], metres. faces: i32[f, 3], indices of vertices, outward orientation.
    """
    points = np.asarray(vertices, dtype=np.float64)
    a, b, c = points[np.asarray(faces).T]
    volume = float(np.einsum("fi,fi->", a, np.cross(b, c))) / 6.0  # tetrahedra of the faces and the origin
    try:
        # Only a convex mesh has (nearly) the volume of its convex hull.
        if volume < CONVEX_VOLUME_SHARE * ConvexHull(points).volume:
            return None
        return ConvexPolytope.from_mesh(points)
    except (QhullError, ShapeError):
        return None


def _compute_vertices(normals: FloatArray, offsets: FloatArray) -> FloatArray:
    """Compute the vertices f64[v, 3] of a polytope {x: normals x <= offsets} with unit normals.

    Raises ShapeError if the polytope is empty, flat or unbounded.
    """
    # Chebyshev centre: the point p with the largest r such that normals @ p + r <= offsets.
    system = np.column_stack([normals, np.ones(len(normals))])
    limits = [(None, None)] * 3 + [(0, None)]
    centre = linprog([0, 0, 0, -1], A_ub=system, b_ub=offsets, bounds=limits)
    if centre.x is None or not centre.success or centre.x[3] <= 0:
        raise ShapeError("polytope", "half-spaces that bound a solid", "an empty, flat or unbounded intersection")
    try:
        points = HalfspaceIntersection(np.column_stack([normals, -offsets]), centre.x[:3]).intersections
    except QhullError as error:
        raise ShapeError("polytope", "half-spaces that bound a solid", "a flat or unbounded intersection") from error
    if not np.isfinite(points).all():
        raise ShapeError("polytope", "half-spaces that bound a solid", "an unbounded intersection")
    vertices: list[FloatArray] = []
    limit = _MERGE * np.ptp(points, axis=0).max()
    for point in points:
        if all(np.abs(point - vertex).max() > limit for vertex in vertices):
            vertices.append(point)
    return np.array(vertices)


def _sort_around(corners: FloatArray, normal: FloatArray) -> npt.NDArray[np.intp]:
    """Sort the corners f64[k, 3] of a convex face anticlockwise, seen against the normal; returns the order."""
    arms = corners - corners.mean(axis=0)
    first = arms[0] / np.linalg.norm(arms[0])
    return np.argsort(np.arctan2(arms @ np.cross(normal, first), arms @ first))
