"""Clouds and meshes in files: what is written is read again, and a hostile file is one line."""

from __future__ import annotations

import struct
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.errors import CloudError, CloudFileError, MeshError
from taxel.cloud.files import holds_mesh, obj, pcd, ply, read_cloud, read_mesh, stl, write_cloud, write_mesh, xyz
from taxel.cloud.files.source import Source
from taxel.cloud.mesh import TriangleMesh
from taxel.cloud.models import models
from taxel.errors import TaxelError

CLOUDS, MESHES = (".ply", ".pcd", ".xyz", ".asc"), (".ply", ".stl", ".obj")
NUMBER = st.floats(-1e6, 1e6)
POINTS = hnp.arrays(np.float64, st.tuples(st.integers(1, 20), st.just(3)), elements=NUMBER)
READERS = {"ply": ply.read_cloud, "ply mesh": ply.read_mesh, "pcd": pcd.read, "xyz": xyz.read, "stl": stl.read}
READERS["obj"] = obj.read


@pytest.mark.parametrize("ending", CLOUDS)
@pytest.mark.parametrize("known", [True, False], ids=["counts", "no counts"])
def test_a_cloud_survives_its_file(tmp_path, surface_cloud, ending, known):
    cloud = surface_cloud("cone")
    if not known:
        cloud = replace(cloud, counts=np.full(len(cloud), np.nan))
    path = tmp_path / f"cloud{ending}"
    write_cloud(cloud, path)
    found = read_cloud(path)
    assert (found.points == cloud.points).all()
    assert np.array_equal(found.counts, cloud.counts, equal_nan=True)
    if ending in (".ply", ".pcd"):
        assert (found.grasp == cloud.grasp).all()
        assert (found.taxel == cloud.taxel).all()
        assert (found.approach == cloud.approach).all()
        assert (found.grasps, found.approaches) == (cloud.grasps, cloud.approaches)


def with_silent(cloud):
    """Five taxels that felt nothing, in two of its grasps."""
    return replace(cloud, quiet=np.arange(15.0).reshape(5, 3) / 7.0, quiet_grasp=np.array([1, 1, 6, 6, 6]))


@pytest.mark.parametrize("ending", CLOUDS)
def test_what_felt_nothing_survives_in_a_ply_alone(tmp_path, surface_cloud, ending):
    cloud, path = with_silent(surface_cloud("cone")), tmp_path / f"cloud{ending}"
    write_cloud(cloud, path)
    found = read_cloud(path)
    assert len(found) == len(cloud)
    assert len(found.quiet) == (5 if ending == ".ply" else 0)
    if ending == ".ply":
        assert (found.quiet == cloud.quiet).all()
        assert (found.quiet_grasp == cloud.quiet_grasp).all()
        assert (found.points == cloud.points).all()


@pytest.mark.parametrize(
    ("old", "new", "found"),
    [
        ("property int grasp\nend_header", "property int other\nend_header", "silent: expected x, y, z and grasp"),
        ("property double z\nproperty int grasp\nend", "property double w\nproperty int grasp\nend", "no z"),
        ("element silent 5", "element silent 6", "silent: expected 24 numbers, found 20; use the whole file"),
        (" 6\n", " 8\n", "quiet_grasp: expected rows of the 8 grasps, found 1 to 8"),
        (" 6\n", " 1.5\n", "silent grasp: expected"),
        (" 6\n", " nan\n", "silent grasp: expected"),
    ],
)
def test_damaged_rows_of_what_felt_nothing_are_one_line(tmp_path, surface_cloud, old, new, found):
    path = tmp_path / "cloud.ply"
    write_cloud(with_silent(surface_cloud("cone")), path)
    assert old in path.read_text()
    path.write_text(new.join(path.read_text().rsplit(old, 1)))  # the last: that of the silent rows
    with pytest.raises(CloudError, match=found):
        read_cloud(path)


def test_rows_of_what_felt_nothing_are_of_no_use_without_names_of_grasps(tmp_path, surface_cloud):
    path = tmp_path / "cloud.ply"
    write_cloud(with_silent(surface_cloud("cone")), path)
    path.write_text("".join(line for line in path.read_text().splitlines(True) if not line.startswith("comment")))
    assert len(read_cloud(path).quiet) == 0
    nameless = replace(
        ContactCloud.of_points(surface_cloud("cone").points), quiet=np.ones((5, 3)), quiet_grasp=np.zeros(5, np.int64)
    )
    assert b"silent" not in ply.cloud_bytes(nameless)


