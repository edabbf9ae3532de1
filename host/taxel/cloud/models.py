"""Shapes that a cloud can be matched to: the thesis's three objects, a sphere, a hexagonal prism, a cone, mesh files.

All stand upright at the origin, in the frame that objects have in a dataset: the middle of the bottom, z up; metres.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Final

import numpy as np

from taxel.cloud.errors import MeshError
from taxel.cloud.files import read_mesh
from taxel.cloud.mesh import TriangleMesh
from taxel.grasp.objects import EDGE_RADIUS_M, thesis_objects
from taxel.grasp.shapes import ConvexPolytope
from taxel.types import FloatArray

SPHERE_RADIUS_M: Final = 0.035
HEXAGON_SIDE_M: Final = 0.030
CONE_RADIUS_M: Final = 0.035
HEIGHT_M: Final = 0.130
"""Sizes are of things that the hand can hold, none of them so near one of the thesis's objects that they are alike."""

AROUND: Final = 64
"""Corners of a circle, as the cylinder of the datasets has."""

THESIS: Final = ("rectangular_prism", "cylinder", "triangular_prism")


@cache
def models() -> dict[str, TriangleMesh]:
    """The built-in shapes by name."""
    built = {name: TriangleMesh(name, *item.shape.mesh()) for name, item in thesis_objects().items()}
    built["sphere"] = sphere(SPHERE_RADIUS_M)
    built["hexagonal_prism"] = hexagonal_prism(HEXAGON_SIDE_M, HEIGHT_M)
    built["cone"] = cone(CONE_RADIUS_M, HEIGHT_M)
    return built


def model(name: str, unit_m: float = 1.0) -> TriangleMesh:
    """A built-in shape by its name, or the mesh of a file; unit_m: metres that 1 is in that file.

    Raises MeshError for a name that is neither, CloudFileError for a file that cannot be read.
    """
    if name in models():
        return models()[name]
    if not Path(name).exists():
        known = ", ".join(models())
        raise MeshError(name, "model", f"a mesh file or one of {known}", "neither", "correct the name")
    return read_mesh(name, unit_m)


def chosen_models(names: Iterable[str], unit_m: float = 1.0) -> dict[str, TriangleMesh]:
    """Several models by name or file, in the order given; none given: all that are built in."""
    wanted = list(dict.fromkeys(names)) or list(models())
    return {name: model(name, unit_m) for name in wanted}


def sphere(radius: float) -> TriangleMesh:
    """A sphere that rests on the plane z = 0."""
    steps = AROUND // 2
    polar = np.pi * np.arange(1, steps) / steps
    rings = np.stack([radius * np.sin(polar), radius - radius * np.cos(polar)], axis=1)
    return _turned("sphere", rings, 2.0 * radius)


def cone(radius: float, height: float) -> TriangleMesh:
    """An upright cone on its base."""
    return _turned("cone", np.array([[radius, 0.0]]), height)


def hexagonal_prism(side: float, height: float) -> TriangleMesh:
    """An upright regular hexagonal prism with rounded edges; one side face looks along +y."""
    angles = np.pi / 6 + np.arange(6) * np.pi / 3
    around = np.stack([np.cos(angles), np.sin(angles), np.zeros(6)], axis=1)
    normals = np.concatenate([around, [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]])
    offsets = np.array([side * np.sqrt(3.0) / 2.0] * 6 + [height, 0.0])
    return TriangleMesh("hexagonal_prism", *ConvexPolytope(normals, offsets).rounded(EDGE_RADIUS_M).mesh())


def _turned(name: str, rings: FloatArray, height: float) -> TriangleMesh:
    """A solid of revolution from the origin over rings (radius, z), f64[r, 2], to its tip at `height`."""
    angles = 2.0 * np.pi * np.arange(AROUND) / AROUND
    circle = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    corners = [np.column_stack([radius * circle, np.full(AROUND, z)]) for radius, z in rings]
    vertices = np.concatenate([*corners, [[0.0, 0.0, 0.0], [0.0, 0.0, height]]])
    here, ahead = np.arange(AROUND), (np.arange(AROUND) + 1) % AROUND
    bottom, top = len(vertices) - 2, len(vertices) - 1
    last = AROUND * (len(rings) - 1)
    faces = [(np.full(AROUND, bottom), ahead, here), (here + last, ahead + last, np.full(AROUND, top))]
    for low in range(0, last, AROUND):
        high = low + AROUND
        faces += [(here + low, ahead + low, ahead + high), (here + low, ahead + high, here + high)]
    return TriangleMesh(name, vertices, np.concatenate([np.stack(face, axis=1) for face in faces]))
