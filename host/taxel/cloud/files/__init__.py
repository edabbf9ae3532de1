"""Clouds and meshes in files, by the ending of the file's name."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final, TypeVar

from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.errors import CloudFileError
from taxel.cloud.files import obj, pcd, ply, stl, xyz
from taxel.cloud.files.source import Source
from taxel.cloud.mesh import TriangleMesh
from taxel.types import FloatArray, IntArray

PathLike = str | os.PathLike[str]
Found = TypeVar("Found")

CLOUD_READERS: Final[Mapping[str, Callable[[Source], ContactCloud]]] = {
    ".ply": ply.read_cloud,
    ".pcd": pcd.read,
    ".xyz": xyz.read,
    ".asc": xyz.read,
    ".txt": xyz.read,
}
CLOUD_WRITERS: Final[Mapping[str, Callable[[ContactCloud], bytes]]] = {
    ".ply": ply.cloud_bytes,
    ".pcd": pcd.to_bytes,
    ".xyz": xyz.to_bytes,
    ".asc": xyz.to_bytes,
    ".txt": xyz.to_bytes,
}
MESH_READERS: Final[Mapping[str, Callable[[Source], tuple[FloatArray, IntArray]]]] = {
    ".ply": ply.read_mesh,
    ".stl": stl.read,
    ".obj": obj.read,
}
MESH_WRITERS: Final[Mapping[str, Callable[[TriangleMesh], bytes]]] = {
    ".ply": ply.mesh_bytes,
    ".stl": stl.to_bytes,
    ".obj": obj.to_bytes,
}


def read_cloud(path: PathLike) -> ContactCloud:
    """The cloud of a PLY, PCD or XYZ file, metres. Raises CloudFileError; OSError if there is no such file."""
    return _of(path, CLOUD_READERS, "a cloud")(Source.open(path))


def read_mesh(path: PathLike, unit_m: float = 1.0) -> TriangleMesh:
    """The mesh of an STL, OBJ or PLY file. unit_m: metres that 1 is in the file.

    Raises CloudFileError for a file that is not as its format says, MeshError for a mesh with holes or NaN, OSError.
    """
    vertices, faces = _of(path, MESH_READERS, "a mesh")(Source.open(path))
    return TriangleMesh(str(path), unit_m * vertices, faces)


def write_cloud(cloud: ContactCloud, path: PathLike, *, overwrite: bool = False) -> None:
    """Write a cloud. Counts, grasps and approaches where the format can hold them. Raises CloudFileError, OSError."""
    _write(path, _of(path, CLOUD_WRITERS, "a cloud")(cloud), overwrite)


def write_mesh(mesh: TriangleMesh, path: PathLike, *, overwrite: bool = False) -> None:
    """Write a mesh, metres. Raises CloudFileError for an unknown ending or a file that is there already; OSError."""
    _write(path, _of(path, MESH_WRITERS, "a mesh")(mesh), overwrite)


def holds_mesh(path: PathLike) -> bool:
    """Whether a file is of triangles: an STL or OBJ, or a PLY with faces. Raises CloudFileError, OSError."""
    ending = Path(path).suffix.lower()
    if ending == ".ply":
        return ply.has_faces(Source.open(path))
    return ending in MESH_READERS


def require_free(path: PathLike, overwrite: bool) -> None:
    """Refuse a file that exists already, unless it may be replaced."""
    if Path(path).exists() and not overwrite:
        raise CloudFileError(str(path), "file", "a new file", "one that exists", "choose another name or --overwrite")


def _of(path: PathLike, table: Mapping[str, Found], what: str) -> Found:
    ending = Path(path).suffix.lower()
    if ending not in table:
        known = ", ".join(table)
        raise CloudFileError(str(path), "name", f"{what} that ends in {known}", ending or "no ending", "rename it")
    return table[ending]


def _write(path: PathLike, content: bytes, overwrite: bool) -> None:
    require_free(path, overwrite)
    Path(path).write_bytes(content)
