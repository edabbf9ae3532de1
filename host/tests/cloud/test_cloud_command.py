"""`taxel cloud`: from a dataset to a shape, and what it refuses with one line."""

from __future__ import annotations

import csv
import json
from dataclasses import replace

import numpy as np
import pytest

from host.tests.command_line import exit_status, refusal
from taxel.cloud.files import read_cloud, write_cloud, write_mesh
from taxel.cloud.mesh import TriangleMesh
from taxel.cloud.models import models

BOARD = 30


@pytest.fixture
def run(capsys):
    """Runs `taxel cloud`: what it prints. Fails unless it succeeds."""

    def call(*arguments) -> str:
        status = exit_status("cloud", *arguments)
        told = capsys.readouterr()
        assert status == 0, told.err
        return told.out

    return call


@pytest.fixture
def refused(capsys):
    """Runs `taxel cloud`: the one line of an error."""

    def call(*arguments) -> str:
        return refusal(capsys, "cloud", *arguments)

    return call


@pytest.fixture
def on_cylinder(tmp_path, surface_cloud):
    """A cloud of 600 points of the cylinder, in a file."""
    path = tmp_path / "cylinder.ply"
    write_cloud(surface_cloud("cylinder", 600), path)
    return path


@pytest.fixture
def recorded(dataset):
    """A dataset of two approaches to the cylinder."""
    rng = np.random.default_rng(1)
    patch = [tuple((int(taxel), int(rng.integers(160, 500))) for taxel in range(2 * BOARD)) for _ in range(4)]
    approaches = ("side_1", "top", "side_1", "top")
    return dataset(*({"approach": one, "signals": signals} for one, signals in zip(approaches, patch, strict=True)))


@pytest.mark.parametrize("name", ["make", "filter", "distance", "align", "match", "sweep", "convert"])
def test_every_command_has_help_with_an_example(run, name):
    assert "Example: taxel cloud" in run(name, "--help")


def test_from_a_dataset_to_a_clean_cloud(run, recorded, tmp_path):
    raw, clean = tmp_path / "raw.ply", tmp_path / "deep" / "clean.pcd"
    told = json.loads(run("make", recorded, "--object", "cylinder", "--out", raw, "--json"))
    assert told == {"file": str(raw), "points": 4 * 2 * BOARD, "grasps": 4}
    out = run("filter", raw, "--out", clean, "--threshold", 190, "--sor-points", 6, "--sor-sigma", 2)
    cloud = read_cloud(clean)
    assert cloud.counts.min() > 190.0
    assert out == f"{clean}: {len(cloud)} points of 4 grasps\n"


def test_one_approach_fused_and_spread(run, recorded, tmp_path):
    out = tmp_path / "top.xyz"
    options = ("--approach", "top", "--fuse", "--threshold", 300, "--propagate-mm", 5.5)
    told = json.loads(run("make", recorded, "--object", "cylinder", "--out", out, *options, "--json"))
    assert told["points"] == len(read_cloud(out)) <= 2 * BOARD


def test_distances_to_shape_mesh_and_cloud(run, on_cylinder, tmp_path):
    shape = json.loads(run("distance", on_cylinder, "cylinder", "--json"))
    assert shape["points"] == 600
    assert shape["mean_m"] == pytest.approx(0.0004, rel=0.1)
    mesh = models()["cylinder"]
    write_mesh(TriangleMesh("mine", 1e3 * mesh.vertices, mesh.faces), tmp_path / "mine.stl")
    assert json.loads(run("distance", on_cylinder, tmp_path / "mine.stl", "--unit", "mm", "--json"))[
        "mean_m"
    ] == pytest.approx(shape["mean_m"], rel=1e-5)
    itself = run("distance", on_cylinder, on_cylinder)
    assert itself.endswith("600 points, mean 0.000, standard deviation 0.000, largest 0.000, RMS 0.000 mm\n")


@pytest.mark.parametrize("options", [(), ("--sampled",), ("--anywhere",)], ids=["surface", "samples", "anywhere"])
def test_aligned_clouds_come_back(run, on_cylinder, tmp_path, options):
    out = tmp_path / "aligned.ply"
    cloud = read_cloud(on_cylinder)
    moved = tmp_path / "moved.ply"
    write_cloud(replace(cloud, points=cloud.points + np.array([0.003, -0.002, 0.001])), moved)
    told = json.loads(run("align", moved, "cylinder", "--out", out, "--json", *options))
    assert told["rms_m"] < 0.0006
    assert told["converged"]
    transform = np.array(told["transform"])
    expected = read_cloud(moved).points @ transform[:3, :3].T + transform[:3, 3]
    assert read_cloud(out).points == pytest.approx(expected)
    assert (read_cloud(out).grasp == cloud.grasp).all()


def test_a_cloud_is_aligned_to_a_cloud(run, on_cylinder, tmp_path):
    write_cloud(
        replace(read_cloud(on_cylinder), points=read_cloud(on_cylinder).points + 0.0005), tmp_path / "moved.xyz"
    )
    assert "RMS 0.000 mm" in run("align", tmp_path / "moved.xyz", on_cylinder)


def test_shapes_are_told_from_files_and_meshes_of_the_user(run, on_cylinder, tmp_path):
    write_mesh(models()["cone"], tmp_path / "mine.obj")
    told = json.loads(run("match", on_cylinder, "--model", "cylinder", "--model", tmp_path / "mine.obj", "--json"))
    assert [fit["model"] for fit in told["matches"][0]["fits"]] == ["cylinder", str(tmp_path / "mine.obj")]
    assert told["matches"][0]["confidence"]["cylinder"] == 1.0
    assert "cylinder.ply" in run("match", on_cylinder)


