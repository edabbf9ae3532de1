"""Taxels, baseline and positions that define a contact point in the thesis (section 5.2, Table 5.2)."""

import numpy as np
import numpy.typing as npt

from taxel.hand.transforms import inverse
from taxel.recording.grasp import Grasp
from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_format import BASELINE_FRAMES, Phase

UNUSED_BOARDS = ("fingertip_middle", "fingertip_pinkie")
"""Names of the boards whose connections failed in the thesis (5.2)."""

BACK_KIND = "back"
"""Part of the kind of every board on the back of the hand; the thesis does not use these boards (5.2)."""


def select_used_taxels(data: GraspDataset) -> npt.NDArray[np.bool_]:
    """Select the taxels that the experiments of the thesis used, bool[n].

    The boards of `UNUSED_BOARDS` and the boards on the back of the hand are left out.
    """
    is_board_used = [
        BACK_KIND not in kind and name not in UNUSED_BOARDS
        for name, kind in zip(data.sensors.name, data.sensors.kind, strict=True)
    ]
    return np.asarray(np.array(is_board_used)[data.sensors.index_of(data.taxels)])


def count_baseline_frames(grasp: Grasp) -> int:
    """Return how many valid baseline frames can be averaged for every board of a grasp: BASELINE_FRAMES at most.

    Boards without a valid frame in the hold phase are not considered. The result is 0 if a board has no baseline frame.
    """
    has_hold = (grasp.valid & (grasp.phase == Phase.HOLD)[:, None]).any(axis=0)
    valid_frames = (grasp.valid & (grasp.phase == Phase.BASELINE)[:, None]).sum(axis=0)
    return int(min([BASELINE_FRAMES, *valid_frames[has_hold].tolist()]))


def locate_taxels(data: GraspDataset, grasp: Grasp) -> npt.NDArray[np.float64]:
    """Compute the taxel centres during a grasp in the nominal frame of the object, metres, f64[n, 3].

    If the dataset contains the poses of the sensors in every frame, as converted live recordings do, the centres are
    the means over the frames of the hold phase, to which the mean signals belong.
    """
    table = data.taxels
    is_hold = grasp.phase == Phase.HOLD
    poses = grasp.sensor_pose
    if grasp.sensor_pose_t is not None and is_hold.any():
        poses = grasp.sensor_pose_t[is_hold].mean(axis=0)  # a centre is linear in the pose matrix
    brackets = (inverse(grasp.object_pose) @ poses)[data.sensors.index_of(table)]
    return np.asarray(np.einsum("nij,nj->ni", brackets[:, :3, :3], table.position) + brackets[:, :3, 3])
