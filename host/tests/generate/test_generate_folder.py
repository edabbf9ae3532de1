"""A generated folder: its content, and equal bytes after interruptions and with several workers."""

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
from taxel.gap.data.pair import read_pair
from taxel.generate.errors import FolderError
from taxel.generate.grasping import ShardGenerator
from taxel.generate.holds import read_generated_holds
from taxel.generate.ranges import fixed
from taxel.generate.recipe import Recipe
from taxel.generate.run import generate
from taxel.generate.shard import generate_shard, read_table
from taxel.generate.solids import ObjectKind
from taxel.generate.workers import Processes
from taxel.hand import load_hand
from taxel.recording.grasp_dataset import GraspDataset

TIMEOUT_S = 120.0


class NoWorkers:
    """Workers that must not be used."""

    def generate_shards(self, recipe, shards):
        pytest.fail(f"unexpected request for shards {list(shards)}")
        yield


class InterruptedWorkers:
    """Workers that are interrupted after some shards."""

    def __init__(self, shards: int) -> None:
        """Create the workers. shards: number of shards before the interruption."""
        self._shards = shards

    def generate_shards(self, recipe, shards):
        """Yield some shards, then raise KeyboardInterrupt."""
        for shard in list(shards)[: self._shards]:
            yield shard, generate_shard(recipe, shard)
        raise KeyboardInterrupt


def test_shards_are_valid_grasp_datasets_with_contacts_and_consecutive_ids(generated):
    ids = []
    for number, name in enumerate(("shard-00000.h5", "shard-00001.h5")):
        with GraspDataset(generated.folder / name, baseline_frames=10) as data:
            data.check()
            assert (data.source, data.hand) == ("sim", "original")
            assert {grasp.session for grasp in data} == {number}
            assert all(grasp.active_taxels(baseline_frames=10)[0].sum() > 5 for grasp in data)
            ids += data.ids
    assert ids == [f"g{number:09d}" for number in range(3)]


