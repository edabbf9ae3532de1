"""Targets: clouds and meshes."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Final

import numpy as np

from fuzz_files.binary_codecs import BinaryStl, BinaryTable
from fuzz_files.codec import Codec
from fuzz_files.document import Flat
from fuzz_files.target import Rules, Target
from fuzz_files.text_codecs import Words
from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.files import read_cloud, read_mesh, write_cloud, write_mesh
from taxel.cloud.mesh import TriangleMesh

POINTS: Final = np.array([[0.0, 0.0, 0.0], [0.04, 0.0, 0.0], [0.0, 0.03, 0.0], [0.0, 0.0, 0.02]])
FACES: Final = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])

_ASCII_PLY: Final = """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
element face 4
property list uchar int vertex_indices
end_header
"""


def make_ascii_ply() -> str:
    """Create a tetrahedron in the text form of PLY."""
    rows = [" ".join(map(str, point)) for point in POINTS] + [f"3 {' '.join(map(str, face))}" for face in FACES]
    return _ASCII_PLY + "\n".join(rows) + "\n"


def make_ascii_stl() -> str:
    """Create a tetrahedron in the text form of STL."""
    lines = ["solid a"]
    for face in FACES:
        corners = [f"vertex {' '.join(map(str, POINTS[corner]))}" for corner in face]
        lines += ["facet normal 0 0 1", "outer loop", *corners, "endloop", "endfacet"]
    return "\n".join([*lines, "endsolid a"]) + "\n"


def _write_text(name: str, make_text: Callable[[], str]) -> Callable[[Path], str]:
    """Return a function that writes the result of `make_text` to the file `name`."""

    def make(folder: Path) -> str:
        """Write the text and return the file's name."""
        (folder / name).write_text(make_text())
        return name

    return make


def _write_mesh(name: str) -> Callable[[Path], str]:
    """Return a function that writes a tetrahedron to the file `name`, whose suffix selects the format."""

    def make(folder: Path) -> str:
        """Write the mesh and return the file's name."""
        write_mesh(TriangleMesh("a", POINTS, FACES), folder / name)
        return name

    return make


def _write_cloud(name: str) -> Callable[[Path], str]:
    """Return a function that writes a cloud of twelve points to the file `name`, whose suffix selects the format."""

    def make(folder: Path) -> str:
        """Write the cloud and return the file's name."""
        points = np.random.default_rng(5).random((12, 3)).astype(np.float32).astype(float)
        write_cloud(ContactCloud.from_points(points), folder / name)
        return name

    return make


def read_mesh_data(path: Path) -> Flat:
    """Read the vertices and triangles of a mesh."""
    mesh = read_mesh(path)
    return {"vertices": mesh.vertices, "faces": mesh.faces}


def read_cloud_data(path: Path) -> Flat:
    """Read the points, counts and grasps of a cloud."""
    cloud = read_cloud(path)
    return {name: value for name, value in vars(cloud).items() if isinstance(value, np.ndarray)}


def _mesh(name: str, make: Callable[[Path], str], codec: Codec, suffix: str, weight: float = 6.0) -> Target:
    """Create the target of a mesh file, whose normals and names do not affect the data."""
    return Target(name, make, ((rf"\.{suffix}$", (codec,)),), read_mesh_data, weight, _MESH)


def _cloud(name: str, codec: Codec, suffix: str) -> Target:
    """Create the target of a cloud file."""
    return Target(name, _write_cloud(f"a.{suffix}"), ((rf"\.{suffix}$", (codec,)),), read_cloud_data, 6.0, _MESH)


_MESH: Final = Rules(derived=re.compile(""))

TARGETS: Final = (
    _mesh("stl", _write_mesh("a.stl"), BinaryStl(), "stl"),
    _mesh("text-stl", _write_text("a.stl", make_ascii_stl), Words(), "stl"),
    _mesh("ply", _write_mesh("a.ply"), BinaryTable(b"end_header\n", "<3d"), "ply"),
    _mesh("text-ply", _write_text("a.ply", make_ascii_ply), Words(), "ply"),
    _mesh("obj", _write_mesh("a.obj"), Words(), "obj"),
    _cloud("cloud-ply", BinaryTable(b"end_header\n", "<3d"), "ply"),
    _cloud("pcd", Words(), "pcd"),
    _cloud("xyz", Words(), "xyz"),
)