def test_a_dataset_is_matched_whole_and_by_approach(run, recorded):
    told = json.loads(run("match", recorded, "--each-approach", "--draws", 20, "--json"))
    assert [one["approach"] for one in told["matches"]] == [None, "side_1", "top"]
    assert all(one["object"] == "cylinder" for one in told["matches"])
    assert told["told_right"]["clouds"]["total"] == 1
    assert told["told_right"]["single_approaches"]["total"] == 2
    assert "single approaches told right: " in run("match", recorded, "--each-approach", "--draws", 0)


def test_the_sweep_writes_both_tables(run, recorded, tmp_path):
    out = tmp_path / "sweep"
    told = json.loads(run("sweep", recorded, "--object", "cylinder", "--out", out, "--json"))
    assert len(told["force_filter"]) == len(list(csv.reader((out / "force_filter.csv").open()))) - 1 == 11
    assert len(told["sor"]) == len(list(csv.reader((out / "sor.csv").open()))) - 1 == 11
    assert "outlier filter" in run("sweep", recorded, "--object", "cylinder", "--out", out, "--overwrite")


def test_formats_are_converted(run, on_cylinder, tmp_path):
    run("convert", on_cylinder, tmp_path / "cloud.pcd")
    assert (read_cloud(tmp_path / "cloud.pcd").points == read_cloud(on_cylinder).points).all()
    write_mesh(models()["cone"], tmp_path / "cone.stl")
    assert "128 triangles" in run("convert", tmp_path / "cone.stl", tmp_path / "cone.ply")


def test_nothing_is_overwritten_unasked(run, refused, recorded, on_cylinder, tmp_path):
    before = on_cylinder.read_bytes()
    for arguments in (
        ("make", recorded, "--object", "cylinder", "--out", on_cylinder),
        ("filter", on_cylinder, "--out", on_cylinder, "--threshold", 190),
        ("align", on_cylinder, "cylinder", "--out", on_cylinder),
        ("convert", on_cylinder, on_cylinder),
    ):
        assert refused(*arguments).endswith("found one that exists; choose another name or --overwrite")
    assert on_cylinder.read_bytes() == before
    (tmp_path / "sor.csv").write_text("mine")
    assert "sor.csv: file: expected a new file" in refused("sweep", recorded, "--object", "cylinder", "--out", tmp_path)
    assert not (tmp_path / "force_filter.csv").exists()
    run("filter", on_cylinder, "--out", on_cylinder, "--threshold", 190, "--overwrite")


def open_mesh(tmp_path):
    mesh, path = models()["cone"], tmp_path / "open.obj"
    lines = [f"v {x} {y} {z}" for x, y, z in mesh.vertices.tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (mesh.faces[1:] + 1).tolist()]
    path.write_text("\n".join(lines))
    return path


def test_bad_input_is_one_line(refused, recorded, on_cylinder, tmp_path):
    out = tmp_path / "out.ply"
    empty, line = tmp_path / "empty.ply", tmp_path / "line.xyz"
    empty.write_text(
        "ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
    )
    line.write_text("".join(f"{0.001 * k} 0 0\n" for k in range(50)))
    make = ("make", recorded, "--out", out, "--object")
    assert "expected one of cylinder, rectangular_prism, found mug" in refused(*make, "mug")
    assert "points: expected 1 or more, found none: the cloud is empty" in refused(*make, "rectangular_prism")
    assert "--threshold: expected counts of 0 or more, found -1" in refused(*make, "cylinder", "--threshold", -1)
    assert "the cloud is empty" in refused(*make, "cylinder", "--threshold", 4000)
    assert "--propagate-mm: expected 0 to 100" in refused(*make, "cylinder", "--propagate-mm", -1)
    assert "the cloud is empty" in refused("distance", empty, "cylinder")
    assert "the cloud is empty" in refused("match", empty)
    few = ("filter", on_cylinder, "--out", out)
    assert "points: expected 700 or more, the N of the outlier filter, found 600" in refused(
        *few, "--sor-points", 700, "--sor-sigma", 1
    )
    assert "expected both or none" in refused(*few, "--sor-points", 6)
    assert "expected --threshold, or --sor-points and --sor-sigma" in refused(*few)
    assert "counts: expected a signal for each point, found 50 without" in refused(
        "filter", line, "--out", out, "--threshold", 190
    )
    assert "expected a closed surface, found 3 edges of one face only" in refused(
        "distance", on_cylinder, open_mesh(tmp_path)
    )
    assert "found 50 on one line" in refused("align", line, "cylinder")
    assert "found 50 on one line" in refused("align", on_cylinder, line)
    assert "mug: model: expected a mesh file or one of" in refused("distance", on_cylinder, "mug")
    assert "--unit: expected one of m, cm, mm, in, found 'ft'" in refused("match", on_cylinder, "--unit", "ft")
    assert "approach: expected one of side_1, top, found under" in refused(*make, "cylinder", "--approach", "under")
    assert "--draws, --seed: expected 0 or more" in refused("match", on_cylinder, "--draws", -1)
    assert str(tmp_path / "none.ply") in refused("distance", tmp_path / "none.ply", "cylinder")
    assert "none.h5" in refused("match", tmp_path / "none.h5")
    assert not out.exists()


def test_a_mesh_in_another_unit_is_one_line(refused, on_cylinder, tmp_path):
    mesh = models()["cylinder"]
    write_mesh(TriangleMesh("mine", 1e3 * mesh.vertices, mesh.faces), tmp_path / "mine.obj")
    for name in ("distance", "align"):
        told = refused(name, on_cylinder, tmp_path / "mine.obj")
        assert "expected a mesh about as large as the cloud, found 143 m across for a cloud of" in told
        assert told.endswith("give its --unit")
