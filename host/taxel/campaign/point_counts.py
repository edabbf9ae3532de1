"""Number of contact points (active taxels of all grasps) per object in a dataset, as in Table 5.2 of the thesis."""

import os
from dataclasses import dataclass

from taxel.cloud.contacts import count_baseline_frames, select_used_taxels
from taxel.recording.grasp_dataset import GraspDataset


@dataclass(frozen=True)
class PointCount:
    """Number of grasps of one object, and the sum of active taxels over these grasps."""

    grasps: int
    points: int


def count_contact_points(path: str | os.PathLike[str]) -> dict[str, PointCount]:
    """Count the grasps and their active taxels in a grasp dataset, by name of the object.

    Only taxels that the thesis experiments used and that have a valid hold frame are counted. A grasp in which a board
    has hold frames but no baseline frames is omitted.
    """
    with GraspDataset(path) as data:
        used = select_used_taxels(data)
        grasps = dict.fromkeys(data.objects, 0)
        points = dict.fromkeys(data.objects, 0)
        for grasp in data:
            frames = count_baseline_frames(grasp)
            if not frames:
                continue
            active, known = grasp.active_taxels(baseline_frames=frames)
            grasps[grasp.object] += 1
            points[grasp.object] += int((active & known & used).sum())
    return {name: PointCount(grasps[name], points[name]) for name in grasps}