@settings(max_examples=40, deadline=None, derandomize=True)
@given(POINTS, st.sampled_from(["ply", "pcd", "xyz"]))
def test_no_digit_is_lost(points, name):
    write = {"ply": ply.cloud_bytes, "pcd": pcd.to_bytes, "xyz": xyz.to_bytes}[name]
    assert (READERS[name](Source("file", write(ContactCloud.of_points(points)))).points == points).all()


@pytest.mark.parametrize("ending", MESHES)
@pytest.mark.parametrize("name", models())
def test_a_mesh_survives_its_file(tmp_path, ending, name):
    mesh, path = models()[name], tmp_path / f"mesh{ending}"
    write_mesh(mesh, path)
    assert holds_mesh(path)
    found = read_mesh(path)
    assert len(found.vertices) == len(mesh.vertices)
    assert found.areas.sum() == pytest.approx(mesh.areas.sum(), rel=1e-6 if ending == ".stl" else 1e-12)


def test_a_mesh_file_may_be_in_millimetres(tmp_path):
    mesh = models()["cone"]
    write_mesh(TriangleMesh("cone", 1e3 * mesh.vertices, mesh.faces), tmp_path / "cone.obj")
    assert read_mesh(tmp_path / "cone.obj", 1e-3).bounds == pytest.approx(mesh.bounds)


def test_a_file_that_exists_stays(tmp_path, surface_cloud):
    path = tmp_path / "cloud.ply"
    path.write_text("mine")
    with pytest.raises(CloudFileError, match="file: expected a new file, found one that exists; choose another name"):
        write_cloud(surface_cloud("cone"), path)
    assert path.read_text() == "mine"
    write_cloud(surface_cloud("cone"), path, overwrite=True)
    assert len(read_cloud(path)) == 400


def binary_ply(order="<"):
    """Two vertices with a colour between the coordinates, and CloudCompare's name of a scalar."""
    kind = {"<": "binary_little_endian", ">": "binary_big_endian"}[order]
    head = f"ply\nformat {kind} 1.0\ncomment by hand\nelement vertex 2\nproperty float x\nproperty float y\n"
    head += "property uchar red\nproperty double z\nproperty float scalar_counts\nend_header\n"
    rows = struct.pack(f"{order}ffBdf", 1.0, 2.0, 9, 3.0, 190.0) + struct.pack(f"{order}ffBdf", 4.0, 5.0, 9, 6.0, 250.0)
    return head.encode() + rows


@pytest.mark.parametrize("order", "<>")
def test_binary_ply_of_either_byte_order(order):
    cloud = ply.read_cloud(Source("file", binary_ply(order)))
    assert cloud.points.tolist() == [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]
    assert cloud.counts.tolist() == [190.0, 250.0]


def test_binary_ply_of_triangles():
    mesh = models()["triangular_prism"]
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(mesh.vertices)}\nproperty double x\n"
    head += f"property double y\nproperty double z\nelement face {len(mesh.faces)}\nproperty list uchar int "
    faces = np.zeros(len(mesh.faces), [("n", "u1"), ("corners", "<i4", 3)])
    faces["n"], faces["corners"] = 3, mesh.faces
    data = head.encode() + b"vertex_indices\nend_header\n" + mesh.vertices.tobytes() + faces.tobytes()
    vertices, found = ply.read_mesh(Source("file", data))
    assert (vertices == mesh.vertices).all()
    assert (found == mesh.faces).all()
    assert ply.has_faces(Source("file", data))
    assert not ply.has_faces(Source("file", binary_ply()))


def test_binary_pcd():
    head = b"# .PCD v0.7\nVERSION 0.7\nFIELDS x y z label counts\nSIZE 4 4 4 2 4\nTYPE F F F U F\nCOUNT 1 1 1 1 1\n"
    head += b"WIDTH 1\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 1\nDATA binary\n"
    cloud = pcd.read(Source("file", head + struct.pack("<fffHf", 1.0, 2.0, 3.0, 7, 190.0)))
    assert cloud.points.tolist() == [[1.0, 2.0, 3.0]]
    assert cloud.counts.tolist() == [190.0]


def test_text_stl_of_a_tetrahedron():
    corners = [(0, 0, 0), (0, 1, 0), (1, 0, 0)], [(0, 0, 0), (1, 0, 0), (0, 0, 1)]
    corners += [(0, 0, 0), (0, 0, 1), (0, 1, 0)], [(1, 0, 0), (0, 1, 0), (0, 0, 1)]
    text = "solid mine\n"
    for triangle in corners:
        lines = "".join(f"   vertex {x} {y} {z}e0\n" for x, y, z in triangle)
        text += f" facet normal 0 0 0\n  outer loop\n{lines}  endloop\n endfacet\n"
    vertices, faces = stl.read(Source("file", (text + "endsolid mine\n").encode()))
    assert (len(vertices), len(faces)) == (4, 4)
    TriangleMesh("mine", vertices, faces)


