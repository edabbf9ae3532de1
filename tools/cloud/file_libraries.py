"""Readers and writers of point and triangle files of several libraries behind one interface.

Every reader receives a path and returns the same `Contents`, so that the results of the libraries can be compared. A
library that has no reader for a format has no entry for that format.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from taxel.types import FloatArray, IntArray

Table = dict[str, FloatArray]
"""Columns of a file by their names, each f64[n]."""


@dataclass
class Contents:
    """Content of a file; None for a part that the file or the library does not have.

    points: f64[n, 3]. counts: f64[n]. grasps: names of the grasps. grasp, taxel: i64[n], index of the grasp and of the
    taxel of each point. silent: f64[m, 3], taxels that were read and not active. vertices: f64[v, 3]. faces: i64[t, 3].
    """

    points: FloatArray | None = None
    counts: FloatArray | None = None
    grasps: list[str] | None = None
    grasp: IntArray | None = None
    taxel: IntArray | None = None
    silent: FloatArray | None = None
    vertices: FloatArray | None = None
    faces: IntArray | None = None

    @property
    def corners(self) -> FloatArray | None:
        """Vertices of each triangle, f64[t, 3, 3]."""
        return None if self.vertices is None or self.faces is None else self.vertices[self.faces]


Reader = Callable[[Path], Contents]
CloudWriter = Callable[[Path, Table], None]
MeshWriter = Callable[[Path, FloatArray, IntArray], None]


@dataclass(frozen=True)
class FileLibrary:
    """One library. readers, cloud_writers and mesh_writers are ordered by format ("ply mesh": a PLY with faces).

    package: name of the distribution, "" for the project itself.
    """

    name: str
    package: str
    readers: dict[str, Reader]
    cloud_writers: dict[str, CloudWriter] = field(default_factory=dict)
    mesh_writers: dict[str, MeshWriter] = field(default_factory=dict)


def load_taxel() -> FileLibrary:
    """Load the readers and writers of this project's own module `taxel.cloud.files`."""
    from taxel.cloud.contact_cloud import ContactCloud
    from taxel.cloud.files import MESH_READERS, read_cloud, write_cloud, write_mesh
    from taxel.cloud.files.source import Source
    from taxel.cloud.mesh import TriangleMesh

    def read_points(path: Path) -> Contents:
        """Read a point cloud file with taxel, including grasp names, counts and inactive points."""
        cloud = read_cloud(path)
        named = any(cloud.grasps)
        return Contents(
            cloud.points,
            None if np.isnan(cloud.counts).any() else cloud.counts,
            list(cloud.grasps) if named else None,
            cloud.grasp if named else None,
            cloud.taxel if named else None,
            cloud.inactive_points if len(cloud.inactive_points) else None,
        )

    def read_triangles(path: Path) -> Contents:
        """Read a triangle mesh with taxel. The suffix of the file selects the format."""
        vertices, faces = MESH_READERS[path.suffix](Source.open(path))
        return Contents(vertices=vertices, faces=faces)

    def write_points(path: Path, table: Table) -> None:
        """Write a point cloud with taxel. table: columns x, y, z and counts, each f64[n]."""
        points = np.column_stack([table[axis] for axis in "xyz"])
        write_cloud(ContactCloud.from_points(points, table["counts"]), path, overwrite=True)

    def write_triangles(path: Path, vertices: FloatArray, faces: IntArray) -> None:
        """Write a triangle mesh with taxel. vertices: f64[v, 3]. faces: i64[t, 3]."""
        write_mesh(TriangleMesh("mesh", vertices, faces), path, overwrite=True)

    return FileLibrary(
        "taxel.cloud.files",
        "",
        {
            **dict.fromkeys(("ply", "pcd", "xyz"), read_points),
            **dict.fromkeys(("ply mesh", "stl", "obj"), read_triangles),
        },
        dict.fromkeys(("ply", "pcd", "xyz"), write_points),
        dict.fromkeys(("ply mesh", "stl", "obj"), write_triangles),
    )