def test_index_lists_shards_grasps_labels_parameters_checksums_recipe_and_versions(generated):
    index = json.loads((generated.folder / "index.json").read_text())
    assert index["recipe"] == json.loads(json.dumps(generated.recipe.to_json()))
    assert index["recipe_sha256"] == generated.recipe.digest
    assert {"taxel", "mujoco", "numpy", "hdf5"} <= set(index["versions"])
    assert [shard["grasps"] for shard in index["shards"]] == [2, 1]
    assert sum(index["labels"].values()) == 3
    for entry in (*index["shards"], index["table"]):
        content = (generated.folder / entry["file"]).read_bytes()
        assert (entry["bytes"], entry["sha256"]) == (len(content), hashlib.sha256(content).hexdigest())
    with (generated.folder / "grasps.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0]) == index["table"]["columns"]
    for row in rows:
        with GraspDataset(generated.folder / row["shard"]) as data:
            grasp = data[row["id"]]
            expected = (row["object"], row["approach"], int(row["grasp"]))
            assert (grasp.object, grasp.approach, grasp.iteration) == expected
            assert row["object"].startswith(row["label"])
            extents = np.ptp(data.objects[grasp.object].vertices, axis=0)
        if row["label"] == "rectangular_prism":
            assert 1e3 * extents == pytest.approx([float(row[f"{side}_mm"]) for side in ("width", "depth", "height")])


def test_grasp_generated_alone_equals_the_grasp_in_its_shard(generated):
    single = ShardGenerator(generated.recipe, 0, Setup(load_hand("original"))).generate(1)
    with GraspDataset(generated.folder / "shard-00000.h5") as data:
        grasp = data["g000000001"]
        assert np.array_equal(grasp.raw_counts, single.record.raw_counts)
        assert np.array_equal(grasp.contact_force, single.record.contact_force)
    table = read_table(generated.folder / "shard-00000.h5")
    assert dict(zip(table.names, table.values[1], strict=True))["force_n"] == single.values["force_n"]


def test_continued_run_gives_the_same_bytes_as_an_uninterrupted_one(generated, read_files, tmp_path):
    out = tmp_path / "interrupted"
    with pytest.raises(KeyboardInterrupt):
        generate(generated.recipe, out, InterruptedWorkers(1))
    assert sorted(read_files(out)) == ["recipe.json", "shard-00000.h5"]
    (out / ".shard-00001.h5.4711.part").write_bytes(b"incomplete")
    assert generate(generated.recipe, out, Processes(1)).generated_grasps == 1
    assert read_files(out) == read_files(generated.folder)


def test_killed_run_of_two_processes_continues_to_the_same_bytes(generated, read_files, tmp_path):
    out = tmp_path / "killed"
    recipe = generated.recipe
    options = [
        "--grasps",
        recipe.grasps,
        "--seed",
        recipe.seed,
        "--grasps-per-shard",
        recipe.grasps_per_shard,
        "--jobs",
        2,
        "--out",
        out,
    ]
    program = [sys.executable, "-c", "from taxel.cli.main import main; main()", "generate", *map(str, options)]
    run = subprocess.Popen(program, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
    deadline = time.monotonic() + TIMEOUT_S
    while run.poll() is None and not list(out.glob("shard-*.h5")) and time.monotonic() < deadline:
        time.sleep(0.01)
    run.send_signal(signal.SIGKILL)
    run.wait()
    assert list(out.glob("shard-*.h5"))
    generate(recipe, out, Processes(1))
    assert read_files(out) == read_files(generated.folder)


def test_complete_folder_is_not_changed(generated, read_files):
    before = read_files(generated.folder)
    assert generate(generated.recipe, generated.folder, NoWorkers()).generated_grasps == 0
    assert read_files(generated.folder) == before


def test_folder_of_another_recipe_is_refused_with_a_one_line_message(generated):
    changes = {"recipe.seed": {"seed": 4}, "recipe.grasps": {"grasps": 7}}
    for field, change in changes.items():
        other = replace(generated.recipe, **change)
        with pytest.raises(FolderError) as caught:
            generate(other, generated.folder, NoWorkers())
        line = str(caught.value)
        assert line.startswith(f"{generated.folder / 'recipe.json'}: {field}: expected ")
        assert line.count("\n") == 0


def test_folder_with_other_files_is_refused(generated, tmp_path):
    (tmp_path / "thesis.txt").write_text("kept")  # a file of the user
    with pytest.raises(FolderError, match=r"expected an empty folder, .* found one with 'thesis.txt'"):
        generate(generated.recipe, tmp_path, NoWorkers())
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.txt"]


def test_other_file_with_the_name_of_a_shard_is_refused(generated, tmp_path):
    out = tmp_path / "out"
    with pytest.raises(KeyboardInterrupt):
        generate(generated.recipe, out, InterruptedWorkers(0))
    (out / "shard-00001.h5").write_bytes(b"no shard")
    with pytest.raises(FolderError, match=r"shard-00001.h5: /: expected a shard of this recipe"):
        generate(generated.recipe, out, NoWorkers())


def test_pictures_of_a_shard_can_be_drawn(generated, tmp_path):
    shard = generated.folder / "shard-00001.h5"
    save_clouds([shard], tmp_path / "clouds.png")
    save_grasp([shard], tmp_path / "grasp.png", ["g000000002"])
    assert (tmp_path / "clouds.png").stat().st_size > 1000


def test_objects_of_fixed_size_keep_their_name_so_the_shard_can_be_paired_with_a_recording(tmp_path):
    kind = ObjectKind("cylinder", "cylinder", {"radius_mm": fixed(21.0), "height_mm": fixed(130.0)}, 1.0, "thesis")
    path = tmp_path / "shard.h5"
    path.write_bytes(generate_shard(Recipe(grasps=2, grasps_per_shard=2, objects=(kind,)), 0))
    pair = read_pair(path, path)
    assert {item for item, _ in pair.conditions} == {"cylinder"}


def test_mean_hold_signals_and_labels_of_all_grasps_are_read(generated):
    holds = read_generated_holds(generated.folder)
    assert holds.signal_counts.shape == (3, 1037)
    assert set(holds.label.tolist()) <= {"cylinder", "rectangular_prism", "triangular_prism"}
    assert (holds.signal_counts.max(axis=1) > 300).all()


def test_reading_a_folder_without_an_index_is_refused(generated):
    with pytest.raises(FolderError, match="the index of a generated folder"):
        read_generated_holds(generated.folder.parent)
