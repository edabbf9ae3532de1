"""A generated folder: what stands in it, and that it is the same to the byte however it was made."""

from __future__ import annotations

import csv
import hashlib
import json
import signal
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import pytest

from taxel.campaign.pictures import save_clouds, save_grasp
from taxel.campaign.setup import Setup
from taxel.gap.pair import read_pair
from taxel.generate.errors import FolderError
from taxel.generate.grasping import ShardMaker
from taxel.generate.ranges import fixed
from taxel.generate.reading import generated_holds
from taxel.generate.recipe import Recipe
from taxel.generate.run import generate
from taxel.generate.shard import make_shard, read_table
from taxel.generate.solids import ObjectKind
from taxel.generate.workers import Processes
from taxel.recording.grasp_dataset import GraspDataset

PATIENCE_S = 120.0


class Nobody:
    """Workers that must not be asked."""

    def made(self, recipe, shards):
        pytest.fail(f"asked for shards {list(shards)}")
        yield


class CutAfter:
    """Workers that end in the middle, as a program that is interrupted."""

    def __init__(self, shards: int) -> None:
        self._shards = shards

    def made(self, recipe, shards):
        for shard in list(shards)[: self._shards]:
            yield shard, make_shard(recipe, shard)
        raise KeyboardInterrupt


def test_shards_are_grasp_datasets_that_the_reader_takes(whole):
    ids = []
    for number, name in enumerate(("shard-00000.h5", "shard-00001.h5", "shard-00002.h5")):
        with GraspDataset(whole.folder / name, baseline_frames=10) as data:
            data.check()
            assert (data.source, data.hand) == ("sim", "allegro")
            assert {grasp.session for grasp in data} == {number}
            assert all(grasp.active_taxels(baseline_frames=10)[0].sum() > 5 for grasp in data)
            ids += data.ids
    assert ids == [f"g{number:09d}" for number in range(5)]


