"""Files of clouds and meshes: round trips, valid files of other programs, malformed files.

The valid and the malformed files are in file_samples.toml.
"""

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.errors import CloudError, CloudFileError, MeshError
from taxel.cloud.files import has_triangles, obj, pcd, ply, read_cloud, read_mesh, stl, write_cloud, write_mesh, xyz
from taxel.cloud.files.source import Source
from taxel.cloud.mesh import TriangleMesh
from taxel.cloud.models import get_builtin_models
from taxel.errors import TaxelError

CLOUDS, MESHES = (".ply", ".pcd", ".xyz", ".asc"), (".ply", ".stl", ".obj")
NUMBER = st.floats(-1e6, 1e6)
POINTS = hnp.arrays(np.float64, st.tuples(st.integers(1, 20), st.just(3)), elements=NUMBER)
READERS = {
    "ply": ply.read_cloud,
    "ply mesh": ply.read_mesh,
    "pcd": pcd.read_cloud,
    "xyz": xyz.read_cloud,
    "stl": stl.read_mesh,
}
READERS["obj"] = obj.read_mesh
SAMPLES = tomllib.loads((Path(__file__).parent / "file_samples.toml").read_text(encoding="ascii"))
START_OF_PLY = b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n"
STARTS = [b"", START_OF_PLY + b"end_header\n", b"solid\n", b"ply\n"]
STARTS += [sample["content"].encode("latin-1") for sample in SAMPLES["valid"] if "binary" in sample["name"]]


def name_sample(sample):
    return f"{sample['kind']}, {sample['name']}"


@pytest.mark.parametrize("ending", CLOUDS)
@pytest.mark.parametrize("has_counts", [True, False], ids=["counts", "no counts"])
def test_points_and_counts_are_restored_from_every_format_and_grasps_from_ply_and_pcd(
    tmp_path, surface_cloud, ending, has_counts
):
    cloud = surface_cloud("cone")
    if not has_counts:
        cloud = replace(cloud, counts=np.full(len(cloud), np.nan))
    path = tmp_path / f"cloud{ending}"
    write_cloud(cloud, path)
    restored = read_cloud(path)
    assert (restored.points == cloud.points).all()
    assert np.array_equal(restored.counts, cloud.counts, equal_nan=True)
    if ending in (".ply", ".pcd"):
        assert (restored.grasp == cloud.grasp).all()
        assert (restored.taxel == cloud.taxel).all()
        assert (restored.approach == cloud.approach).all()
        assert (restored.grasps, restored.approaches) == (cloud.grasps, cloud.approaches)


def add_inactive(cloud):
    """Return the cloud with five inactive taxels in two of its grasps."""
    return replace(cloud, inactive_points=np.arange(15.0).reshape(5, 3) / 7.0, inactive_grasp=np.array([1, 1, 6, 6, 6]))


@pytest.mark.parametrize("ending", CLOUDS)
def test_inactive_taxels_are_restored_from_ply_only(tmp_path, surface_cloud, ending):
    cloud, path = add_inactive(surface_cloud("cone")), tmp_path / f"cloud{ending}"
    write_cloud(cloud, path)
    restored = read_cloud(path)
    assert len(restored) == len(cloud)
    assert len(restored.inactive_points) == (5 if ending == ".ply" else 0)
    if ending == ".ply":
        assert (restored.inactive_points == cloud.inactive_points).all()
        assert (restored.inactive_grasp == cloud.inactive_grasp).all()
        assert (restored.points == cloud.points).all()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("property int grasp\nend_header", "property int other\nend_header", "silent: expected x, y, z and grasp"),
        ("property double z\nproperty int grasp\nend", "property double w\nproperty int grasp\nend", "no z"),
        ("element silent 5", "element silent 6", "silent: expected 24 numbers, found 20; use the whole file"),
        (" 6\n", " 8\n", "grasp of inactive points: expected rows of the 8 grasps, found 1 to 8"),
        (" 6\n", " 1.5\n", "silent grasp: expected"),
        (" 6\n", " nan\n", "silent grasp: expected"),
    ],
)
def test_damaged_rows_of_inactive_taxels_are_refused_in_one_line(tmp_path, surface_cloud, old, new, message):
    """The element `silent` of a PLY file has the inactive taxels, here in five rows.

    A row has x, y, z and the index of a grasp, 6 in the last row. The cloud has 8 grasps, so the index 8 is invalid.
    """
    path = tmp_path / "cloud.ply"
    write_cloud(add_inactive(surface_cloud("cone")), path)
    assert old in path.read_text()
    path.write_text(new.join(path.read_text().rsplit(old, 1)))  # the last occurrence is in the rows of inactive taxels
    with pytest.raises(CloudError, match=message):
        read_cloud(path)


