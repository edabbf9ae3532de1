"""Datasets of worlds that differ only in their hidden causes: they differ only in counts and lost frames."""

import re
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from taxel.blind import world_datasets
from taxel.blind.catalogue_causes import CATALOGUE_CAUSES
from taxel.blind.hidden import Cause, HiddenCauses
from taxel.blind.out_of_catalogue import OUT_OF_CATALOGUE
from taxel.blind.sampling import sample_worlds
from taxel.blind.world import CampaignSize
from taxel.blind.world_datasets import make_world

pytestmark = pytest.mark.slow

NOISE = Cause("noise", "noise white", ("noise white counts=60 board=0x53",))
GAIN = Cause("gain_mismatch", "gain idac", ("gain idac factor=1.4 board=0x53",))
SILENT = Cause("dropout", "silent from", ("silent from board=0x53 seconds=0",))
SEED = 3


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """Make the datasets of one world without a cause, with two causes on one board, and with a silent board.

    Returns the folder of each variant by the kind of its causes.
    """
    world = replace(sample_worlds(1, 0, SEED)[0], size=CampaignSize(approaches=8, sessions=1, repeats=1))
    hidden = {
        "none": (),
        "several": (NOISE, GAIN),
        "single": (SILENT,),
    }
    folders = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SOURCE_DATE_EPOCH", "0")
        settings = partial(world_datasets.SimIndentationSettings, repeats=2)
        patch.setattr(world_datasets, "SimIndentationSettings", settings)
        for name, causes in hidden.items():
            folders[name] = tmp_path_factory.mktemp("world")
            variant = replace(world, hidden=HiddenCauses(name, causes, world.hidden.nuisances), salt=name)
            make_world(variant, folders[name] / "real.h5", folders[name] / "sim.h5")
    return folders


def read_content(path: Path) -> Iterator[tuple[str, Any]]:
    """Yield name and content of everything in a file except the counts, of which only type and shape are included."""

    def read_attributes(name: str, item: Any) -> Iterator[tuple[str, Any]]:
        """Yield the attributes of a group or dataset with their types."""
        for key, value in item.attrs.items():
            kind = item.attrs.get_id(key)
            yield f"{name}@{key}", (value if isinstance(value, str) else np.asarray(value).tolist(), kind.dtype.str)

    def read_datasets(name: str, item: Any) -> Iterator[tuple[str, Any]]:
        """Yield attributes, storage and values of a dataset, or of all datasets of a group, in order of creation."""
        yield from read_attributes(name, item)
        if isinstance(item, h5py.Dataset):
            yield name, (item.shape, item.dtype.str, item.chunks, item.compression, item.compression_opts)
            if not name.endswith("raw_counts"):
                yield f"{name}=", item[()].tobytes() if item.dtype.kind != "O" else item[()].tolist()
        else:
            yield f"{name}/", list(item)  # in the order of creation
            for key in item:
                yield from read_datasets(f"{name}/{key}", item[key])

    with h5py.File(path) as file:
        yield from read_datasets("", file)


def read_counts(path: Path) -> np.ndarray:
    """Read the raw counts of all grasps of a file, u16[T, n]."""
    with h5py.File(path) as file:
        return np.concatenate([grasp["raw_counts"][()] for grasp in file["grasps"].values()])


def test_file_names_do_not_depend_on_the_causes(folders):
    assert {tuple(sorted(path.name for path in folder.iterdir())) for folder in folders.values()} == {
        ("real.h5", "sim.h5")
    }


def test_simulated_datasets_are_bit_identical(folders):
    assert len({(folder / "sim.h5").read_bytes() for folder in folders.values()}) == 1


def test_real_datasets_differ_only_in_counts(folders):
    """Compare the same world without a cause and with two causes: no other content may reveal the causes."""
    for (key, value), (other_key, other) in zip(
        read_content(folders["none"] / "real.h5"), read_content(folders["several"] / "real.h5"), strict=True
    ):
        assert key == other_key
        assert value == other, key
    assert (read_counts(folders["none"] / "real.h5") != read_counts(folders["several"] / "real.h5")).any()


def test_silent_board_changes_only_lost_frames_and_times_of_polls(folders):
    # The hub polls the other boards earlier if it does not wait for a board: a physical consequence, not a label.
    different = [
        key.rpartition("/")[2]
        for (key, value), (other_key, other) in zip(
            read_content(folders["none"] / "real.h5"), read_content(folders["single"] / "real.h5"), strict=False
        )
        if key != other_key or value != other
    ]
    assert "valid=" in different
    assert {name.rstrip("=") for name in different} <= {"valid", "timestamp", "sensor_time", "phase", "raw_counts"}


def test_no_text_of_a_file_contains_a_name_or_a_digest_of_the_causes(folders):
    sealed_words = {
        sealed_word
        for cause_type in (*CATALOGUE_CAUSES, *OUT_OF_CATALOGUE)
        for sealed_word in (cause_type.emulator_effect, cause_type.name, cause_type.emulator_effect.split()[0])
    }
    sealed_words |= {"effect", "settings", "none", "several", "single", "outside", "withheld"}
    for folder in folders.values():
        with h5py.File(folder / "real.h5") as file:
            generator = file.attrs["generator"]
        assert re.fullmatch(r"taxel [\w.+]+; emulated hand, indentation plan [0-9a-f]{12}", generator)
        texts = [str(value[0]) for key, value in read_content(folder / "real.h5") if "@" in key]
        assert not [
            sealed_word for sealed_word in sealed_words for text in texts if re.search(rf"\b{sealed_word}\b", text)
        ]


def test_file_sizes_are_equal_after_all_counts_are_set_to_zero(folders, tmp_path):
    """Counts are compressed and influence the size of a file."""
    sizes = set()
    for name in ("none", "several"):
        with h5py.File(folders[name] / "real.h5") as file, h5py.File(tmp_path / f"{name}.h5", "w") as copy:
            for key in file:
                file.copy(key, copy)
            for key, value in file.attrs.items():
                copy.attrs[key] = value
            for grasp in copy["grasps"].values():
                grasp["raw_counts"][...] = 0
        with h5py.File(tmp_path / f"{name}.h5") as copy, h5py.File(tmp_path / f"{name}_packed.h5", "w") as packed:
            for key in copy:
                copy.copy(key, packed)
        sizes.add((tmp_path / f"{name}_packed.h5").stat().st_size)
    assert len(sizes) == 1


def test_counts_of_boards_without_a_cause_are_equal(folders):
    """The causes act on board 0x53. They must not consume random numbers of the other boards."""
    with h5py.File(folders["none"] / "real.h5") as file:
        is_unaffected = np.asarray(file["taxels"]["sensor"]) != 0x53
    counts_without_cause, counts_with_causes = (
        read_counts(folders[name] / "real.h5")[:, is_unaffected] for name in ("none", "several")
    )
    assert (counts_without_cause == counts_with_causes).all()
