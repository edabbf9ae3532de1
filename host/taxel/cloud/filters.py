"""Filters that take points from a cloud: by force, and statistical outliers.

Statistical outlier removal (SOR, Rusu et al. 2008) as CloudCompare 2.11 does it: of each point the mean distance to its
k nearest neighbours, of which the point itself is one (so k - 1 others, and the mean is over those); a point stays if
that is at most mean + n sigma over all points, with the population's standard deviation (divided by N, not N - 1).
`tools/cloud/compare_cloudcompare.py` measures that it keeps the same points.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from taxel.cloud.contact_cloud import ContactCloud, require_points
from taxel.cloud.errors import CloudError
from taxel.types import BoolArray, FloatArray

TREE_NEIGHBOURS: Final = 256
"""With more neighbours than this, sorting all distances is faster than asking a tree."""

BLOCK: Final = 4_000_000
"""Distances that are held at a time."""

SAME: Final = 1e-12
"""Relative: mean distances that differ by less are equal, so that no point of a perfect grid is an outlier."""


def force_filter(cloud: ContactCloud, threshold: float) -> ContactCloud:
    """The points whose signal exceeds `threshold` counts, strictly. Raises CloudError where counts are unknown."""
    if np.isnan(cloud.counts).any():
        found = f"{int(np.isnan(cloud.counts).sum())} without"
        raise CloudError(cloud.name, "counts", "a signal for each point", found, "make the cloud from a dataset")
    return cloud.take(cloud.counts > threshold)


def without_outliers(cloud: ContactCloud, k: int, n_sigma: float) -> ContactCloud:
    """The cloud without its statistical outliers, see the module. Raises CloudError as `sor_mask` does."""
    return cloud.take(sor_mask(cloud.points, k, n_sigma, cloud.name))


def sor_mask(points: FloatArray, k: int, n_sigma: float, name: str = "cloud") -> BoolArray:
    """Which points stay, bool[N]. points: f64[N, 3]. Raises CloudError for k below 2 or above N."""
    return kept(mean_neighbour_distances(points, [k], name)[0], n_sigma)


def kept(mean_distance: FloatArray, n_sigma: float) -> BoolArray:
    """Which points stay, bool[N], by the mean distance of each to its neighbours, f64[N]."""
    limit = mean_distance.mean() + n_sigma * mean_distance.std()
    return np.asarray(mean_distance <= limit * (1.0 + SAME))


def mean_neighbour_distances(points: FloatArray, ks: Sequence[int], name: str = "cloud") -> FloatArray:
    """Mean distance of each point to its k - 1 nearest others, f64[len(ks), N], for several k at once."""
    for k in ks:
        if k < 2:
            raise CloudError(name, "N", "2 or more neighbours: a point counts itself", str(k), "choose a larger N")
        require_points(points, name, k, ", the N of the outlier filter")
    if max(ks) > TREE_NEIGHBOURS:
        step = max(1, BLOCK // len(points))
        parts = [points[start : start + step] for start in range(0, len(points), step)]
        return np.concatenate([_means(cdist(part, points), ks) for part in parts], axis=1)
    return _means(np.asarray(cKDTree(points).query(points, max(ks))[0]), ks)


def _means(distances: FloatArray, ks: Sequence[int]) -> FloatArray:
    """Mean over each row's k smallest but the smallest, the point itself: f64[len(ks), rows]."""
    order = sorted(set(ks))
    parted = np.partition(distances, [k - 1 for k in order], axis=1)[:, : order[-1]]
    sums = np.cumsum(np.add.reduceat(parted, [0, *order[:-1]], axis=1), axis=1)
    return np.stack([sums[:, order.index(k)] / (k - 1) for k in ks])
