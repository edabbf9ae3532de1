"""Datasets of two worlds that differ only in what is hidden: nothing but counts tells them apart."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from taxel.blind import making
from taxel.blind.drawing import Shape, drawn_worlds
from taxel.blind.hidden import Cause, Hidden
from taxel.blind.kinds import INSIDE
from taxel.blind.making import make_world
from taxel.blind.strangers import OUTSIDE

NOISE = Cause("noise", "noise white", ("noise white counts=60 board=0x53",))
GAIN = Cause("gain_mismatch", "gain idac", ("gain idac factor=1.4 board=0x53",))
SILENT = Cause("dropout", "silent from", ("silent from board=0x53 seconds=0",))
SEED = 3


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Folders of the same world with nothing hidden, two effects on one board, and one that makes it silent."""
    world = replace(drawn_worlds(1, 0, SEED)[0], shape=Shape(approaches=8, sessions=1, repeats=1))
    hidden = {
        "none": (),
        "several": (NOISE, GAIN),
        "single": (SILENT,),
    }
    folders = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SOURCE_DATE_EPOCH", "0")
        patch.setattr(making, "SimIndentationSettings", partial(making.SimIndentationSettings, repeats=2))
        for name, causes in hidden.items():
            folders[name] = tmp_path_factory.mktemp("world")
            own = replace(world, hidden=Hidden(name, causes, world.hidden.nuisances), salt=name)
            make_world(own, folders[name] / "real.h5", folders[name] / "sim.h5")
    return folders


def content(path: Path) -> Iterator[tuple[str, Any]]:
    """Everything that a file holds but counts, and their type and shape."""

    def attributes(name: str, item: Any) -> Iterator[tuple[str, Any]]:
        for key, value in item.attrs.items():
            kind = item.attrs.get_id(key)
            yield f"{name}@{key}", (value if isinstance(value, str) else np.asarray(value).tolist(), kind.dtype.str)

    def datasets(name: str, item: Any) -> Iterator[tuple[str, Any]]:
        yield from attributes(name, item)
        if isinstance(item, h5py.Dataset):
            yield name, (item.shape, item.dtype.str, item.chunks, item.compression, item.compression_opts)
            if not name.endswith("raw_counts"):
                yield f"{name}=", item[()].tobytes() if item.dtype.kind != "O" else item[()].tolist()
        else:
            yield f"{name}/", list(item)  # in the order in which they were made
            for key in item:
                yield from datasets(f"{name}/{key}", item[key])

    with h5py.File(path) as file:
        yield from datasets("", file)


def counts(path: Path) -> np.ndarray:
    with h5py.File(path) as file:
        return np.concatenate([grasp["raw_counts"][()] for grasp in file["grasps"].values()])


def test_file_names_are_the_same(made):
    assert {tuple(sorted(path.name for path in folder.iterdir())) for folder in made.values()} == {
        ("real.h5", "sim.h5")
    }


def test_the_simulators_file_is_the_same_to_the_last_bit(made):
    assert len({(folder / "sim.h5").read_bytes() for folder in made.values()}) == 1


def test_names_types_lengths_values_and_times_are_the_same_and_only_counts_differ(made):
    for (key, value), (other_key, other) in zip(
        content(made["none"] / "real.h5"), content(made["several"] / "real.h5"), strict=True
    ):
        assert key == other_key
        assert value == other, key
    assert (counts(made["none"] / "real.h5") != counts(made["several"] / "real.h5")).any()


def test_of_a_board_that_is_silent_only_lost_frames_and_times_of_polls_tell_besides(made):
    # A hub that waits for no board polls the others earlier: that is physics and no label.
    told = [
        key.rpartition("/")[2]
        for (key, value), (other_key, other) in zip(
            content(made["none"] / "real.h5"), content(made["single"] / "real.h5"), strict=False
        )
        if key != other_key or value != other
    ]
    assert "valid=" in told
    assert {name.rstrip("=") for name in told} <= {"valid", "timestamp", "sensor_time", "phase", "raw_counts"}


def test_no_text_of_a_file_names_or_digests_what_is_hidden(made):
    words = {word for form in (*INSIDE, *OUTSIDE) for word in (form.form, form.name, form.form.split()[0])}
    words |= {"effect", "settings", "none", "several", "single", "outside", "withheld"}
    for folder in made.values():
        with h5py.File(folder / "real.h5") as file:
            generator = file.attrs["generator"]
        assert re.fullmatch(r"taxel [\w.+]+; emulated hand, press plan [0-9a-f]{12}", generator)
        texts = [str(value[0]) for key, value in content(folder / "real.h5") if "@" in key]
        assert not [word for word in words for text in texts if re.search(rf"\b{word}\b", text)]


def test_without_counts_even_the_sizes_are_the_same(made, tmp_path):
    """Counts are compressed, so a file's size is theirs; with the same counts in it, so is every byte's place."""
    sizes = set()
    for name in ("none", "several"):
        with h5py.File(made[name] / "real.h5") as file, h5py.File(tmp_path / f"{name}.h5", "w") as copy:
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


def test_noise_of_the_ideal_parts_is_the_same_stream_whatever_is_hidden(made):
    """Boards without a cause have the same counts: what is hidden elsewhere draws nothing from their streams."""
    with h5py.File(made["none"] / "real.h5") as file:
        others = np.asarray(file["taxels"]["sensor"]) != 0x53
    first, second = (counts(made[name] / "real.h5")[:, others] for name in ("none", "several"))
    assert (first == second).all()
