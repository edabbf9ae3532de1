"""Fusion of repeats: the same contact averaged over the iterations of a grasp, instead of points piled up.

The thesis's proposal (5.6.2, after Figure 5.13): "instead of a simple points accumulation, the 3D coordinates of the
detected contact points can be averaged across the different attempts of the same grasp". The same contact is read as
the same taxel in the same approach.
"""

from __future__ import annotations

import numpy as np

from taxel.cloud.contact_cloud import ContactCloud


def fused(cloud: ContactCloud, least_share: float = 0.0) -> ContactCloud:
    """One point for each taxel and approach: mean place and mean counts over the repeats in which it was active.

    least_share: points that fewer of the approach's repeats have are left out. 0: none are; 0.5: half must have it.
    What felt nothing in a repeat stays as it is. A fused point belongs to the first repeat that has it.
    """
    key = cloud.approach * (int(cloud.taxel.max(initial=0)) + 2) + cloud.taxel
    _, first, group, times = np.unique(key, return_index=True, return_inverse=True, return_counts=True)
    group = group.reshape(-1)
    points = np.stack([np.bincount(group, weights=axis) for axis in cloud.points.T], axis=1) / times[:, None]
    counts = np.bincount(group, weights=cloud.counts) / times
    repeats = np.bincount(cloud.grasp_approach, minlength=len(cloud.approaches))[cloud.approach[first]]
    stays = times >= least_share * repeats
    return ContactCloud(
        f"{cloud.name}, fused",
        points[stays],
        counts[stays],
        cloud.grasp[first][stays],
        cloud.taxel[first][stays],
        cloud.grasps,
        cloud.grasp_approach,
        cloud.approaches,
        cloud.quiet,
        cloud.quiet_grasp,
    )
