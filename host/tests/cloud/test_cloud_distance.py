"""Unsigned distances to surfaces and clouds are exact, and do not depend on where both lie together."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taxel.cloud.distance import DistanceStats, distances_to_cloud, distances_to_mesh
from taxel.cloud.errors import CloudError
from taxel.cloud.mesh import TriangleMesh
from taxel.cloud.models import models
from taxel.grasp.shapes import ConvexPolytope
from taxel.hand.transforms import apply, from_rotation_vector

BOX = ConvexPolytope.box(0.06, 0.04, 0.1)
NUMBERS = st.lists(st.floats(-1.0, 1.0), min_size=6, max_size=6)


def motion(numbers):
    transform = from_rotation_vector(3.0 * np.array(numbers[:3]))
    transform[:3, 3] = numbers[3:]
    return transform


def scattered(count=300, seed=2):
    return np.random.default_rng(seed).uniform(-0.12, 0.12, (count, 3)) + np.array([0.0, 0.0, 0.05])


def test_distances_to_a_box_are_those_of_its_formula():
    mesh, points = TriangleMesh("box", *BOX.mesh()), scattered()
    assert distances_to_mesh(points, mesh) == pytest.approx(np.abs(BOX.signed_distance(points)), abs=1e-12)
    assert mesh.signed_distance(points) == pytest.approx(BOX.signed_distance(points), abs=1e-12)


@pytest.mark.parametrize("name", models())
def test_points_on_a_surface_are_at_no_distance(name):
    mesh = models()[name]
    assert distances_to_mesh(mesh.sample(500), mesh).max() < 1e-12


@settings(max_examples=25, deadline=None, derandomize=True)
@given(NUMBERS, st.sampled_from(sorted(models())))
def test_moving_cloud_and_mesh_together_changes_no_distance(numbers, name):
    mesh, points, moved = models()[name], scattered(60), motion(numbers)
    there = distances_to_mesh(apply(moved, points), mesh.moved(moved))
    assert there == pytest.approx(distances_to_mesh(points, mesh), abs=1e-9)


@settings(max_examples=25, deadline=None, derandomize=True)
@given(NUMBERS)
def test_moving_two_clouds_together_changes_no_distance(numbers):
    moved, one, other = motion(numbers), scattered(80), scattered(50, seed=5)
    there = distances_to_cloud(apply(moved, one), apply(moved, other))
    assert there == pytest.approx(distances_to_cloud(one, other), abs=1e-9)


def test_a_cloud_is_at_no_distance_from_itself():
    assert (distances_to_cloud(scattered(), scattered()) == 0.0).all()


def test_what_distances_add_up_to():
    stats = DistanceStats.of(np.array([0.001, 0.002, 0.003]))
    assert (stats.points, stats.mean_m, stats.max_m) == (3, pytest.approx(0.002), 0.003)
    assert stats.std_m == pytest.approx(np.sqrt(2.0 / 3.0) * 1e-3)
    assert stats.rms_m**2 == pytest.approx(stats.mean_m**2 + stats.std_m**2)


def test_an_empty_cloud_is_one_line():
    empty, line = np.empty((0, 3)), "points: expected 1 or more, found none: the cloud is empty"
    with pytest.raises(CloudError, match=f"mine: {line}"):
        distances_to_mesh(empty, models()["cone"], "mine")
    with pytest.raises(CloudError, match=f"mine: {line}"):
        distances_to_cloud(empty, scattered(), "mine")
    with pytest.raises(CloudError, match=f"target: {line}"):
        distances_to_cloud(scattered(), empty)


def test_points_that_are_not_finite_are_one_line():
    points = scattered()
    points[3, 1] = np.inf
    with pytest.raises(CloudError, match="mine: points: expected finite coordinates, found 1 with NaN or infinity"):
        distances_to_mesh(points, models()["cone"], "mine")
