"""What a learner reads of a generated folder: hold signals and labels, shard after shard."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.cloud.contacts import count_baseline_frames
from taxel.generate.errors import FolderError
from taxel.generate.folder import FORMAT
from taxel.generate.index import INDEX
from taxel.generate.shard import read_table
from taxel.hand.errors import format_path
from taxel.recording.grasp import Grasp
from taxel.recording.grasp_dataset import GraspDataset


@dataclass(frozen=True, eq=False)
class Holds:
    """What g grasps felt while they held. signal_counts: f64[g, n], baseline minus raw count, mean over hold; 0
    where no frame of hold arrived. label: str[g], the kind of object.
    """

    signal_counts: NDArray[np.float64]
    label: NDArray[np.str_]


def shards_of(folder: Path) -> list[Path]:
    """The shards of a whole folder, in order. Raises FolderError for one without an index."""
    path = folder / INDEX
    try:
        index = json.loads(path.read_bytes())
        if index["format"] != FORMAT:
            raise ValueError(index["format"])
        return [folder / shard["file"] for shard in index["shards"]]
    except (OSError, ValueError, KeyError, TypeError):
        remedy = "run taxel generate again, until it has made all"
        raise FolderError(format_path(path), "/", "the index of a generated folder", "none", remedy) from None


def generated_grasps(folder: Path) -> Iterator[tuple[Grasp, str]]:
    """Every grasp of a folder with its label; each is readable until the next is asked for."""
    for path in shards_of(folder):
        labels = read_table(path).label
        with GraspDataset(path) as data:
            yield from zip(data, labels, strict=True)


def generated_holds(folder: Path) -> Holds:
    """Hold signals and labels of a generated folder."""
    return _holds(generated_grasps(folder))


def dataset_holds(path: Path) -> Holds:
    """The same of any grasp dataset, such as one of the emulated hand: its objects' names are the labels."""
    with GraspDataset(path) as data:
        return _holds((grasp, grasp.object) for grasp in data)


def _holds(grasps: Iterator[tuple[Grasp, str]]) -> Holds:
    found = [
        (np.nan_to_num(grasp.mean_hold_signal(max(count_baseline_frames(grasp), 1))), label) for grasp, label in grasps
    ]
    return Holds(np.array([signal for signal, _ in found]), np.array([label for _, label in found]))