def test_obj_of_quads_counted_backwards_with_textures():
    text = "mtllib other.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nf -4/1/1 -3/1 -2//1 -1\n"
    _, faces = obj.read(Source("file", text.encode()))
    assert faces.tolist() == [[0, 1, 2], [0, 2, 3]]


def test_xyz_with_commas_comments_and_more_columns():
    text = "// a heading\n# another\n\n1, 2, 3, 190, 7\n4;5;6;250;8\n"
    cloud = xyz.read(Source("file", text.encode()))
    assert cloud.points.tolist() == [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]
    assert cloud.counts.tolist() == [190.0, 250.0]


HEAD = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n"
END = "end_header\n"
FACE = HEAD + "element face {}\nproperty list {} int vertex_indices\nend_header\n1 2 3\n{}\n"
PCD = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nPOINTS {}\nDATA {}\n{}"
DAMAGED = {
    "empty": ("xyz", "", "points: expected lines of x y z, found none"),
    "two columns": ("xyz", "1 2\n", "line 1: expected x y z, and counts if known"),
    "uneven": ("xyz", "1 2 3\n1 2\n", "line 2: expected 3 numbers as in the first, found '1 2'"),
    "words": ("xyz", "1 2 three\n", "points: expected numbers, found 'three'"),
    "not a ply": ("ply", "plz\n", "header: expected ply in the first line, found 'plz'"),
    "no end": ("ply", "ply\nformat ascii 1.0\n", "header: expected lines from ply to end_header, found no end"),
    "no vertex": ("ply", "ply\nformat ascii 1.0\n" + END, "header: expected an element vertex, found none"),
    "unknown line": ("ply", "ply\nformat ascii 2.0\n", "expected a line of a PLY header, found 'format ascii 2.0'"),
    "too many": ("ply", HEAD.replace("vertex 1", "vertex 999999999") + END, "expected a line of a PLY header"),
    "short": ("ply", HEAD + END + "1 2\n", "vertex: expected 3 numbers, found 2"),
    "no z": ("ply", HEAD.replace("float z", "float w") + END + "1 2 3\n", "points: expected x, y and z, found no z"),
    "x twice": ("ply", HEAD + "property float x\n" + END + "1 2 3 4\n", "expected at most 100 properties of different"),
    "cut binary": ("ply", binary_ply()[:-1].decode("latin-1"), "vertex: expected 42 bytes, found 41"),
    "no faces": ("ply mesh", HEAD + END + "1 2 3\n", "face: expected an element of that name, found none"),
    "quads": ("ply mesh", FACE.format(1, "uchar", "4 0 0 0 0"), "face: expected triangles as a list"),
    "uneven lists": ("ply mesh", FACE.format(2, "uchar", "3 0 0 0\n2 0 0 0"), "face: expected lists of 3 numbers"),
    "long list": ("ply mesh", FACE.format(1, "int", "100000 0"), "face: expected lists of 1 to 100 numbers"),
    "half a vertex": ("ply mesh", FACE.format(1, "uchar", "3 0 0.5 0"), "face: expected whole numbers"),
    "compressed": ("pcd", PCD.format(1, "binary_compressed", ""), "DATA: expected ascii or binary, found 'binary_c"),
    "pcd too many": ("pcd", PCD.format(10**9, "binary", ""), "POINTS: expected a number of points that the file can"),
    "pcd cut": ("pcd", PCD.format(2, "binary", "x" * 23), "points: expected 24 bytes, found 23"),
    "pcd short": ("pcd", PCD.format(2, "ascii", "1 2 3\n"), "points: expected 2, as POINTS says, found 1"),
    "pcd no data": ("pcd", "FIELDS x y z\n", "header: expected lines up to DATA, found none"),
    "cut stl": ("stl", "x" * 80 + "\x02\x00\x00\x00" + "x" * 99, "file: expected 184 bytes for 2 triangles"),
    "half a triangle": ("stl", "solid\nvertex 1 2 3\nvertex 1 2 3\n", "vertex: expected three for each triangle"),
    "two numbers": ("obj", "v 1 2\n", "line 1: expected v and three numbers"),
    "names of vertices": ("obj", "v 1 2 3\nf a b c\n", "line 2: expected numbers of vertices, found 'a'"),
    "an edge": ("obj", "v 1 2 3\nf 1 1\n", "line 2: expected f and three corners or more"),
}


