"""Force filter and statistical outliers, in CloudCompare's definition."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy.spatial.distance import cdist

from taxel.cloud.errors import CloudError
from taxel.cloud.filters import (
    TREE_NEIGHBOURS,
    force_filter,
    kept,
    mean_neighbour_distances,
    sor_mask,
    without_outliers,
)
from taxel.cloud.treatment import OTHER_SOR, Sor, sor_of
from taxel.hand.transforms import apply, from_rotation_vector

COORDINATE = st.floats(-0.1, 0.1).map(lambda value: round(value, 6))
CLOUDS = hnp.arrays(np.float64, st.tuples(st.integers(5, 40), st.just(3)), elements=COORDINATE)


def by_definition(points, k, n_sigma):
    mean = np.sort(cdist(points, points), axis=1)[:, 1:k].mean(axis=1)
    return mean, mean <= mean.mean() + n_sigma * np.sqrt(np.mean((mean - mean.mean()) ** 2))


@pytest.mark.parametrize("k", [2, 6, 20, TREE_NEIGHBOURS + 1, 600])
def test_the_definition_point_by_point(k):
    seed = 3
    points = np.random.default_rng(seed).normal(0.0, 0.02, (600, 3))
    mean, stays = by_definition(points, k, 1.0)
    assert mean_neighbour_distances(points, [k])[0] == pytest.approx(mean, rel=1e-12), f"seed {seed}"
    assert (sor_mask(points, k, 1.0) == stays).all(), f"seed {seed}"


def test_several_k_at_once_are_each_alone():
    points = np.random.default_rng(4).normal(0.0, 0.02, (500, 3))
    ks = [250, 20, 499, 20]
    together = mean_neighbour_distances(points, ks)
    for row, k in zip(together, ks, strict=True):
        assert row == pytest.approx(mean_neighbour_distances(points, [k])[0], rel=1e-12)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(CLOUDS, st.floats(0.0, 3.0), st.floats(0.0, 3.0))
def test_more_sigmas_keep_more_points(points, one, other):
    low, high = sorted((one, other))
    assert not (sor_mask(points, 5, low) & ~sor_mask(points, 5, high)).any()


@settings(max_examples=40, deadline=None, derandomize=True)
@given(CLOUDS, st.lists(st.floats(-3.0, 3.0), min_size=3, max_size=3))
def test_where_a_cloud_lies_makes_no_difference(points, turn):
    moved = apply(from_rotation_vector(np.array(turn)), points) + np.array([0.3, -0.2, 0.1])
    here, there = (mean_neighbour_distances(places, [5])[0] for places in (points, moved))
    assert there == pytest.approx(here, abs=1e-9)


def test_equal_distances_hold_no_outlier():
    ring = 2.0 * np.pi * np.arange(40) / 40
    points = np.stack([np.cos(ring), np.sin(ring), 0.0 * ring], axis=1)
    assert sor_mask(points, 5, 0.0).all()


def test_the_point_that_stands_alone_goes(surface_cloud):
    cloud = surface_cloud("cylinder", noise_m=0.0)
    far = cloud.points.copy()
    far[17] += 0.2
    clean = without_outliers(replace(cloud, points=far), 20, 2.0)
    assert len(clean) == len(cloud) - 1
    assert 0.2 not in clean.points[:, 0].round(1)


def test_points_upon_each_other_are_no_outliers():
    points = np.repeat(np.random.default_rng(1).normal(0.0, 0.01, (10, 3)), 10, axis=0)
    assert sor_mask(points, 5, 1.0).all()


@pytest.mark.parametrize("k", [11, 1000])
def test_fewer_points_than_n_is_one_line(k):
    with pytest.raises(CloudError, match=f"mine: points: expected {k} or more, the N of the outlier filter, found 10"):
        sor_mask(np.eye(10)[:, :3], k, 1.0, "mine")


def test_a_point_alone_is_no_neighbourhood():
    with pytest.raises(CloudError, match="N: expected 2 or more neighbours: a point counts itself, found 1"):
        sor_mask(np.eye(3), 1, 1.0)


def test_sigma_is_of_the_population():
    mean = np.array([1.0, 1.0, 1.0, 2.0])  # population 0.433, sample 0.5: only one of them drops the last at 1.6 sigma
    assert kept(mean, 1.6).tolist() == [True, True, True, False]


def test_the_force_filter_keeps_signals_above_it(surface_cloud):
    cloud = surface_cloud("cylinder")
    strong = force_filter(cloud, 190.0)
    assert len(strong) == (cloud.counts > 190.0).sum()
    assert strong.counts.min() > 190.0
    with pytest.raises(CloudError, match="counts: expected a signal for each point, found 400 without"):
        force_filter(replace(cloud, counts=np.full(len(cloud), np.nan)), 190.0)


def test_settings_of_the_thesis_by_shape():
    assert sor_of("rectangular_prism") == Sor(20.0, 1.0)
    assert sor_of("mug") == OTHER_SOR
    assert sor_of("triangular_prism").count(2866) == 716
    assert sor_of("cylinder").count(2760) == 20
