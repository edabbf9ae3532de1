"""A simulated dataset with exchanged conditions: the wrong simulation for every indentation."""

import shutil
from pathlib import Path

import numpy as np

from taxel.recording.hdf5_output import change_hdf5


def write_shuffled_copy(sim: Path, out: Path, seed: int) -> None:
    """Write a copy of a simulated dataset in which the conditions (object, approach) are exchanged cyclically.

    Every condition gets the simulation of another condition. The copy is a control: the diagnosis is expected to report
    an unknown cause or no gap. sim: dataset to copy, with at least two conditions; a single condition would keep its
    own simulation. out: file to write. seed: of the random order.
    """
    shutil.copyfile(sim, out)
    rng = np.random.default_rng(seed)
    with change_hdf5(out) as file:
        grasps = [group for _, group in file["grasps"].items()]
        conditions = sorted({(str(group.attrs["object"]), str(group.attrs["approach"])) for group in grasps})
        order = rng.permutation(len(conditions))
        replacement = {conditions[order[index]]: conditions[order[index - 1]] for index in range(len(conditions))}
        for group in grasps:
            item, approach = replacement[(str(group.attrs["object"]), str(group.attrs["approach"]))]
            group.attrs["object"], group.attrs["approach"] = item, approach
