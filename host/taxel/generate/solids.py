"""Sampled objects: boxes, cylinders and prisms with ranges of sizes, and the convex hulls of mesh files."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from taxel.cloud.files import MESH_READERS
from taxel.cloud.files.source import Source
from taxel.generate.errors import RecipeError
from taxel.generate.ranges import Range
from taxel.grasp.objects import ORIGINAL_SIZES, GraspObject, ObjectSizes
from taxel.grasp.plan import PALM_PLACEMENTS
from taxel.grasp.shapes import ConvexPolytope, Cylinder, Shape
from taxel.hand.errors import format_path
from taxel.types import FloatArray

Solid = Literal["box", "cylinder", "prism", "mesh"]
Approaches = Literal["thesis", "any"]
SIZES: Final[Mapping[str, tuple[str, ...]]] = {
    "box": ("width_mm", "depth_mm", "height_mm"),
    "cylinder": ("radius_mm", "height_mm"),
    "prism": ("side_mm", "height_mm"),
    "mesh": ("scale",),
}
"""Sampled sizes of each solid. prism: upright, with three equal sides."""

MAX_CORNERS: Final = 80
"""Largest number of corners of a convex hull; if there are more, those farthest apart are kept. The simulation time
grows with the number of faces, but fewer corners remove more of the object (see `ObjectKind.outside_m`).
"""

SMALLEST_M, LARGEST_M = 0.005, 0.5
"""Smallest and largest permitted extent of a mesh, metres. A mesh outside this range probably has another unit."""


@dataclass(frozen=True, eq=False)
class ObjectKind:
    """A kind of object: a shape with ranges from which its sizes are sampled.

    name: label of its grasps. shape: type of the solid. sizes: ranges by the names in `SIZES`. share: frequency
    relative to the other kinds. approaches: "thesis" (those of the thesis to its object with this name) or "any". file,
    hull: file of a mesh, and corners f64[v, 3] of its convex hull, metres, upright on the origin. outside_m: largest
    distance of a removed corner from the hull, metres. edge_m: radius of the rounded edges of a box or a prism, metres;
    0: sharp.
    """

    name: str
    shape: Solid
    sizes: Mapping[str, Range]
    share: float = 1.0
    approaches: Approaches = "any"
    file: str = ""
    hull: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    outside_m: float = 0.0
    edge_m: float = 0.0

    @property
    def is_varied(self) -> bool:
        """Whether each grasp has an object of this kind with its own sizes."""
        return any(not size.is_fixed for size in self.sizes.values())

    @cached_property
    def _unscaled(self) -> ConvexPolytope:
        """Polytope of the mesh's convex hull, before the sampled scale."""
        return ConvexPolytope.from_mesh(self.hull)

    def sample(self, rng: np.random.Generator) -> dict[str, float]:
        """Sample the sizes of an object of this kind, by name."""
        return {name: size.sample(rng) for name, size in self.sizes.items()}

    def solid(self, sizes: Mapping[str, float], name: str) -> GraspObject:
        """Make an object of this kind with the given sizes and name. Raises ShapeError if the sizes bound no solid."""
        return GraspObject(name, self._make_shape(sizes), f"{self.shape}, sampled")

    def _make_shape(self, sizes: Mapping[str, float]) -> Shape:
        """Make the shape of an object. sizes: millimetres by name; for a mesh only the factor "scale"."""
        if self.shape == "mesh":
            return ConvexPolytope(self._unscaled.normals, sizes["scale"] * self._unscaled.offsets)
        metres = [1e-3 * sizes[name] for name in SIZES[self.shape]]
        if self.shape == "cylinder":
            return Cylinder(*metres)
        sharp = ConvexPolytope.box(*metres) if self.shape == "box" else ConvexPolytope.prism(*metres)
        return sharp.rounded(self.edge_m) if self.edge_m else sharp

    def to_json(self) -> dict[str, Any]:
        """Return the kind of object as JSON values.

        A mesh is identified by the SHA-256 of its corners, independently of its path.
        """
        content = {name: getattr(self, name) for name in ("name", "shape", "share", "approaches")}
        content["sizes"] = {name: size.to_json() for name, size in self.sizes.items()}
        if self.shape in ("box", "prism"):
            content["edge_m"] = self.edge_m
        if self.shape == "mesh":
            content["corners"] = len(self.hull)
            content["corners_sha256"] = hashlib.sha256(np.ascontiguousarray(self.hull).tobytes()).hexdigest()
        return content


