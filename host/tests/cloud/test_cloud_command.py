"""The commands of `taxel cloud`, and the input that they refuse with a one-line message."""

import csv
import json
import re
from dataclasses import replace

import numpy as np
import pytest

from host.tests.command_line import run_refused_command, run_taxel
from taxel.cloud.files import read_cloud, write_cloud, write_mesh
from taxel.cloud.mesh import TriangleMesh
from taxel.cloud.models import get_builtin_models

BOARD = 30
"""Number of taxels of a board in the dataset."""


@pytest.fixture
def run(capsys):
    """Return a function that runs `taxel cloud` and returns its output; it fails the test if the command fails."""

    def call(*arguments) -> str:
        status = run_taxel("cloud", *arguments)
        output = capsys.readouterr()
        assert status == 0, output.err
        return output.out

    return call


@pytest.fixture
def refused(capsys):
    """Return a function that runs `taxel cloud`, which must fail, and returns its one-line error."""

    def call(*arguments) -> str:
        return run_refused_command(capsys, "cloud", *arguments)

    return call


@pytest.fixture
def cylinder_file(tmp_path, surface_cloud):
    """Write a cloud of 600 points of the cylinder to a PLY file; return its path."""
    path = tmp_path / "cylinder.ply"
    write_cloud(surface_cloud("cylinder", 600), path)
    return path


@pytest.fixture
def dataset_file(dataset):
    """Write a dataset of four grasps of the cylinder in two approaches, with all used taxels active; return its
    path.
    """
    rng = np.random.default_rng(1)
    signals = [tuple((int(taxel), int(rng.integers(160, 500))) for taxel in range(2 * BOARD)) for _ in range(4)]
    approaches = ("side_1", "top", "side_1", "top")
    return dataset(*({"approach": name, "signals": values} for name, values in zip(approaches, signals, strict=True)))


@pytest.mark.parametrize("name", ["make", "filter", "distance", "align", "match", "sweep", "convert"])
def test_every_command_has_help_with_an_example(run, name):
    assert "Example: taxel cloud" in run(name, "--help")


def test_cloud_is_made_from_a_dataset_and_filtered(run, dataset_file, tmp_path):
    raw, clean = tmp_path / "raw.ply", tmp_path / "deep" / "clean.pcd"
    result = json.loads(run("make", dataset_file, "--object", "cylinder", "--out", raw, "--json"))
    # In each of the 4 grasps of the file, all taxels of the two used boards are active.
    assert result == {"file": str(raw), "points": 4 * 2 * BOARD, "grasps": 4}
    out = run("filter", raw, "--out", clean, "--threshold-counts", 190, "--sor-points", 6, "--sor-sigma", 2)
    cloud = read_cloud(clean)
    assert cloud.counts.min() > 190.0
    assert out == f"{clean}: {len(cloud)} points of 4 grasps\n"


def test_fused_cloud_of_one_approach_has_at_most_one_point_for_each_taxel(run, dataset_file, tmp_path):
    out = tmp_path / "top.xyz"
    options = ("--approach", "top", "--fuse", "--threshold-counts", 300, "--propagate-mm", 5.5)
    result = json.loads(run("make", dataset_file, "--object", "cylinder", "--out", out, *options, "--json"))
    assert result["points"] == len(read_cloud(out)) <= 2 * BOARD  # two boards are used


def test_mean_distance_to_a_shape_is_that_of_the_noise(run, cylinder_file):
    result = json.loads(run("distance", cylinder_file, "cylinder", "--json"))
    assert result["points"] == 600
    assert result["mean_m"] == pytest.approx(0.0005 * np.sqrt(2.0 / np.pi), rel=0.1)  # normal noise of 0.5 mm


def test_distance_to_a_mesh_file_in_millimetres_equals_that_to_the_same_built_in_shape(run, cylinder_file, tmp_path):
    mesh = get_builtin_models()["cylinder"]
    write_mesh(TriangleMesh("cloud", 1e3 * mesh.vertices, mesh.faces), tmp_path / "model.stl")
    to_shape = json.loads(run("distance", cylinder_file, "cylinder", "--json"))
    to_file = json.loads(run("distance", cylinder_file, tmp_path / "model.stl", "--unit", "mm", "--json"))
    assert to_file["mean_m"] == pytest.approx(to_shape["mean_m"], rel=1e-5)


def test_distance_of_a_cloud_file_to_itself_is_zero(run, cylinder_file):
    out = run("distance", cylinder_file, cylinder_file)
    assert out.endswith("600 points, mean 0.000, standard deviation 0.000, largest 0.000, RMS 0.000 mm\n")


