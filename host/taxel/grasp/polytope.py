"""A convex solid between planes, such as a box or a prism, sharp or with rounded edges."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.optimize import linprog
from scipy.spatial import ConvexHull, HalfspaceIntersection, QhullError

from taxel.grasp.shape import ShapeError, as_points, check_sizes, read_only
from taxel.types import FloatArray, Int32Array

# Share of the solid's size within which two vertices are one: far above rounding, far below what can be made.
_MERGE = 1e-9

# Lines that are clipped at a time: their numbers with every half-space stay in the cache.
_ROWS = 512

# Cosine below which a line runs along a face: its way to the face is no number any more.
_LEVEL = 1e-250


@dataclass(frozen=True, eq=False)
class ConvexPolytope:
    """The points p with normals @ p <= offsets.

    normals: f64[k, 3], of any length but zero (they are made unit vectors). offsets: f64[k], metres for unit normals.
    Raises ShapeError if they bound no solid.
    """

    normals: FloatArray
    offsets: FloatArray

    def __post_init__(self) -> None:
        normals, offsets = np.array(self.normals, dtype=np.float64), np.array(self.offsets, dtype=np.float64)
        if normals.ndim != 2 or normals.shape[1:] != (3,) or offsets.shape != normals.shape[:1]:
            raise ShapeError("polytope", "normals [k, 3] and offsets [k]", f"{normals.shape} and {offsets.shape}")
        length = np.linalg.norm(normals, axis=1)
        if not (np.isfinite(length).all() and np.isfinite(offsets).all() and (length > 0).all()):
            raise ShapeError("polytope", "finite normals above zero length and finite offsets", "others")
        object.__setattr__(self, "normals", read_only(normals / length[:, None]))
        object.__setattr__(self, "offsets", read_only(offsets / length))
        _ = self._faces  # found now, so that a mistake shows where it was made

    @classmethod
    def box(cls, width: float, depth: float, height: float) -> ConvexPolytope:
        """An upright box: `width` along x, `depth` along y, bottom at z = 0. Raises ShapeError for a size of 0."""
        check_sizes("box", width=width, depth=depth, height=height)
        normals = np.concatenate([np.eye(3), -np.eye(3)])
        return cls(normals, np.array([width / 2, depth / 2, height, width / 2, depth / 2, 0.0]))

    @classmethod
    def prism(cls, side: float, height: float) -> ConvexPolytope:
        """An upright equilateral triangular prism about the z axis, one side face's normal along +y.

        `side`: of the triangle, so that each side face is side / (2 sqrt 3) from the axis. Raises ShapeError.
        """
        check_sizes("prism", side=side, height=height)
        angles = np.pi / 2 + np.arange(3) * 2 * np.pi / 3
        around = np.stack([np.cos(angles), np.sin(angles), np.zeros(3)], axis=1)
        normals = np.concatenate([around, [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]])
        return cls(normals, np.array([side / (2 * np.sqrt(3))] * 3 + [height, 0.0]))

    def rounded(self, radius: float, step_rad: float = np.radians(30.0)) -> ConvexPolytope:
        """The same solid with every edge rounded off, in flat strips that turn by at most `step_rad`.

        radius: of the rounding, metres; the strips touch it. Raises ShapeError if nothing of a face would be left.
        """
        if not (np.isfinite(radius) and radius >= 0):
            raise ShapeError("polytope", "a rounding of at least 0 metres", str(radius))
        try:
            ConvexPolytope(self.normals, self.offsets - radius)  # where a ball of that radius can roll inside
        except ShapeError as error:
            raise ShapeError("polytope", "a rounding that leaves something of every face", f"{radius} m") from error
        normals, offsets = list(self.normals), list(self.offsets)
        for first, second in self._edge_faces if radius > 0 else []:
            pair = self.normals[[first, second]]
            # The rounding's axis: as far below both faces as its radius.
            axis = np.linalg.lstsq(pair, self.offsets[[first, second]] - radius, rcond=None)[0]
            angle = float(np.arccos(np.clip(pair[0] @ pair[1], -1.0, 1.0)))
            strips = int(np.ceil(angle / step_rad - 1e-9)) - 1
            for strip in range(1, strips + 1):
                part = strip / (strips + 1)
                normal = (np.sin((1 - part) * angle) * pair[0] + np.sin(part * angle) * pair[1]) / np.sin(angle)
                normals.append(normal)
                offsets.append(normal @ axis + radius)
        return ConvexPolytope(np.array(normals), np.array(offsets))

    @classmethod
    def from_mesh(cls, vertices: npt.ArrayLike) -> ConvexPolytope:
        """The convex hull of vertices f64[v, 3]; they keep their frame. Raises ShapeError if they lie in a plane."""
        points = np.asarray(vertices, dtype=np.float64)
        if points.ndim != 2 or points.shape[1:] != (3,) or not np.isfinite(points).all():
            raise ShapeError("mesh", "finite vertices [v, 3]", f"shape {points.shape}")
        try:
            equations = ConvexHull(points).equations
        except (QhullError, ValueError) as error:
            raise ShapeError("mesh", "four vertices that are not in one plane", f"{len(points)} that are") from error
        # Triangles of one flat face share one equation up to rounding.
        scale = np.array([1.0, 1.0, 1.0, 1.0 / np.ptp(points, axis=0).max()])
        _, first = np.unique(np.round(equations * scale, 9), axis=0, return_index=True)
        kept = equations[np.sort(first)]
        return cls(kept[:, :3], -kept[:, 3])

    @property
    def height(self) -> float:
        """Extent along z, metres."""
        return float(np.ptp(self.vertices[:, 2]))

    @property
    def bounds(self) -> FloatArray:
        """Smallest and largest coordinates, f64[2, 3]."""
        return np.stack([self.vertices.min(axis=0), self.vertices.max(axis=0)])

    @cached_property
    def vertices(self) -> FloatArray:
        """Corners, f64[v, 3]."""
        return read_only(_vertices(self.normals, self.offsets))

    @cached_property
    def _faces(self) -> list[npt.NDArray[np.intp]]:
        """Corners of each flat face, anticlockwise from outside; each once, though half-spaces may repeat."""
        size = np.ptp(self.vertices, axis=0).max()
        faces: dict[frozenset[int], npt.NDArray[np.intp]] = {}
        for normal, offset in zip(self.normals, self.offsets, strict=True):
            on = np.flatnonzero(np.abs(self.vertices @ normal - offset) < 10 * _MERGE * size)
            if len(on) >= 3:
                faces.setdefault(frozenset(on.tolist()), on[_around(self.vertices[on], normal)])
        return list(faces.values())

    def mesh(self, resolution: int = 64) -> tuple[FloatArray, Int32Array]:
        """See `Shape`. A flat face needs no `resolution`."""
        fans = [[face[0], face[i], face[i + 1]] for face in self._faces for i in range(1, len(face) - 1)]
        return self.vertices.copy(), np.array(fans, dtype=np.int32)

    def ray_separation(self, points: npt.ArrayLike, directions: npt.ArrayLike) -> FloatArray:
        """See `Shape`. Directions f64[..., 1, 3] that several points share cost little more than one."""
        p, d = as_points(points), as_points(directions)
        shape = np.broadcast_shapes(p.shape, d.shape)[:-1]
        if 0 in shape:
            return np.empty(shape)
        shared = d.shape[-2:-1] == (1,)
        each = shape[-1] if shared else 1
        flat_p = np.broadcast_to(p, (*shape, 3)).reshape(-1, each, 3)
        flat_d = np.broadcast_to(d, (*shape[:-1], 1, 3) if shared else (*shape, 3)).reshape(-1, 3)
        step = max(1, _ROWS // each)
        pieces = [self._separation(flat_p[i : i + step], flat_d[i : i + step]) for i in range(0, len(flat_p), step)]
        return np.concatenate(pieces).reshape(shape)

    def _separation(self, p: FloatArray, d: FloatArray) -> FloatArray:
        """`ray_separation` of points [m, e, 3] along [m, 3] with all half-spaces at once, [m, e]."""
        speed = (self.normals @ d.T)[..., None]
        room = (self.offsets[:, None] - self.normals @ p.reshape(-1, 3).T).reshape(len(self.normals), *p.shape[:2])
        along = np.abs(speed) < _LEVEL
        at = room / np.where(along, 1.0, speed)
        enter = (at + np.where(speed <= -_LEVEL, 0.0, -np.inf)).max(axis=0)
        leave = (at + np.where(speed >= _LEVEL, 0.0, np.inf)).min(axis=0)
        if along.any():
            leave[(along & (room < 0)).any(axis=0)] = -np.inf
        return np.where((enter <= leave) & (leave >= 0), enter, np.inf)

    def ray_entry(self, points: npt.ArrayLike, directions: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """See `Shape`."""
        separation, face = self._clip(points, directions)
        return separation, np.where(np.isfinite(separation)[..., None], self.normals[face], 0.0)

    def _clip(self, points: npt.ArrayLike, directions: npt.ArrayLike) -> tuple[FloatArray, npt.NDArray[np.intp]]:
        """Separation and entered face: the line clipped by one half-space after the other (Cyrus and Beck 1978)."""
        p, d = as_points(points), as_points(directions)
        enter = np.full(np.broadcast_shapes(p.shape, d.shape)[:-1], -np.inf)
        leave = -enter
        face = np.zeros(enter.shape, dtype=np.intp)
        for index, (normal, offset) in enumerate(zip(self.normals, self.offsets, strict=True)):
            room, speed = offset - p @ normal, d @ normal
            with np.errstate(divide="ignore", invalid="ignore"):
                at = room / speed
            later = (speed < 0) & (at > enter)
            enter = np.where(later, at, enter)
            face = np.where(later, index, face)
            leave = np.fmin(leave, np.where(speed > 0, at, np.inf))
            leave = np.where((speed == 0) & (room < 0), -np.inf, leave)
        return np.where((enter <= leave) & (leave >= 0), enter, np.inf), face

    def signed_distance(self, points: npt.ArrayLike) -> FloatArray:
        """See `Shape`. Outside, the nearest point lies in a face that the point is before, or else on an edge."""
        p = as_points(points)
        above = p @ self.normals.T - self.offsets
        result: FloatArray = np.asarray(above.max(axis=-1))
        outside = result > 0
        if outside.any():
            result[outside] = self._outside_distance(p[outside], above[outside])
        return result

    def distance_bound(self, points: npt.ArrayLike) -> FloatArray:
        """See `Shape`. The highest over all half-spaces."""
        p = as_points(points)
        above = self.normals @ p.reshape(-1, 3).T - self.offsets[:, None]
        return np.asarray(above.max(axis=0).reshape(p.shape[:-1]))

    def _outside_distance(self, points: FloatArray, above: FloatArray) -> FloatArray:
        best = np.full(len(points), np.inf)
        tolerance = _MERGE * np.ptp(self.vertices, axis=0).max()
        for face, normal in enumerate(self.normals):
            before = np.flatnonzero(above[:, face] > 0)
            # Heights over all half-spaces of the foot of the perpendicular: in the face if none is above 0.
            foot = above[before] - above[before, face, None] * (self.normals @ normal)
            hit = before[foot.max(axis=1) <= tolerance]
            best[hit] = np.minimum(best[hit], above[hit, face])
        rest = np.flatnonzero(np.isinf(best))
        for start, end in self._edges:
            along = self.vertices[end] - self.vertices[start]
            offset = points[rest] - self.vertices[start]
            part = np.clip(offset @ along / (along @ along), 0.0, 1.0)
            best[rest] = np.minimum(best[rest], np.linalg.norm(offset - part[:, None] * along, axis=1))
        return best

    @property
    def _edge_faces(self) -> list[tuple[int, int]]:
        """The two half-spaces that meet in each edge."""
        tolerance = 10 * _MERGE * np.ptp(self.vertices, axis=0).max()
        on = np.abs(self.vertices @ self.normals.T - self.offsets) < tolerance
        pairs = [np.flatnonzero(on[start] & on[end]) for start, end in self._edges]
        return [(int(pair[0]), int(pair[1])) for pair in pairs]

    @cached_property
    def _edges(self) -> list[tuple[int, int]]:
        pairs = {
            (int(min(a, b)), int(max(a, b)))
            for face in self._faces
            for a, b in zip(face, np.roll(face, -1), strict=True)
        }
        return sorted(pairs)


def _vertices(normals: FloatArray, offsets: FloatArray) -> FloatArray:
    """Corners of a polytope of unit normals. Raises ShapeError if it is empty, flat or unbounded."""
    # Chebyshev's centre: the point p with the largest r so that normals @ p + r <= offsets.
    system = np.column_stack([normals, np.ones(len(normals))])
    limits = [(None, None)] * 3 + [(0, None)]
    centre = linprog([0, 0, 0, -1], A_ub=system, b_ub=offsets, bounds=limits)
    if centre.x is None or not centre.success or centre.x[3] <= 0:
        raise ShapeError("polytope", "half-spaces that bound a solid", "an empty, flat or endless one")
    try:
        found = HalfspaceIntersection(np.column_stack([normals, -offsets]), centre.x[:3]).intersections
    except QhullError as error:
        raise ShapeError("polytope", "half-spaces that bound a solid", "a flat or endless one") from error
    if not np.isfinite(found).all():
        raise ShapeError("polytope", "half-spaces that bound a solid", "an endless one")
    kept: list[FloatArray] = []
    limit = _MERGE * np.ptp(found, axis=0).max()
    for point in found:
        if all(np.abs(point - other).max() > limit for other in kept):
            kept.append(point)
    return np.array(kept)


def _around(corners: FloatArray, normal: FloatArray) -> npt.NDArray[np.intp]:
    """Order of the corners of a flat convex face, anticlockwise seen from where the normal points."""
    arms = corners - corners.mean(axis=0)
    first = arms[0] / np.linalg.norm(arms[0])
    return np.argsort(np.arctan2(arms @ np.cross(normal, first), arms @ first))
