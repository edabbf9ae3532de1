"""Objects that are drawn: boxes, cylinders, prisms in ranges of sizes, and the convex hulls of mesh files."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
import numpy.typing as npt
from scipy.spatial import ConvexHull, QhullError

from taxel.cloud.files import MESH_READERS
from taxel.cloud.files.source import Source
from taxel.generate.errors import RecipeError
from taxel.generate.ranges import Range
from taxel.grasp import objects as thesis
from taxel.grasp.objects import EDGE_RADIUS_M, GraspObject
from taxel.grasp.plan import PLACINGS
from taxel.grasp.shapes import ConvexPolytope, Cylinder, Shape
from taxel.hand.errors import format_path

Solid = Literal["box", "cylinder", "prism", "mesh"]
SIZES: Final[Mapping[str, tuple[str, ...]]] = {
    "box": ("width_mm", "depth_mm", "height_mm"),
    "cylinder": ("radius_mm", "height_mm"),
    "prism": ("side_mm", "height_mm"),
    "mesh": ("scale",),
}
"""What is drawn of each solid. prism: upright, of three equal sides."""

MOST_CORNERS: Final = 80
"""Of a hull: contact costs time with every face. Of more, those that lie farthest apart are kept."""

SMALLEST_M, LARGEST_M = 0.005, 0.5
"""Of a mesh's extents; outside, its unit is taken to be mistaken."""


@dataclass(frozen=True, eq=False)
class ObjectKind:
    """A kind of object. name: the label of its grasps. sizes: by the names of `SIZES`. share: how often, relative to
    the others. approaches: "thesis", those that the thesis's object of this name has, or "any". file, hull: of a mesh;
    corners f64[v, 3], metres, upright at the origin. outside_m: how far corners that were left out lie outside it.
    """

    name: str
    shape: Solid
    sizes: Mapping[str, Range]
    share: float = 1.0
    approaches: Literal["thesis", "any"] = "any"
    file: str = ""
    hull: npt.NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 3)))
    outside_m: float = 0.0

    @property
    def varies(self) -> bool:
        """Whether each grasp has an object of its own."""
        return any(not one.fixed for one in self.sizes.values())

    @cached_property
    def _whole(self) -> ConvexPolytope:
        return ConvexPolytope.from_mesh(self.hull)

    def draw(self, rng: np.random.Generator) -> dict[str, float]:
        """Its sizes, by name."""
        return {name: one.draw(rng) for name, one in self.sizes.items()}

    def solid(self, sizes: Mapping[str, float], name: str) -> GraspObject:
        """The object of these sizes. Raises ShapeError where they bound no solid."""
        return GraspObject(name, self._shape(sizes), f"{self.shape}, drawn")

    def _shape(self, sizes: Mapping[str, float]) -> Shape:
        if self.shape == "mesh":
            return ConvexPolytope(self._whole.normals, sizes["scale"] * self._whole.offsets)
        metres = [1e-3 * sizes[name] for name in SIZES[self.shape]]
        if self.shape == "cylinder":
            return Cylinder(*metres)
        sharp = ConvexPolytope.box(*metres) if self.shape == "box" else ConvexPolytope.prism(*metres)
        return sharp.rounded(EDGE_RADIUS_M)

    def to_json(self) -> dict[str, Any]:
        """As plain values; a mesh by its corners' SHA-256, so that the same mesh under another path is the same."""
        plain = {name: getattr(self, name) for name in ("name", "shape", "share", "approaches")}
        plain["sizes"] = {name: one.to_json() for name, one in self.sizes.items()}
        if self.shape == "mesh":
            plain["corners"] = len(self.hull)
            plain["corners_sha256"] = hashlib.sha256(np.ascontiguousarray(self.hull).tobytes()).hexdigest()
        return plain


def default_kinds() -> tuple[ObjectKind, ...]:
    """The thesis's three objects, each size up to 8 % smaller or larger."""
    sizes = {
        "rectangular_prism": ("box", (thesis.BOX_WIDTH_M, thesis.BOX_DEPTH_M, thesis.BOX_HEIGHT_M)),
        "cylinder": ("cylinder", (thesis.CYLINDER_RADIUS_M, thesis.CYLINDER_HEIGHT_M)),
        "triangular_prism": ("prism", (thesis.PRISM_SIDE_M, thesis.PRISM_HEIGHT_M)),
    }
    kinds = []
    for name, (shape, metres) in sizes.items():
        ranges = {
            size: Range(round(920.0 * one, 6), round(1080.0 * one, 6))
            for size, one in zip(SIZES[shape], metres, strict=True)
        }
        kinds.append(ObjectKind(name, shape, ranges, 1.0, "thesis"))  # type: ignore[arg-type]
    return tuple(kinds)


def has_thesis_approaches(name: str) -> bool:
    """Whether the thesis grasps an object of this name."""
    return any(item == name for item, _ in PLACINGS)


def mesh_kind(path: Path, name: str, scale: Range, unit_m: float, share: float = 1.0) -> ObjectKind:
    """The convex hull of an STL, OBJ or PLY file, moved so that the middle of its bottom is the origin, z up.

    The mesh may have holes: only its corners count. Raises RecipeError; CloudFileError and OSError from reading.
    """
    if path.suffix.lower() not in MESH_READERS:
        known = ", ".join(MESH_READERS)
        raise RecipeError(
            format_path(path), "name", f"a mesh that ends in {known}", path.suffix or "no ending", "rename it"
        )
    points = unit_m * np.asarray(MESH_READERS[path.suffix.lower()](Source.open(path))[0], dtype=np.float64)
    try:
        corners = points[ConvexHull(points).vertices]
    except (QhullError, ValueError):
        raise RecipeError(
            format_path(path), "vertices", "finite ones that span a solid", "others", "use a mesh of a solid"
        ) from None
    size = float(np.ptp(corners, axis=0).max())
    if not SMALLEST_M <= size <= LARGEST_M:
        expected, remedy = f"a size of {SMALLEST_M} to {LARGEST_M} m", "give its unit (m, cm, mm)"
        raise RecipeError(format_path(path), "vertices", expected, f"{size:.4g} m", remedy)
    low, high = corners.min(axis=0), corners.max(axis=0)
    corners = corners - np.array([(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, low[2]])
    kept, inside = _spread(corners)
    return ObjectKind(name, "mesh", {"scale": scale}, share, "any", str(path), kept, inside)


def _spread(corners: npt.NDArray[np.float64]) -> tuple[npt.NDArray[np.float64], float]:
    """At most `MOST_CORNERS` of the corners, each next one the farthest from those before it, and how far the rest lies
    outside their hull, metres.
    """
    if len(corners) <= MOST_CORNERS:
        return corners, 0.0
    ends = [int(pick) for axis in corners.T for pick in (axis.argmin(), axis.argmax())]
    chosen = list(dict.fromkeys(ends))
    away = np.linalg.norm(corners[:, None] - corners[chosen], axis=2).min(axis=1)
    while len(chosen) < MOST_CORNERS:
        chosen.append(int(away.argmax()))
        away = np.minimum(away, np.linalg.norm(corners - corners[chosen[-1]], axis=1))
    equations = ConvexHull(corners[chosen]).equations
    outside = float((corners @ equations[:, :3].T + equations[:, 3]).max())
    return corners[np.sort(chosen)], max(outside, 0.0)