@pytest.mark.parametrize(("kind", "text", "line"), DAMAGED.values(), ids=DAMAGED)
def test_a_damaged_file_is_one_line(kind, text, line):
    with pytest.raises(CloudFileError) as caught:
        READERS[kind](Source("mine", text.encode("latin-1")))
    told = str(caught.value)
    assert told.startswith("mine: ")
    assert line in told
    assert "\n" not in told


def refusal(read, data: bytes) -> str:
    """What a reader says of a file; empty if it reads it. Anything but an error of ours is a failure."""
    try:
        read(Source("mine", data))
    except TaxelError as error:
        return str(error)
    return ""


@settings(max_examples=150, deadline=None, derandomize=True)
@given(st.sampled_from(sorted(READERS)), st.binary(max_size=300), st.data())
def test_bytes_of_anyone_are_read_or_refused(kind, noise, data):
    start = data.draw(st.sampled_from([b"", HEAD.encode() + b"end_header\n", binary_ply(), b"solid\n", b"ply\n"]))
    cut = data.draw(st.integers(0, len(start)))
    assert "\n" not in refusal(READERS[kind], (start[:cut] + noise) or b"x")


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.integers(0, 2000), st.integers(0, 255))
def test_a_byte_that_flipped_is_read_or_refused(at, value):
    grasps = replace(
        ContactCloud.of_points(np.arange(30.0).reshape(10, 3), np.arange(10.0), "mine"),
        grasps=("a",),
        approaches=("b",),
    )
    for write, read in ((ply.cloud_bytes, ply.read_cloud), (pcd.to_bytes, pcd.read)):
        written = bytearray(write(grasps))
        written[at % len(written)] = value
        assert "\n" not in refusal(read, bytes(written))


def test_a_file_that_is_too_large_is_not_read(tmp_path, monkeypatch):
    monkeypatch.setattr("taxel.cloud.files.source.LARGEST_FILE", 100)
    path = tmp_path / "cloud.xyz"
    path.write_text("1 2 3\n" * 100)
    with pytest.raises(CloudFileError, match="file: expected at most 100 bytes, found 600"):
        read_cloud(path)
    path.write_text("")
    with pytest.raises(CloudFileError, match="file: expected 1 to 100 bytes, found 0"):
        read_cloud(path)


def test_a_text_that_would_fill_the_memory_is_not_split(monkeypatch):
    monkeypatch.setattr("taxel.cloud.files.source.MOST_WORDS", 100)
    for kind in ("xyz", "obj", "stl"):
        assert "file: expected at most 100 words" in refusal(READERS[kind], b"solid\n" + b"1 2 3\n" * 40)
    assert "rows: expected at most 100 words" in refusal(ply.read_cloud, (HEAD + END).encode() + b"1 " * 101)


def test_a_nan_in_a_file_is_one_line(tmp_path):
    (tmp_path / "cloud.xyz").write_text("1 2 nan\n")
    with pytest.raises(CloudError, match=r"cloud.xyz: points: expected finite coordinates, found 1 with NaN"):
        read_cloud(tmp_path / "cloud.xyz")
    (tmp_path / "mesh.obj").write_text("v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    with pytest.raises(MeshError, match=r"mesh.obj: vertices: expected finite coordinates, found 1 with NaN"):
        read_mesh(tmp_path / "mesh.obj")


@pytest.mark.parametrize("name", ["cloud", "cloud.pickle", "cloud.las"])
def test_an_unknown_ending_is_one_line(tmp_path, surface_cloud, name):
    with pytest.raises(
        CloudFileError, match=r"name: expected a cloud that ends in .ply, .pcd, .xyz, .asc, .txt, found"
    ):
        read_cloud(tmp_path / name)
    with pytest.raises(CloudFileError, match="name: expected a cloud that ends in"):
        write_cloud(surface_cloud("cone"), tmp_path / name)


def test_names_of_grasps_that_lie_are_one_line():
    comments = "comment taxel.approach 0 side\ncomment taxel.grasp 0 {} a\n"
    text = HEAD.replace("element", comments + "element", 1) + "property int grasp\nend_header\n1 2 3 {}\n"
    assert ply.read_cloud(Source("mine", text.format(0, 0).encode())).grasps == ("a",)
    with pytest.raises(CloudFileError, match="comment: expected an approach that stands above"):
        ply.read_cloud(Source("mine", text.format(1, 0).encode()))
    with pytest.raises(CloudError, match="grasp: expected rows of the 1 grasps, found 5 to 5"):
        ply.read_cloud(Source("mine", text.format(0, 5).encode()))
