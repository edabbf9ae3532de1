"""A simulator's dataset whose approaches have lost their names: the wrong simulation for every press."""

from __future__ import annotations

import shutil
from pathlib import Path

import h5py
import numpy as np


def shuffled_copy(sim: Path, out: Path, seed: int) -> None:
    """Write `sim` with its (object, approach) cells exchanged among each other, none left in its place."""
    shutil.copyfile(sim, out)
    rng = np.random.default_rng(seed)
    with h5py.File(out, "r+") as file:
        grasps = [group for _, group in file["grasps"].items()]
        cells = sorted({(str(group.attrs["object"]), str(group.attrs["approach"])) for group in grasps})
        order = rng.permutation(len(cells))
        other = {cells[order[place]]: cells[order[place - 1]] for place in range(len(cells))}
        for group in grasps:
            item, approach = other[(str(group.attrs["object"]), str(group.attrs["approach"]))]
            group.attrs["object"], group.attrs["approach"] = item, approach