def test_the_index_lists_shards_grasps_labels_parameters_checksums_recipe_and_versions(whole):
    index = json.loads((whole.folder / "index.json").read_text())
    assert index["recipe"] == json.loads(json.dumps(whole.recipe.to_json()))
    assert index["recipe_sha256"] == whole.recipe.digest
    assert {"taxel", "mujoco", "numpy", "hdf5"} <= set(index["versions"])
    assert [shard["grasps"] for shard in index["shards"]] == [2, 2, 1]
    assert sum(index["labels"].values()) == 5
    for entry in (*index["shards"], index["table"]):
        content = (whole.folder / entry["file"]).read_bytes()
        assert (entry["bytes"], entry["sha256"]) == (len(content), hashlib.sha256(content).hexdigest())
    with (whole.folder / "grasps.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == index["table"]["columns"]
    for row in rows:
        with GraspDataset(whole.folder / row["shard"]) as data:
            grasp = data[row["id"]]
            told = (row["object"], row["approach"], int(row["grasp"]))
            assert (grasp.object, grasp.approach, grasp.iteration) == told
            assert row["object"].startswith(row["label"])
            spread = np.ptp(data.objects[grasp.object].vertices, axis=0)
        if row["label"] == "rectangular_prism":
            assert 1e3 * spread == pytest.approx([float(row[f"{side}_mm"]) for side in ("width", "depth", "height")])


def test_a_grasp_can_be_made_alone(whole):
    alone = ShardMaker(whole.recipe, 1, Setup()).make(3)
    with GraspDataset(whole.folder / "shard-00001.h5") as data:
        grasp = data["g000000003"]
        assert np.array_equal(grasp.raw_counts, alone.record.raw_counts)
        assert np.array_equal(grasp.contact_force, alone.record.contact_force)
    table = read_table(whole.folder / "shard-00001.h5")
    assert dict(zip(table.names, table.values[1], strict=True))["force_n"] == alone.values["force_n"]


def test_a_cut_run_goes_on_and_the_bytes_are_those_of_an_uncut_one(whole, files_of, tmp_path):
    out = tmp_path / "cut"
    with pytest.raises(KeyboardInterrupt):
        generate(whole.recipe, out, CutAfter(1))
    assert sorted(files_of(out)) == ["recipe.json", "shard-00000.h5"]
    (out / ".shard-00001.h5.4711.part").write_bytes(b"half")
    assert generate(whole.recipe, out, Processes(1)).made == 3
    assert files_of(out) == files_of(whole.folder)


def test_a_killed_run_of_two_processes_goes_on_to_the_same_bytes(whole, files_of, tmp_path):
    out = tmp_path / "killed"
    recipe = whole.recipe
    options = [
        "--grasps",
        recipe.grasps,
        "--seed",
        recipe.seed,
        "--grasps-per-shard",
        recipe.shard,
        "--jobs",
        2,
        "--out",
        out,
    ]
    program = [sys.executable, "-c", "from taxel.cli.main import main; main()", "generate", *map(str, options)]
    run = subprocess.Popen(program, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
    end = time.monotonic() + PATIENCE_S
    while run.poll() is None and not list(out.glob("shard-*.h5")) and time.monotonic() < end:
        time.sleep(0.01)
    run.send_signal(signal.SIGKILL)
    run.wait()
    assert list(out.glob("shard-*.h5"))
    generate(recipe, out, Processes(1))
    assert files_of(out) == files_of(whole.folder)


def test_a_whole_folder_is_left_as_it_is(whole, files_of):
    before = files_of(whole.folder)
    assert generate(whole.recipe, whole.folder, Nobody()).made == 0
    assert files_of(whole.folder) == before


def test_a_folder_of_another_recipe_is_refused_with_one_line(whole):
    changes = {"recipe.seed": {"seed": 4}, "recipe.grasps": {"grasps": 7}}
    for field, change in changes.items():
        other = replace(whole.recipe, **change)
        with pytest.raises(FolderError) as refused:
            generate(other, whole.folder, Nobody())
        line = str(refused.value)
        assert line.startswith(f"{whole.folder / 'recipe.json'}: {field}: expected ")
        assert line.count("\n") == 0


def test_a_folder_of_something_else_is_refused(whole, tmp_path):
    (tmp_path / "thesis.txt").write_text("kept")
    with pytest.raises(FolderError, match=r"expected an empty folder, .* found one with 'thesis.txt'"):
        generate(whole.recipe, tmp_path, Nobody())
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.txt"]


def test_a_file_in_a_shards_place_is_refused(whole, tmp_path):
    out = tmp_path / "out"
    with pytest.raises(KeyboardInterrupt):
        generate(whole.recipe, out, CutAfter(0))
    (out / "shard-00001.h5").write_bytes(b"no shard")
    with pytest.raises(FolderError, match=r"shard-00001.h5: /: expected a shard of this recipe"):
        generate(whole.recipe, out, Nobody())


def test_pictures_can_be_drawn_of_a_shard(whole, tmp_path):
    shard = whole.folder / "shard-00002.h5"
    save_clouds([shard], tmp_path / "clouds.png")
    save_grasp([shard], tmp_path / "grasp.png", "g000000004")
    assert (tmp_path / "clouds.png").stat().st_size > 1000


def test_objects_of_one_size_keep_their_name_and_can_be_compared_with_a_recording(tmp_path):
    kind = ObjectKind("cylinder", "cylinder", {"radius_mm": fixed(21.0), "height_mm": fixed(130.0)}, 1.0, "thesis")
    path = tmp_path / "shard.h5"
    path.write_bytes(make_shard(Recipe(grasps=2, shard=2, objects=(kind,)), 0))
    pair = read_pair(path, path)
    assert {item for item, _ in pair.cells} == {"cylinder"}
    assert pair.sim.force is not None


def test_a_learner_reads_holds_and_labels(whole):
    holds = generated_holds(whole.folder)
    assert holds.signal_counts.shape == (5, 1073)
    assert set(holds.label.tolist()) <= {"cylinder", "rectangular_prism", "triangular_prism"}
    assert (holds.signal_counts.max(axis=1) > 300).all()
    with pytest.raises(FolderError, match="the index of a generated folder"):
        generated_holds(whole.folder.parent)