def get_edge_m(shape: Solid, sizes: ObjectSizes) -> float:
    """Return the edge radius of the test object with this shape, metres; 0 if it has no rounded edges."""
    return {"box": sizes.box_edge_m, "prism": sizes.prism_edge_m}.get(shape, 0.0)


def make_default_kinds(sizes: ObjectSizes = ORIGINAL_SIZES) -> tuple[ObjectKind, ...]:
    """Make the default kinds of objects: the three objects of the thesis, with sizes from -8 % to +8 %."""
    dimensions: dict[str, tuple[Solid, tuple[float, ...]]] = {
        "rectangular_prism": ("box", (sizes.box_width_m, sizes.box_depth_m, sizes.height_m)),
        "cylinder": ("cylinder", (sizes.cylinder_radius_m, sizes.height_m)),
        "triangular_prism": ("prism", (sizes.prism_side_m, sizes.height_m)),
    }
    kinds = []
    for name, (shape, metres) in dimensions.items():
        ranges = {  # 0.92 and 1.08 times the size, in millimetres
            size: Range(round(920.0 * metre, 6), round(1080.0 * metre, 6))
            for size, metre in zip(SIZES[shape], metres, strict=True)
        }
        kinds.append(ObjectKind(name, shape, ranges, 1.0, "thesis", edge_m=get_edge_m(shape, sizes)))
    return tuple(kinds)


def has_thesis_approaches(name: str) -> bool:
    """Return whether the thesis has an object of this name, and thus approaches to it."""
    return any(item == name for item, _ in PALM_PLACEMENTS)


def read_mesh_kind(path: Path, name: str, scale: Range, unit_m: float, share: float = 1.0) -> ObjectKind:
    """Read a mesh file (STL, OBJ or PLY) as a kind of object, whose shape is the convex hull of the mesh.

    The hull is shifted so that it stands on the origin with the centre of its bottom; z points upwards. The mesh may
    have holes, because only its corners are used. scale: range of factors on the size. unit_m: length unit of the file,
    metres. share: frequency relative to the other kinds. Raises RecipeError; CloudFileError and OSError from reading.
    """
    if path.suffix.lower() not in MESH_READERS:
        endings = ", ".join(MESH_READERS)
        raise RecipeError(
            format_path(path),
            "name",
            f"a mesh file with one of the endings {endings}",
            path.suffix or "no ending",
            "rename it",
        )
    points = unit_m * np.asarray(MESH_READERS[path.suffix.lower()](Source.open(path))[0], dtype=np.float64)
    try:
        corners = points[ConvexHull(points).vertices]
    except (QhullError, ValueError):
        raise RecipeError(
            format_path(path), "vertices", "finite vertices that span a solid", "other ones", "use a mesh of a solid"
        ) from None
    size = float(np.ptp(corners, axis=0).max())
    if not SMALLEST_M <= size <= LARGEST_M:
        expected, remedy = f"a size of {SMALLEST_M} to {LARGEST_M} m", "give its unit (m, cm, mm)"
        raise RecipeError(format_path(path), "vertices", expected, f"{size:.4g} m", remedy)
    low, high = corners.min(axis=0), corners.max(axis=0)
    corners = corners - np.array([(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, low[2]])
    hull, outside_m = _select_corners(corners)
    return ObjectKind(name, "mesh", {"scale": scale}, share, "any", str(path), hull, outside_m)


def _select_corners(corners: FloatArray) -> tuple[FloatArray, float]:
    """Reduce the corners of a convex hull to at most `MAX_CORNERS`; also return the error of the reduced hull, metres.

    The outermost corners along the axes are selected first, then always the corner that is farthest from the selected
    corners. The error is the largest distance of a removed corner outside the reduced hull.
    """
    if len(corners) <= MAX_CORNERS:
        return corners, 0.0
    extremes = [int(index) for axis in corners.T for index in (axis.argmin(), axis.argmax())]
    selected = list(dict.fromkeys(extremes))
    distance = np.linalg.norm(corners[:, None] - corners[selected], axis=2).min(axis=1)
    while len(selected) < MAX_CORNERS:
        selected.append(int(distance.argmax()))
        distance = np.minimum(distance, np.linalg.norm(corners - corners[selected[-1]], axis=1))
    equations = ConvexHull(corners[selected]).equations
    outside = float((corners @ equations[:, :3].T + equations[:, 3]).max())
    return corners[np.sort(selected)], max(outside, 0.0)