@pytest.mark.parametrize("options", [(), ("--sample-mesh",), ("--anywhere",)], ids=["surface", "samples", "anywhere"])
def test_aligned_cloud_is_the_moved_cloud_mapped_by_the_reported_transform(run, cylinder_file, tmp_path, options):
    out = tmp_path / "aligned.ply"
    cloud = read_cloud(cylinder_file)
    moved_file = tmp_path / "moved.ply"
    write_cloud(replace(cloud, points=cloud.points + np.array([0.003, -0.002, 0.001])), moved_file)
    result = json.loads(run("align", moved_file, "cylinder", "--out", out, "--json", *options))
    assert result["rms_m"] < 0.0006  # the points of the cloud have noise of 0.5 mm
    assert result["converged"]
    transform = np.array(result["transform"])
    expected = read_cloud(moved_file).points @ transform[:3, :3].T + transform[:3, 3]
    assert read_cloud(out).points == pytest.approx(expected)
    assert (read_cloud(out).grasp == cloud.grasp).all()


def test_displaced_cloud_is_aligned_to_the_original_cloud_with_an_rms_of_zero(run, cylinder_file, tmp_path):
    cloud = read_cloud(cylinder_file)
    write_cloud(replace(cloud, points=cloud.points + 0.0005), tmp_path / "moved.xyz")
    assert "RMS 0.000 mm" in run("align", tmp_path / "moved.xyz", cylinder_file)


def test_cylinder_is_matched_with_the_built_in_cylinder_rather_than_with_a_mesh_file_of_a_cone(
    run, cylinder_file, tmp_path
):
    write_mesh(get_builtin_models()["cone"], tmp_path / "model.obj")
    result = json.loads(run("match", cylinder_file, "--model", "cylinder", "--model", tmp_path / "model.obj", "--json"))
    assert [fit["model"] for fit in result["matches"][0]["fits"]] == ["cylinder", str(tmp_path / "model.obj")]
    assert result["matches"][0]["confidence"]["cylinder"] == 1.0


def test_table_of_matches_names_the_cloud_file(run, cylinder_file):
    assert "cylinder.ply" in run("match", cylinder_file)


def test_dataset_is_matched_as_a_whole_and_by_approach(run, dataset_file):
    result = json.loads(run("match", dataset_file, "--each-approach", "--resamples", 20, "--json"))
    assert [match_result["approach"] for match_result in result["matches"]] == [None, "side_1", "top"]
    assert all(match_result["object"] == "cylinder" for match_result in result["matches"])
    assert result["correct"]["clouds"]["total"] == 1
    assert result["correct"]["single_approaches"]["total"] == 2
    assert "single approaches identified: " in run("match", dataset_file, "--each-approach", "--resamples", 0)


def test_sweep_writes_eleven_rows_for_the_force_filter_and_for_the_outlier_filter_of_a_cylinder(
    run, dataset_file, tmp_path
):
    out = tmp_path / "sweep"
    result = json.loads(run("sweep", dataset_file, "--object", "cylinder", "--out", out, "--json"))
    for name in ("force_filter", "sor"):  # both tables of the thesis have 11 rows for the cylinder
        header_and_rows = list(csv.reader((out / f"{name}.csv").open()))
        assert len(result[name]) == len(header_and_rows) - 1 == 11
    assert "outlier filter" in run("sweep", dataset_file, "--object", "cylinder", "--out", out, "--overwrite")


def test_converted_cloud_has_the_same_points(run, cylinder_file, tmp_path):
    run("convert", cylinder_file, tmp_path / "cloud.pcd")
    assert (read_cloud(tmp_path / "cloud.pcd").points == read_cloud(cylinder_file).points).all()


def test_conversion_of_a_mesh_prints_its_number_of_triangles(run, tmp_path):
    mesh = get_builtin_models()["cone"]
    write_mesh(mesh, tmp_path / "cone.stl")
    assert f"{len(mesh.faces)} triangles" in run("convert", tmp_path / "cone.stl", tmp_path / "cone.ply")


def test_no_cloud_file_is_overwritten_without_the_option(refused, dataset_file, cylinder_file):
    content = cylinder_file.read_bytes()
    for arguments in (
        ("make", dataset_file, "--object", "cylinder", "--out", cylinder_file),
        ("filter", cylinder_file, "--out", cylinder_file, "--threshold-counts", 190),
        ("align", cylinder_file, "cylinder", "--out", cylinder_file),
        ("convert", cylinder_file, cylinder_file),
    ):
        assert refused(*arguments).endswith("found one that exists; choose another name or --overwrite")
    assert cylinder_file.read_bytes() == content


