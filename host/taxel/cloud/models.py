"""Shapes to match a cloud with: the three objects of the thesis, a sphere, a hexagonal prism, a cone, and mesh files.

All shapes stand upright in the object frame of a dataset: origin at the centre of the base, z upward, metres.
"""

from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Final

import numpy as np

from taxel.cloud.errors import MeshError
from taxel.cloud.files import read_mesh
from taxel.cloud.mesh import TriangleMesh
from taxel.grasp.objects import make_thesis_objects
from taxel.grasp.shapes import ConvexPolytope
from taxel.types import FloatArray

SPHERE_RADIUS_M: Final = 0.035
HEXAGON_SIDE_M: Final = 0.030
CONE_RADIUS_M: Final = 0.035
HEIGHT_M: Final = 0.130
"""Sizes of objects that the hand can grasp, chosen so that no shape is nearly equal to an object of the thesis,
metres."""

EDGE_RADIUS_M: Final = 0.001
"""Radius of the rounded edges of the hexagonal prism, metres: the same as of the triangular prism of the thesis."""

CIRCLE_CORNERS: Final = 64
"""Number of corners of the polygon that approximates a circle, as for the cylinder of the datasets."""


@cache
def get_builtin_models() -> dict[str, TriangleMesh]:
    """Return the built-in shape models, meshes of test objects, by name."""
    models = {name: TriangleMesh(name, *item.shape.mesh()) for name, item in make_thesis_objects().items()}
    models["sphere"] = build_sphere(SPHERE_RADIUS_M)
    models["hexagonal_prism"] = build_hexagonal_prism(HEXAGON_SIDE_M, HEIGHT_M)
    models["cone"] = build_cone(CONE_RADIUS_M, HEIGHT_M)
    return models


def load_model(name: str, unit_m: float = 1.0) -> TriangleMesh:
    """Load a shape model: a built-in shape by its name, or the mesh of a file.

    unit_m: length unit of the file in metres. Raises MeshError for a name that is neither, CloudFileError for a file
    that cannot be read.
    """
    if name in get_builtin_models():
        return get_builtin_models()[name]
    if not Path(name).exists():
        names = ", ".join(get_builtin_models())
        raise MeshError(name, "model", f"a mesh file or one of {names}", "neither", "correct the name")
    return read_mesh(name, unit_m)


def load_models(names: Iterable[str], unit_m: float = 1.0) -> dict[str, TriangleMesh]:
    """Load several shape models by name or file, in the given order; without names, all built-in shapes.

    Raises MeshError and CloudFileError, as `load_model`.
    """
    unique_names = list(dict.fromkeys(names)) or list(get_builtin_models())
    return {name: load_model(name, unit_m) for name in unique_names}


def build_sphere(radius: float) -> TriangleMesh:
    """Build the mesh of a sphere that rests on the plane z = 0. radius: metres."""
    steps = CIRCLE_CORNERS // 2
    polar = np.pi * np.arange(1, steps) / steps
    rings = np.stack([radius * np.sin(polar), radius - radius * np.cos(polar)], axis=1)
    return _revolve("sphere", rings, 2.0 * radius)


def build_cone(radius: float, height: float) -> TriangleMesh:
    """Build the mesh of an upright cone that stands on its base. radius, height: metres."""
    return _revolve("cone", np.array([[radius, 0.0]]), height)


def build_hexagonal_prism(side: float, height: float) -> TriangleMesh:
    """Build the mesh of an upright regular hexagonal prism with rounded edges; a side face has the normal +y.

    side, height: metres.
    """
    angles = np.pi / 6 + np.arange(6) * np.pi / 3
    around = np.stack([np.cos(angles), np.sin(angles), np.zeros(6)], axis=1)
    normals = np.concatenate([around, [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]])
    offsets = np.array([side * np.sqrt(3.0) / 2.0] * 6 + [height, 0.0])
    return TriangleMesh("hexagonal_prism", *ConvexPolytope(normals, offsets).rounded(EDGE_RADIUS_M).mesh())


def _revolve(name: str, rings: FloatArray, height: float) -> TriangleMesh:
    """Build the mesh of a solid of revolution about the z axis, from the origin over rings to its tip at `height`.

    rings: radius and z of each ring, f64[r, 2], metres, from bottom to top.
    """
    angles = 2.0 * np.pi * np.arange(CIRCLE_CORNERS) / CIRCLE_CORNERS
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    corners = [np.column_stack([radius * circle, np.full(CIRCLE_CORNERS, z)]) for radius, z in rings]
    vertices = np.concatenate([*corners, [[0.0, 0.0, 0.0], [0.0, 0.0, height]]])
    corner, next_corner = np.arange(CIRCLE_CORNERS), (np.arange(CIRCLE_CORNERS) + 1) % CIRCLE_CORNERS
    bottom, top = len(vertices) - 2, len(vertices) - 1
    last = CIRCLE_CORNERS * (len(rings) - 1)
    faces = [
        (np.full(CIRCLE_CORNERS, bottom), next_corner, corner),
        (corner + last, next_corner + last, np.full(CIRCLE_CORNERS, top)),
    ]
    for low in range(0, last, CIRCLE_CORNERS):
        high = low + CIRCLE_CORNERS
        faces += [
            (corner + low, next_corner + low, next_corner + high),
            (corner + low, next_corner + high, corner + high),
        ]
    return TriangleMesh(name, vertices, np.concatenate([np.stack(face, axis=1) for face in faces]))
