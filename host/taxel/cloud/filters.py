"""Filters that remove points from a cloud: the force filter and statistical outlier removal.

Statistical outlier removal (SOR, Rusu et al. 2008) as in CloudCompare 2.11: for each point the mean distance to its k
nearest neighbours is computed, where the point itself is one of the k (so that k - 1 distances are averaged). A point
stays if its mean distance is at most mean + n sigma over all points, with the population standard deviation (divisor N,
not N - 1). `tools/cloud/compare_cloudcompare.py` measures that both programs keep the same points.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from taxel.cloud.contact_cloud import ContactCloud, require_points
from taxel.cloud.errors import CloudError
from taxel.types import BoolArray, FloatArray

MAX_TREE_NEIGHBOURS: Final = 256
"""With more neighbours than this, a partition of all distances is faster than a k-d tree."""

BLOCK_DISTANCES: Final = 4_000_000
"""Largest number of distances in memory at a time."""

RELATIVE_TOLERANCE: Final = 1e-12
"""Relative rounding error that is tolerated in the comparison of mean distances, so that a regular grid has no
outlier."""


def filter_by_force(cloud: ContactCloud, threshold: float) -> ContactCloud:
    """Return the points of a contact cloud whose signal exceeds `threshold` counts.

    Raises CloudError for a cloud with unknown counts.
    """
    if np.isnan(cloud.counts).any():
        found = f"{int(np.isnan(cloud.counts).sum())} without"
        raise CloudError(cloud.name, "counts", "a signal for each point", found, "make the cloud from a dataset")
    return cloud.select(cloud.counts > threshold)


def remove_outliers(cloud: ContactCloud, k: int, n_sigma: float) -> ContactCloud:
    """Return the contact cloud without its statistical outliers.

    k: number of points in a neighbourhood, the point itself included. n_sigma: permitted mean distance to the
    neighbours, in standard deviations above the average. Raises CloudError for k below 2 or above the number of points.
    """
    return cloud.select(find_inliers(cloud.points, k, n_sigma, cloud.name))


def find_inliers(points: FloatArray, k: int, n_sigma: float, name: str = "cloud") -> BoolArray:
    """Find the points of f64[N, 3] that the statistical outlier filter keeps, bool[N].

    k: number of points in a neighbourhood, the point itself included. n_sigma: permitted mean distance to the
    neighbours, in standard deviations above the average. Raises CloudError for k below 2 or above N.
    """
    return select_inliers(compute_mean_neighbour_distances(points, [k], name)[0], n_sigma)


def select_inliers(mean_distance: FloatArray, n_sigma: float) -> BoolArray:
    """Select the points that the statistical outlier filter keeps, bool[N].

    mean_distance: mean distance of each point to its neighbours, f64[N]. n_sigma: permitted number of standard
    deviations above the average.
    """
    limit = mean_distance.mean() + n_sigma * mean_distance.std()
    return np.asarray(mean_distance <= limit * (1.0 + RELATIVE_TOLERANCE))


def compute_mean_neighbour_distances(points: FloatArray, ks: Sequence[int], name: str = "cloud") -> FloatArray:
    """Compute the mean distance of each point to its k - 1 nearest other points, for several k: f64[len(ks), N].

    points: f64[N, 3], metres. Raises CloudError for a k below 2 or above N.
    """
    for k in ks:
        if k < 2:
            raise CloudError(name, "N", "2 or more neighbours, the point itself included", str(k), "choose a larger N")
        require_points(points, name, k, ", the N of the outlier filter")
    if max(ks) > MAX_TREE_NEIGHBOURS:  # then a partition of all distances is faster than a k-d tree
        step = max(1, BLOCK_DISTANCES // len(points))
        blocks = [points[start : start + step] for start in range(0, len(points), step)]
        return np.concatenate([_average_nearest(cdist(block, points), ks) for block in blocks], axis=1)
    return _average_nearest(np.asarray(cKDTree(points).query(points, max(ks))[0]), ks)


def _average_nearest(distances: FloatArray, ks: Sequence[int]) -> FloatArray:
    """Average the 2nd to k-th smallest distance of each row for several k, f64[len(ks), rows].

    distances: f64[rows, n], from a point (row) to points of the cloud. The smallest one is left out, because it is the
    distance 0 from the point to itself.
    """
    order = sorted(set(ks))
    # After the partition, the first k values of a row are its k smallest, for every k. Their sum is the sum of the
    # sections between successive values of k.
    nearest = np.partition(distances, [k - 1 for k in order], axis=1)[:, : order[-1]]
    sums = np.cumsum(np.add.reduceat(nearest, [0, *order[:-1]], axis=1), axis=1)
    return np.stack([sums[:, order.index(k)] / (k - 1) for k in ks])