def test_sweep_writes_no_file_if_one_of_its_files_exists(refused, dataset_file, tmp_path):
    (tmp_path / "sor.csv").write_text("existing")
    message = refused("sweep", dataset_file, "--object", "cylinder", "--out", tmp_path)
    assert "sor.csv: file: expected a new file" in message
    assert (tmp_path / "sor.csv").read_text() == "existing"
    assert not (tmp_path / "force_filter.csv").exists()


def test_filtered_cloud_replaces_its_file_with_the_option_overwrite(run, cylinder_file):
    run("filter", cylinder_file, "--out", cylinder_file, "--threshold-counts", 190, "--overwrite")
    assert read_cloud(cylinder_file).counts.min() > 190.0


def write_open_mesh(tmp_path):
    """Write a mesh of the cone without its first face; return its path."""
    mesh, path = get_builtin_models()["cone"], tmp_path / "open.obj"
    lines = [f"v {x} {y} {z}" for x, y, z in mesh.vertices.tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (mesh.faces[1:] + 1).tolist()]
    path.write_text("\n".join(lines))
    return path


def test_invalid_input_is_refused_in_one_line_without_writing_a_file(refused, dataset_file, cylinder_file, tmp_path):
    out = tmp_path / "out.ply"
    empty, line = tmp_path / "empty.ply", tmp_path / "line.xyz"
    empty.write_text(
        "ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
    )
    line.write_text("".join(f"{0.001 * k} 0 0\n" for k in range(50)))
    make_command = ("make", dataset_file, "--out", out, "--object")
    assert "expected one of cylinder, rectangular_prism, found mug" in refused(*make_command, "mug")
    assert "points: expected 1 or more, found none: the cloud is empty" in refused(*make_command, "rectangular_prism")
    assert "the cloud is empty" in refused(*make_command, "cylinder", "--threshold-counts", 4000)
    assert "the cloud is empty" in refused("distance", empty, "cylinder")
    assert "the cloud is empty" in refused("match", empty)
    filter_command = ("filter", cylinder_file, "--out", out)
    assert "points: expected 700 or more, the N of the outlier filter, found 600" in refused(
        *filter_command, "--sor-points", 700, "--sor-sigma", 1
    )
    assert "expected both or none" in refused(*filter_command, "--sor-points", 6)
    assert "give --threshold-counts, or --sor-points and --sor-sigma" in refused(*filter_command)
    assert "counts: expected a signal for each point, found 50 without" in refused(
        "filter", line, "--out", out, "--threshold-counts", 190
    )
    assert "expected a closed surface, found 3 edges of one face only" in refused(
        "distance", cylinder_file, write_open_mesh(tmp_path)
    )
    assert "found 50 on one line" in refused("align", line, "cylinder")
    assert "found 50 on one line" in refused("align", cylinder_file, line)
    assert "mug: model: expected a mesh file or one of" in refused("distance", cylinder_file, "mug")
    assert "--unit: expected one of m, cm, mm, in, found 'ft'" in refused("match", cylinder_file, "--unit", "ft")
    assert "approach: expected one of side_1, top, found under" in refused(
        *make_command, "cylinder", "--approach", "under"
    )
    assert str(tmp_path / "none.ply") in refused("distance", tmp_path / "none.ply", "cylinder")
    assert "none.h5" in refused("match", tmp_path / "none.h5")
    assert not out.exists()


@pytest.mark.parametrize(
    ("command", "option", "value"),
    [("make", "--threshold-counts", -1), ("make", "--propagate-mm", -1), ("match", "--resamples", -1)],
)
def test_option_out_of_range_is_refused_in_one_line_that_names_it(
    capsys, dataset_file, tmp_path, command, option, value
):
    extra = ("--object", "cylinder", "--out", tmp_path / "out.ply") if command == "make" else ()
    assert run_taxel("cloud", command, dataset_file, *extra, option, value) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert option in lines[0]


def test_mesh_that_is_a_thousand_times_larger_than_the_cloud_is_refused_with_the_option_unit(
    refused, cylinder_file, tmp_path
):
    mesh = get_builtin_models()["cylinder"]
    write_mesh(TriangleMesh("cloud", 1e3 * mesh.vertices, mesh.faces), tmp_path / "model.obj")
    for name in ("distance", "align"):
        message = refused(name, cylinder_file, tmp_path / "model.obj")
        # 222 m: diagonal of the enlarged cylinder's bounding box, 40 x 40 x 215 m
        expected = r"expected a mesh of about the size of the cloud, found mesh 222 m, cloud 0\.\d+ m"
        assert re.search(expected, message)
        assert message.endswith("give the unit of the mesh with --unit")