def test_inactive_taxels_are_neither_read_nor_written_without_names_of_grasps(tmp_path, surface_cloud):
    """In a PLY file, comments contain the names of the grasps, and the element `silent` has the inactive taxels."""
    path = tmp_path / "cloud.ply"
    write_cloud(add_inactive(surface_cloud("cone")), path)
    path.write_text("".join(line for line in path.read_text().splitlines(True) if not line.startswith("comment")))
    assert len(read_cloud(path).inactive_points) == 0
    unnamed = replace(
        ContactCloud.from_points(surface_cloud("cone").points),
        inactive_points=np.ones((5, 3)),
        inactive_grasp=np.zeros(5, np.int64),
    )
    assert b"silent" not in ply.encode_cloud(unnamed)


@settings(max_examples=40, deadline=None, derandomize=True)
@given(POINTS, st.sampled_from(["ply", "pcd", "xyz"]))
def test_coordinates_are_restored_exactly(points, name):
    write = {"ply": ply.encode_cloud, "pcd": pcd.encode_cloud, "xyz": xyz.encode_cloud}[name]
    assert (READERS[name](Source("file", write(ContactCloud.from_points(points)))).points == points).all()


@pytest.mark.parametrize("ending", MESHES)
@pytest.mark.parametrize("name", get_builtin_models())
def test_written_mesh_is_read_with_the_same_number_of_vertices_and_the_same_area(tmp_path, ending, name):
    mesh, path = get_builtin_models()[name], tmp_path / f"mesh{ending}"
    write_mesh(mesh, path)
    restored = read_mesh(path)
    assert len(restored.vertices) == len(mesh.vertices)
    assert restored.areas.sum() == pytest.approx(mesh.areas.sum(), rel=1e-6 if ending == ".stl" else 1e-12)


@pytest.mark.parametrize("ending", MESHES)
def test_mesh_file_is_recognised_as_a_file_with_triangles(tmp_path, ending):
    path = tmp_path / f"mesh{ending}"
    write_mesh(get_builtin_models()["cone"], path)
    assert has_triangles(path)


def test_mesh_file_in_millimetres_is_read_in_metres(tmp_path):
    mesh = get_builtin_models()["cone"]
    write_mesh(TriangleMesh("cone", 1e3 * mesh.vertices, mesh.faces), tmp_path / "cone.obj")
    assert read_mesh(tmp_path / "cone.obj", 1e-3).bounds == pytest.approx(mesh.bounds)


def test_existing_file_is_not_overwritten_without_the_option(tmp_path, surface_cloud):
    path = tmp_path / "cloud.ply"
    path.write_text("existing")
    with pytest.raises(CloudFileError, match="file: expected a new file, found one that exists; choose another name"):
        write_cloud(surface_cloud("cone"), path)
    assert path.read_text() == "existing"
    write_cloud(surface_cloud("cone"), path, overwrite=True)
    assert len(read_cloud(path)) == 400


def read_refusal(read, data: bytes) -> str:
    """Return the error message of a reader for a file, or "" if the reader accepts it.

    Exceptions other than TaxelError are not caught and fail the test.
    """
    try:
        read(Source("cloud", data))
    except TaxelError as error:
        return str(error)
    return ""


@pytest.mark.parametrize("sample", SAMPLES["valid"], ids=name_sample)
def test_valid_file_is_read_with_the_expected_content(sample):
    content = Source("cloud", sample["content"].encode("latin-1"))
    if "corners" in sample:
        vertices, faces = READERS[sample["kind"]](content)
        assert vertices[faces].tolist() == sample["corners"]
        return
    cloud = READERS[sample["kind"]](content)
    assert cloud.points.tolist() == sample["points"]
    assert cloud.counts.tolist() == sample["counts"] if "counts" in sample else np.isnan(cloud.counts).all()
    assert list(cloud.grasps) == sample.get("grasps", [""])
    assert cloud.grasp.tolist() == sample.get("grasp", [0] * len(cloud))
    assert cloud.taxel.tolist() == sample.get("taxel", [-1] * len(cloud))
    assert cloud.inactive_points.tolist() == sample.get("silent", [])


@pytest.mark.parametrize("sample", SAMPLES["malformed"], ids=name_sample)
def test_malformed_file_is_refused_in_one_line(sample):
    def read(source):
        """Read a cloud or a mesh; check the mesh."""
        contents = READERS[sample["kind"]](source)
        return TriangleMesh(source.name, *contents) if isinstance(contents, tuple) else contents

    message = read_refusal(read, sample["content"].encode("latin-1"))
    assert message.startswith("cloud: ")
    assert sample["message"] in message
    assert "\n" not in message