def load_trimesh() -> FileLibrary:
    """Load the readers and writers of the library trimesh.

    Files are passed as open streams, so that the loader of OBJ cannot open material libraries.
    """
    import trimesh  # type: ignore[import-not-found,unused-ignore]

    def load(path: Path) -> Any:
        """Load a file with trimesh without merging of vertices. The suffix of the file selects the format."""
        with path.open("rb") as file:
            return trimesh.load(file, file_type=path.suffix[1:], process=False)

    def read_ply(path: Path) -> Contents:
        """Read a PLY point cloud with trimesh, from the raw elements that trimesh keeps as metadata.

        The element `silent` contains the positions of the taxels that were read and not active.
        """
        elements = load(path).metadata["_ply_raw"]
        tables = {
            name: {key: np.ravel(element["data"][key]) for key in element["properties"]}
            for name, element in elements.items()
        }
        return build_contents(tables["vertex"], tables.get("silent"))

    def read_xyz(path: Path) -> Contents:
        return Contents(np.asarray(load(path).vertices, np.float64))

    def read_triangles(path: Path) -> Contents:
        """Read a triangle mesh with trimesh."""
        mesh = load(path)
        return Contents(vertices=np.asarray(mesh.vertices, np.float64), faces=np.asarray(mesh.faces, np.int64))

    def write_triangles(path: Path, vertices: FloatArray, faces: IntArray) -> None:
        trimesh.Trimesh(vertices, faces, process=False).export(path)

    def write_points(path: Path, table: Table) -> None:
        trimesh.PointCloud(np.column_stack([table[axis] for axis in "xyz"])).export(path)

    return FileLibrary(
        "trimesh",
        "trimesh",
        {"ply": read_ply, "xyz": read_xyz, **dict.fromkeys(("ply mesh", "stl", "obj"), read_triangles)},
        dict.fromkeys(("ply", "xyz"), write_points),
        dict.fromkeys(("ply mesh", "stl", "obj"), write_triangles),
    )


def load_meshio() -> FileLibrary:
    """Load the readers and writers of the library meshio."""
    import meshio  # type: ignore[import-not-found,unused-ignore]

    def read_points(path: Path) -> Contents:
        """Read a PLY point cloud with meshio."""
        mesh = meshio.read(path, file_format="ply")
        columns = {name: np.asarray(column, np.float64) for name, column in mesh.point_data.items()}
        return build_contents({**dict(zip("xyz", np.asarray(mesh.points, np.float64).T, strict=True)), **columns}, None)

    def read_triangles(path: Path) -> Contents:
        """Read a triangle mesh with meshio. The suffix of the file selects the format."""
        mesh = meshio.read(path, file_format=path.suffix[1:])
        faces = np.asarray(mesh.cells_dict["triangle"], np.int64)
        return Contents(vertices=np.asarray(mesh.points, np.float64), faces=faces)

    def write_points(path: Path, table: Table) -> None:
        """Write a PLY text file with meshio. table: columns x, y, z and counts, each f64[n]."""
        points = np.column_stack([table[axis] for axis in "xyz"])
        meshio.Mesh(points, [], {"counts": table["counts"]}).write(path, file_format="ply", binary=False)

    def write_triangles(path: Path, vertices: FloatArray, faces: IntArray) -> None:
        meshio.Mesh(vertices, [("triangle", faces)]).write(path, file_format=path.suffix[1:])

    return FileLibrary(
        "meshio",
        "meshio",
        {"ply": read_points, **dict.fromkeys(("ply mesh", "stl", "obj"), read_triangles)},
        {"ply": write_points},
        dict.fromkeys(("ply mesh", "stl", "obj"), write_triangles),
    )


def load_plyfile() -> FileLibrary:
    """Load the readers and writers of the library plyfile."""
    import plyfile  # type: ignore[import-not-found,unused-ignore]

    def read_columns(element: Any) -> Table:
        return {name: np.asarray(element.data[name], np.float64) for name in element.data.dtype.names}

    def read_points(path: Path) -> Contents:
        """Read a PLY point cloud with plyfile. The names of the grasps are in comments of the file.

        The element `silent` contains the positions of the taxels that were read and not active.
        """
        data = plyfile.PlyData.read(path)
        tables = {element.name: read_columns(element) for element in data.elements}
        contents = build_contents(tables["vertex"], tables.get("silent"))
        names = [line.split(" ", 3)[3] for line in data.comments if line.startswith("taxel.grasp ")]
        contents.grasps = names or None
        return contents

    def read_triangles(path: Path) -> Contents:
        """Read a PLY triangle mesh with plyfile."""
        data = plyfile.PlyData.read(path)
        points = np.column_stack([np.asarray(data["vertex"][axis], np.float64) for axis in "xyz"])
        faces = np.stack(list(data["face"]["vertex_indices"])).astype(np.int64)
        return Contents(vertices=points, faces=faces)

    def write_points(path: Path, table: Table) -> None:
        """Write columns of numbers as the vertices of a PLY text file with plyfile."""
        rows = np.empty(len(table["x"]), [(name, "f8") for name in table])
        for name, column in table.items():
            rows[name] = column
        plyfile.PlyData([plyfile.PlyElement.describe(rows, "vertex")], text=True).write(path)

    def write_triangles(path: Path, vertices: FloatArray, faces: IntArray) -> None:
        """Write a triangle mesh as a PLY text file with plyfile. vertices: f64[v, 3]; faces: i64[t, 3]."""
        corners = np.empty(len(faces), [("vertex_indices", "i4", (3,))])
        corners["vertex_indices"] = faces
        points = np.array([tuple(row) for row in vertices.tolist()], [(axis, "f8") for axis in "xyz"])
        elements = [plyfile.PlyElement.describe(points, "vertex"), plyfile.PlyElement.describe(corners, "face")]
        plyfile.PlyData(elements, text=True).write(path)

    return FileLibrary(
        "plyfile",
        "plyfile",
        {"ply": read_points, "ply mesh": read_triangles},
        {"ply": write_points},
        {"ply mesh": write_triangles},
    )


