"""How many contact points a dataset holds for each object: Table 5.2."""

from __future__ import annotations

import os
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.grasp.timeline import Phase
from taxel.recording.grasp import Grasp
from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_format import BASELINE_FRAMES

UNUSED_NAMES = ("fingertip_middle", "fingertip_pinkie")
"""Boards whose connections failed in the thesis (5.2)."""

BACK = "back"
"""Boards on the back of the hand, which the thesis leaves out (5.2), have this in their kind."""


@dataclass(frozen=True)
class PointCount:
    """Grasps of one object, and active taxels in all of them together."""

    grasps: int
    points: int


def used_taxels(data: GraspDataset) -> NDArray[np.bool_]:
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


def contact_points(path: str | os.PathLike[str]) -> dict[str, PointCount]:
    """Active taxels over all grasps, by object; a taxel without a valid hold frame does not count.

    A grasp in which a board has a hold but no baseline is left out.
    """
    with GraspDataset(path) as data:
        used = used_taxels(data)
        grasps = dict.fromkeys(data.objects, 0)
        points = dict.fromkeys(data.objects, 0)
        for grasp in data:
            frames = baseline_frames(grasp)
            if not frames:
                continue
            active, known = grasp.active(baseline_frames=frames)
            grasps[grasp.object] += 1
            points[grasp.object] += int((active & known & used).sum())
    return {name: PointCount(grasps[name], points[name]) for name in grasps}
