"""Force filter and statistical outlier filter, with the definition of CloudCompare."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy.spatial.distance import cdist

from taxel.cloud.errors import CloudError
from taxel.cloud.filters import (
    MAX_TREE_NEIGHBOURS,
    compute_mean_neighbour_distances,
    filter_by_force,
    find_inliers,
    remove_outliers,
    select_inliers,
)
from taxel.cloud.treatment import DEFAULT_OUTLIER_FILTER, OutlierFilter, get_outlier_filter
from taxel.hand.transforms import apply, from_rotation_vector

COORDINATE = st.floats(-0.1, 0.1).map(lambda value: round(value, 6))
CLOUDS = hnp.arrays(np.float64, st.tuples(st.integers(5, 40), st.just(3)), elements=COORDINATE)


def compute_by_definition(points, k, n_sigma):
    """Compute mean neighbour distances f64[N] and inliers bool[N] from the distances of all pairs of points."""
    mean = np.sort(cdist(points, points), axis=1)[:, 1:k].mean(axis=1)
    return mean, mean <= mean.mean() + n_sigma * np.sqrt(np.mean((mean - mean.mean()) ** 2))


@pytest.mark.parametrize("k", [2, 6, 20, MAX_TREE_NEIGHBOURS + 1, 600])
def test_outlier_filter_agrees_with_its_definition_for_every_point(k):
    seed = 3
    points = np.random.default_rng(seed).normal(0.0, 0.02, (600, 3))
    mean, is_inlier = compute_by_definition(points, k, 1.0)
    assert compute_mean_neighbour_distances(points, [k])[0] == pytest.approx(mean, rel=1e-12), f"seed {seed}"
    assert (find_inliers(points, k, 1.0) == is_inlier).all(), f"seed {seed}"


def test_mean_distances_for_several_k_at_once_equal_those_for_each_k():
    points = np.random.default_rng(4).normal(0.0, 0.02, (500, 3))
    ks = [250, 20, 499, 20]
    together = compute_mean_neighbour_distances(points, ks)
    for row, k in zip(together, ks, strict=True):
        assert row == pytest.approx(compute_mean_neighbour_distances(points, [k])[0], rel=1e-12)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(CLOUDS, st.floats(0.0, 3.0), st.floats(0.0, 3.0))
def test_larger_sigma_keeps_all_points_of_a_smaller_sigma(points, first, second):
    low, high = sorted((first, second))
    assert not (find_inliers(points, 5, low) & ~find_inliers(points, 5, high)).any()


@settings(max_examples=40, deadline=None, derandomize=True)
@given(CLOUDS, st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=3))
def test_neighbour_distances_are_invariant_under_rigid_motion(points, rotation):
    moved = apply(from_rotation_vector(np.array(rotation)), points) + np.array([0.3, -0.2, 0.1])
    before, after = (compute_mean_neighbour_distances(cloud, [5])[0] for cloud in (points, moved))
    assert after == pytest.approx(before, abs=1e-9)


def test_equal_distances_give_no_outlier():
    angle = 2.0 * np.pi * np.arange(40) / 40
    points = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    assert find_inliers(points, 5, 0.0).all()


def test_only_an_isolated_point_is_removed(surface_cloud):
    cloud = surface_cloud("cylinder", noise_m=0.0)
    isolated = 17
    points = cloud.points.copy()
    points[isolated] += 0.2
    clean = remove_outliers(replace(cloud, points=points), k=20, n_sigma=2.0)
    assert (clean.points == np.delete(points, isolated, axis=0)).all()


def test_coincident_points_are_not_outliers():
    points = np.repeat(np.random.default_rng(1).normal(0.0, 0.01, (10, 3)), 10, axis=0)
    assert find_inliers(points, 5, 1.0).all()


@pytest.mark.parametrize("k", [11, 1000])
def test_fewer_points_than_n_are_refused_in_one_line(k):
    with pytest.raises(CloudError, match=f"cloud: points: expected {k} or more, the N of the outlier filter, found 10"):
        find_inliers(np.eye(10)[:, :3], k, 1.0, "cloud")


def test_n_below_two_is_refused_in_one_line():
    with pytest.raises(CloudError, match="N: expected 2 or more neighbours, the point itself included, found 1"):
        find_inliers(np.eye(3), 1, 1.0)


def test_outlier_filter_uses_the_population_standard_deviation():
    # Standard deviation: population 0.433, sample 0.5. At 1.6 sigma, only the former excludes the last value.
    mean = np.array([1.0, 1.0, 1.0, 2.0])
    assert select_inliers(mean, 1.6).tolist() == [True, True, True, False]


def test_force_filter_keeps_signals_above_the_threshold(surface_cloud):
    cloud = surface_cloud("cylinder")
    strong = filter_by_force(cloud, 190.0)
    assert len(strong) == (cloud.counts > 190.0).sum()
    assert strong.counts.min() > 190.0


def test_force_filter_of_a_cloud_without_counts_is_refused_in_one_line(surface_cloud):
    cloud = surface_cloud("cylinder")
    with pytest.raises(CloudError, match="counts: expected a signal for each point, found 400 without"):
        filter_by_force(replace(cloud, counts=np.full(len(cloud), np.nan)), 190.0)


def test_outlier_filter_has_the_settings_of_table_5_4_and_a_default_for_other_objects():
    """Table 5.4 of the thesis uses 20 neighbours, and for the triangular prism 716, a quarter of its 2866 points."""
    assert get_outlier_filter("rectangular_prism") == OutlierFilter(20.0, 1.0)
    assert get_outlier_filter("mug") == DEFAULT_OUTLIER_FILTER
    assert get_outlier_filter("triangular_prism").count_neighbours(2866) == 716
    assert get_outlier_filter("cylinder").count_neighbours(2760) == 20
