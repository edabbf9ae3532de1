"""What of a grasp counts as a contact point in the thesis (5.2, Table 5.2): which taxels, against which baseline."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from taxel.hand.transforms import inverse
from taxel.recording.grasp import Grasp
from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_format import BASELINE_FRAMES, Phase

UNUSED_NAMES = ("fingertip_middle", "fingertip_pinkie")
"""Boards whose connections failed in the thesis (5.2)."""

BACK = "back"
"""Boards on the back of the hand, which the thesis leaves out (5.2), have this in their kind."""


def used_taxels(data: GraspDataset) -> npt.NDArray[np.bool_]:
    """Taxels that the thesis's experiments used, bool[n]."""
    used = [
        BACK not in kind and name not in UNUSED_NAMES
        for name, kind in zip(data.sensors.name, data.sensors.kind, strict=True)
    ]
    return np.asarray(np.array(used)[data.sensors.index_of(data.taxels)])


def baseline_frames(grasp: Grasp) -> int:
    """How many frames a grasp's baseline can be the mean of: the usual number, or what its shortest board has."""
    held = (grasp.valid & (grasp.phase == Phase.HOLD)[:, None]).any(axis=0)
    still = (grasp.valid & (grasp.phase == Phase.BASELINE)[:, None]).sum(axis=0)
    return int(min([BASELINE_FRAMES, *still[held].tolist()]))


def taxel_points(data: GraspDataset, grasp: Grasp) -> npt.NDArray[np.float64]:
    """Taxel centres of a grasp in the nominal object's frame, metres, f64[n, 3]."""
    table = data.taxels
    brackets = (inverse(grasp.object_pose) @ grasp.sensor_pose)[data.sensors.index_of(table)]
    return np.asarray(np.einsum("nij,nj->ni", brackets[:, :3, :3], table.position) + brackets[:, :3, 3])
