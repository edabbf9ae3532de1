"""How many contact points a dataset holds for each object: Table 5.2."""

from __future__ import annotations

import os
from dataclasses import dataclass

from taxel.cloud.contacts import BACK as BACK
from taxel.cloud.contacts import baseline_frames
from taxel.cloud.contacts import used_taxels as used_taxels
from taxel.recording.grasp_dataset import GraspDataset


@dataclass(frozen=True)
class PointCount:
    """Grasps of one object, and active taxels in all of them together."""

    grasps: int
    points: int


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
