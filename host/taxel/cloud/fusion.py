"""Fusion of repeats: one averaged point for each contact that the repeats of a grasp have in common.

Proposed in the thesis (5.6.2, after Figure 5.13): "instead of a simple points accumulation, the 3D coordinates of the
detected contact points can be averaged across the different attempts of the same grasp". Two points are treated as the
same contact if they have the same taxel and the same approach.
"""

import numpy as np

from taxel.cloud.contact_cloud import ContactCloud


def fuse_repeats(cloud: ContactCloud, min_share: float = 0.0) -> ContactCloud:
    """Average the repeats of each approach: one point for each taxel and approach, with mean position and mean counts.

    The means are taken over the repeats in which the taxel was active. min_share: taxels that are active in a smaller
    share of the repeats are left out; 0: none is left out. The inactive points are not changed. A fused point is
    assigned to the first repeat in which its taxel was active.
    """
    # One number for each pair of approach and taxel. The taxel numbers begin at -1 (unknown), therefore + 2, not + 1.
    key = cloud.approach * (int(cloud.taxel.max(initial=0)) + 2) + cloud.taxel
    _, first, group, times = np.unique(key, return_index=True, return_inverse=True, return_counts=True)
    group = group.reshape(-1)
    points = np.stack([np.bincount(group, weights=axis) for axis in cloud.points.T], axis=1) / times[:, None]
    counts = np.bincount(group, weights=cloud.counts) / times
    repeats = np.bincount(cloud.grasp_approach, minlength=len(cloud.approaches))[cloud.approach[first]]
    is_frequent = times >= min_share * repeats
    return ContactCloud(
        f"{cloud.name}, fused",
        points[is_frequent],
        counts[is_frequent],
        cloud.grasp[first][is_frequent],
        cloud.taxel[first][is_frequent],
        cloud.grasps,
        cloud.grasp_approach,
        cloud.approaches,
        cloud.inactive_points,
        cloud.inactive_grasp,
    )
