"""Hold signals and labels of a generated folder, shard after shard, for a machine-learning program."""

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
from taxel.input_files import parse_json, read_regular_file
from taxel.input_files.json_text import JSON_BYTES_MAX
from taxel.recording.grasp import Grasp
from taxel.recording.grasp_dataset import GraspDataset
from taxel.types import FloatArray


@dataclass(frozen=True, eq=False)
class Holds:
    """Signals of n taxels in the hold phase of g grasps.

    signal_counts: f64[g, n], mean over the hold, 0 for a taxel without a valid hold frame. label: str[g], kind of
    object for generated grasps, name of the object for other datasets.
    """

    signal_counts: FloatArray
    label: NDArray[np.str_]


def list_shards(folder: Path) -> list[Path]:
    """List the shard files of a complete folder of generated grasps, in order.

    Raises FolderError for a folder without an index, which is written last.
    """
    path = folder / INDEX
    try:
        index = parse_json(read_regular_file(path, JSON_BYTES_MAX))
        if index["format"] != FORMAT:
            raise ValueError(index["format"])
        names = [str(shard["file"]) for shard in index["shards"]]
        if not all(name == Path(name).name for name in names):
            raise ValueError("a shard in another folder")
        return [folder / name for name in names]
    except (OSError, ValueError, KeyError, TypeError):
        remedy = "run taxel generate again until it is complete"
        raise FolderError(format_path(path), "/", "the index of a generated folder", "none", remedy) from None


def read_generated_grasps(folder: Path) -> Iterator[tuple[Grasp, str]]:
    """Yield every grasp of a folder of generated grasps with its label, the kind of object.

    A grasp is readable only until the next one is requested. Raises FolderError for an incomplete folder.
    """
    for path in list_shards(folder):
        labels = read_table(path).label
        with GraspDataset(path) as data:
            yield from zip(data, labels, strict=True)


def read_generated_holds(folder: Path) -> Holds:
    """Read the mean hold signals of all grasps of a generated folder, with the labels (kinds of objects)."""
    return _collect_holds(read_generated_grasps(folder))


def read_dataset_holds(path: Path) -> Holds:
    """Read the mean hold signals of any grasp dataset; the labels are the names of the objects."""
    with GraspDataset(path) as data:
        return _collect_holds((grasp, grasp.object) for grasp in data)


def _collect_holds(grasps: Iterator[tuple[Grasp, str]]) -> Holds:
    """Compute the mean signal of each taxel in the hold phase of grasps, with the labels of the grasps.

    A taxel of a board without a valid hold frame has the signal 0.
    """
    signals, labels = [], []
    for grasp, label in grasps:
        signals.append(np.nan_to_num(grasp.mean_hold_signal(max(count_baseline_frames(grasp), 1))))
        labels.append(label)
    return Holds(np.array(signals), np.array(labels))