def load_pypcd4() -> FileLibrary:
    """Load the readers and writers of the library pypcd4."""
    import pypcd4  # type: ignore[import-not-found,unused-ignore]

    def read_points(path: Path) -> Contents:
        """Read a PCD point cloud with pypcd4."""
        cloud = pypcd4.PointCloud.from_path(path)
        names = cloud.fields
        return build_contents({name: np.asarray(cloud.pc_data[name], np.float64) for name in names}, None)

    def write_points(path: Path, table: Table) -> None:
        """Write columns of numbers as a PCD text file with pypcd4."""
        columns = list(table.values())
        pypcd4.PointCloud.from_points(columns, tuple(table), (np.float64,) * len(columns)).save(
            path, pypcd4.Encoding.ASCII
        )

    return FileLibrary("pypcd4", "pypcd4", {"pcd": read_points}, {"pcd": write_points})


def load_numpy() -> FileLibrary:
    """Load the readers and writers of point clouds as text, by `numpy.loadtxt` and `numpy.savetxt`."""

    def read_points(path: Path) -> Contents:
        """Read a text file of numbers with NumPy: three columns of coordinates and, if present, one of counts."""
        rows = np.loadtxt(path, comments=("#", "//"), ndmin=2)
        return Contents(rows[:, :3], rows[:, 3] if rows.shape[1] > 3 else None)

    def write_points(path: Path, table: Table) -> None:
        np.savetxt(path, np.column_stack([table[name] for name in ("x", "y", "z", "counts")]), fmt="%.17g")

    return FileLibrary("numpy.loadtxt", "", {"xyz": read_points}, {"xyz": write_points})


def load_igl() -> FileLibrary:
    """Load the readers and writers of libigl, which supports triangle meshes only."""
    import igl

    def read_triangles(path: Path) -> Contents:
        """Read a triangle mesh with libigl. The suffix of the file selects the format."""
        vertices, faces = igl.read_triangle_mesh(str(path))
        return Contents(vertices=np.asarray(vertices, np.float64), faces=np.asarray(faces, np.int64))

    def write_triangles(path: Path, vertices: FloatArray, faces: IntArray) -> None:
        igl.write_triangle_mesh(str(path), vertices, faces)

    kinds = ("ply mesh", "stl", "obj")
    return FileLibrary(
        "libigl", "libigl", dict.fromkeys(kinds, read_triangles), mesh_writers=dict.fromkeys(kinds, write_triangles)
    )


def build_contents(columns: Table, silent: Table | None) -> Contents:
    """Build a point cloud from the named columns of a file.

    columns: x, y, z and, where present, counts, grasp and taxel, each f64[n]. silent: the same columns for taxels that
    were read and not active; None without such taxels. CloudCompare writes `scalar_` before the names of its columns.
    """
    by_name = {name.removeprefix("scalar_"): np.asarray(column, np.float64) for name, column in columns.items()}
    has_grasps = "grasp" in by_name
    return Contents(
        points=np.column_stack([by_name[axis] for axis in "xyz"]),
        counts=by_name.get("counts"),
        grasp=by_name["grasp"].astype(np.int64) if has_grasps else None,
        taxel=by_name["taxel"].astype(np.int64) if "taxel" in by_name else None,
        silent=None if silent is None else np.column_stack([silent[axis] for axis in "xyz"]),
    )


LOADERS: dict[str, Callable[[], FileLibrary]] = {
    "taxel.cloud.files": load_taxel,
    "trimesh": load_trimesh,
    "meshio": load_meshio,
    "plyfile": load_plyfile,
    "pypcd4": load_pypcd4,
    "libigl": load_igl,
    "numpy.loadtxt": load_numpy,
}
"""Functions that import a library and return its readers and writers, by the library's name."""
