"""Readers and writers of clouds and meshes; the suffix of the file name selects the format."""

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final, TypeVar

from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.errors import CloudFileError
from taxel.cloud.files import obj, pcd, ply, stl, xyz
from taxel.cloud.files.source import Source
from taxel.cloud.mesh import TriangleMesh
from taxel.output import write_whole
from taxel.types import FloatArray, IntArray

PathLike = str | os.PathLike[str]
Handler = TypeVar("Handler")

CLOUD_READERS: Final[Mapping[str, Callable[[Source], ContactCloud]]] = {
    ".ply": ply.read_cloud,
    ".pcd": pcd.read_cloud,
    ".xyz": xyz.read_cloud,
    ".asc": xyz.read_cloud,
    ".txt": xyz.read_cloud,
}
CLOUD_WRITERS: Final[Mapping[str, Callable[[ContactCloud], bytes]]] = {
    ".ply": ply.encode_cloud,
    ".pcd": pcd.encode_cloud,
    ".xyz": xyz.encode_cloud,
    ".asc": xyz.encode_cloud,
    ".txt": xyz.encode_cloud,
}
MESH_READERS: Final[Mapping[str, Callable[[Source], tuple[FloatArray, IntArray]]]] = {
    ".ply": ply.read_mesh,
    ".stl": stl.read_mesh,
    ".obj": obj.read_mesh,
}
MESH_WRITERS: Final[Mapping[str, Callable[[TriangleMesh], bytes]]] = {
    ".ply": ply.encode_mesh,
    ".stl": stl.encode_mesh,
    ".obj": obj.encode_mesh,
}


def read_cloud(path: PathLike) -> ContactCloud:
    """Read a contact cloud from a PLY, PCD or XYZ file, metres.

    Raises CloudFileError for a malformed file, CloudError for points that are not finite, OSError.
    """
    return _select_handler(path, CLOUD_READERS, "a cloud")(Source.open(path))


def read_mesh(path: PathLike, unit_m: float = 1.0) -> TriangleMesh:
    """Read a triangle mesh from an STL, OBJ or PLY file. unit_m: length unit of the file in metres.

    Raises CloudFileError for a malformed file, MeshError for a mesh with holes or NaN, OSError.
    """
    vertices, faces = _select_handler(path, MESH_READERS, "a mesh")(Source.open(path))
    return TriangleMesh(str(path), unit_m * vertices, faces)


def write_cloud(cloud: ContactCloud, path: PathLike, *, overwrite: bool = False) -> None:
    """Write a contact cloud to a file; the suffix selects PLY, PCD or XYZ. PLY and PCD also store counts and grasps.

    Raises CloudFileError for an unknown suffix or an existing file, OSError.
    """
    _write(path, _select_handler(path, CLOUD_WRITERS, "a cloud")(cloud), overwrite)


def write_mesh(mesh: TriangleMesh, path: PathLike, *, overwrite: bool = False) -> None:
    """Write a mesh to a file, metres; the suffix selects the format.

    Raises CloudFileError for an unknown suffix or an existing file, OSError.
    """
    _write(path, _select_handler(path, MESH_WRITERS, "a mesh")(mesh), overwrite)


def has_triangles(path: PathLike) -> bool:
    """Whether a file contains triangles: an STL or OBJ, or a PLY with faces. Raises CloudFileError, OSError."""
    suffix = Path(path).suffix.lower()
    if suffix == ".ply":
        return ply.has_faces(Source.open(path))
    return suffix in MESH_READERS


def require_new_file(path: PathLike, overwrite: bool) -> None:
    """Raise CloudFileError for a file that exists, unless it may be overwritten."""
    if Path(path).exists() and not overwrite:
        raise CloudFileError(str(path), "file", "a new file", "one that exists", "choose another name or --overwrite")


def _select_handler(path: PathLike, table: Mapping[str, Handler], content: str) -> Handler:
    """Select the reader or writer for the suffix of a path. content: "a cloud" or "a mesh". Raises CloudFileError.

    table: reader or writer by suffix.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in table:
        suffixes = ", ".join(table)
        raise CloudFileError(
            str(path), "name", f"{content} that ends in {suffixes}", suffix or "no suffix", "rename it"
        )
    return table[suffix]


def _write(path: PathLike, content: bytes, overwrite: bool) -> None:
    """Write bytes to a new file. Raises CloudFileError for an existing file unless `overwrite` is set."""
    require_new_file(path, overwrite)
    write_whole(path, content, overwrite=overwrite)