def test_ply_file_has_faces_only_if_it_is_a_mesh():
    contents = {sample["name"]: sample["content"].encode("latin-1") for sample in SAMPLES["valid"]}
    assert ply.has_faces(Source("cloud", contents["text mesh"]))
    assert not ply.has_faces(Source("cloud", contents["text cloud with counts, grasps and silent taxels"]))


@settings(max_examples=150, deadline=None, derandomize=True)
@given(st.sampled_from(sorted(READERS)), st.binary(max_size=300), st.data())
def test_random_bytes_are_read_or_refused_in_one_line(kind, noise, data):
    start = data.draw(st.sampled_from(STARTS))
    length = data.draw(st.integers(0, len(start)))
    assert "\n" not in read_refusal(READERS[kind], (start[:length] + noise) or b"x")


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.integers(0, 2000), st.integers(0, 255))
def test_file_with_one_changed_byte_is_read_or_refused_in_one_line(position, value):
    cloud = replace(
        ContactCloud.from_points(np.arange(30.0).reshape(10, 3), np.arange(10.0), "existing"),
        grasps=("a",),
        approaches=("b",),
    )
    for write, read in ((ply.encode_cloud, ply.read_cloud), (pcd.encode_cloud, pcd.read_cloud)):
        written = bytearray(write(cloud))
        written[position % len(written)] = value
        assert "\n" not in read_refusal(read, bytes(written))


def test_too_large_and_empty_files_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("taxel.cloud.files.source.MAX_FILE_BYTES", 100)
    path = tmp_path / "cloud.xyz"
    path.write_text("1 2 3\n" * 100)
    with pytest.raises(CloudFileError, match="file: expected at most 100 bytes, found 600"):
        read_cloud(path)
    path.write_text("")
    with pytest.raises(CloudFileError, match="file: expected 1 to 100 bytes, found 0"):
        read_cloud(path)


def test_text_with_too_many_words_is_not_split(monkeypatch):
    monkeypatch.setattr("taxel.cloud.files.source.MAX_WORDS", 100)
    for kind in ("xyz", "obj", "stl"):
        assert "file: expected at most 100 words" in read_refusal(READERS[kind], b"solid\n" + b"1 2 3\n" * 40)
    assert "rows: expected at most 100 words" in read_refusal(
        ply.read_cloud, START_OF_PLY + b"end_header\n" + b"1 " * 101
    )


def test_nan_in_a_cloud_file_and_in_a_mesh_file_is_refused_in_one_line(tmp_path):
    (tmp_path / "cloud.xyz").write_text("1 2 nan\n")
    with pytest.raises(CloudError, match=r"cloud.xyz: points: expected finite coordinates, found 1 with NaN"):
        read_cloud(tmp_path / "cloud.xyz")
    (tmp_path / "mesh.obj").write_text("v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    with pytest.raises(MeshError, match=r"mesh.obj: vertices: expected finite coordinates, found 1 with NaN"):
        read_mesh(tmp_path / "mesh.obj")


@pytest.mark.parametrize("name", ["cloud", "cloud.pickle", "cloud.las"])
def test_unknown_suffix_is_refused_for_reading_and_writing_in_one_line(tmp_path, surface_cloud, name):
    with pytest.raises(
        CloudFileError, match=r"name: expected a cloud that ends in .ply, .pcd, .xyz, .asc, .txt, found"
    ):
        read_cloud(tmp_path / name)
    with pytest.raises(CloudFileError, match="name: expected a cloud that ends in"):
        write_cloud(surface_cloud("cone"), tmp_path / name)


def test_references_to_approaches_and_grasps_without_a_name_are_refused_in_one_line():
    """The comment `taxel.grasp` has the row of a grasp, the row of its approach, and its name."""
    comments = "comment taxel.approach 0 side\ncomment taxel.grasp 0 {} a\n"
    text = (
        START_OF_PLY.decode().replace("element", comments + "element", 1) + "property int grasp\nend_header\n1 2 3 {}\n"
    )
    assert ply.read_cloud(Source("cloud", text.format(0, 0).encode())).grasps == ("a",)
    with pytest.raises(CloudFileError, match="comment: expected an approach that an earlier comment names"):
        ply.read_cloud(Source("cloud", text.format(1, 0).encode()))
    with pytest.raises(CloudError, match="grasp: expected rows of the 1 grasps, found 5 to 5"):
        ply.read_cloud(Source("cloud", text.format(0, 5).encode()))
