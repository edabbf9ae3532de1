"""Unsigned distances to surfaces and clouds are exact and invariant under a common rigid motion."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taxel.cloud.distance import DistanceStats, compute_distances_to_cloud, compute_distances_to_mesh
from taxel.cloud.errors import CloudError
from taxel.cloud.mesh import TriangleMesh
from taxel.cloud.models import get_builtin_models
from taxel.grasp.shapes import ConvexPolytope
from taxel.hand.transforms import apply, from_rotation_vector

BOX = ConvexPolytope.box(0.06, 0.04, 0.1)
NUMBERS = st.lists(st.floats(-1.0, 1.0), min_size=6, max_size=6)


def build_motion(numbers):
    """Build a rigid transform from a rotation vector (a third of it, radians) and a shift (metres)."""
    transform = from_rotation_vector(3.0 * np.array(numbers[:3]))
    transform[:3, 3] = numbers[3:]
    return transform


def sample_points(count=300, seed=2):
    """Sample random points around the built-in shapes, f64[count, 3]."""
    return np.random.default_rng(seed).uniform(-0.12, 0.12, (count, 3)) + np.array([0.0, 0.0, 0.05])


def test_unsigned_and_signed_distances_to_a_box_mesh_equal_the_formula_of_a_box():
    mesh, points = TriangleMesh("box", *BOX.mesh()), sample_points()
    assert compute_distances_to_mesh(points, mesh) == pytest.approx(np.abs(BOX.signed_distance(points)), abs=1e-12)
    assert mesh.compute_signed_distance(points) == pytest.approx(BOX.signed_distance(points), abs=1e-12)


@pytest.mark.parametrize("name", get_builtin_models())
def test_points_sampled_on_a_surface_have_a_distance_of_zero_to_it(name):
    mesh = get_builtin_models()[name]
    assert compute_distances_to_mesh(mesh.sample(500), mesh).max() < 1e-11  # metres: rounding


@settings(max_examples=25, deadline=None, derandomize=True)
@given(NUMBERS, st.sampled_from(sorted(get_builtin_models())))
def test_moving_cloud_and_mesh_together_changes_no_distance(numbers, name):
    mesh, points, matrix = get_builtin_models()[name], sample_points(60), build_motion(numbers)
    distances = compute_distances_to_mesh(apply(matrix, points), mesh.transform(matrix))
    assert distances == pytest.approx(compute_distances_to_mesh(points, mesh), abs=1e-9)


@settings(max_examples=25, deadline=None, derandomize=True)
@given(NUMBERS)
def test_moving_two_clouds_together_changes_no_distance(numbers):
    matrix, first, second = build_motion(numbers), sample_points(80), sample_points(50, seed=5)
    distances = compute_distances_to_cloud(apply(matrix, first), apply(matrix, second))
    assert distances == pytest.approx(compute_distances_to_cloud(first, second), abs=1e-9)


def test_distance_of_a_cloud_to_itself_is_zero():
    assert (compute_distances_to_cloud(sample_points(), sample_points()) == 0.0).all()


def test_statistics_of_three_distances_have_the_population_standard_deviation():
    stats = DistanceStats.from_distances(np.array([0.001, 0.002, 0.003]))
    assert (stats.points, stats.mean_m, stats.max_m) == (3, pytest.approx(0.002), 0.003)
    assert stats.std_m == pytest.approx(np.sqrt(2.0 / 3.0) * 1e-3)
    assert stats.rms_m**2 == pytest.approx(stats.mean_m**2 + stats.std_m**2)


def test_empty_cloud_and_empty_target_are_refused_in_one_line():
    empty, line = np.empty((0, 3)), "points: expected 1 or more, found none: the cloud is empty"
    with pytest.raises(CloudError, match=f"cloud: {line}"):
        compute_distances_to_mesh(empty, get_builtin_models()["cone"], "cloud")
    with pytest.raises(CloudError, match=f"cloud: {line}"):
        compute_distances_to_cloud(empty, sample_points(), "cloud")
    with pytest.raises(CloudError, match=f"target: {line}"):
        compute_distances_to_cloud(sample_points(), empty)


def test_points_that_are_not_finite_are_refused_in_one_line():
    points = sample_points()
    points[3, 1] = np.inf
    with pytest.raises(CloudError, match="cloud: points: expected finite coordinates, found 1 with NaN or infinity"):
        compute_distances_to_mesh(points, get_builtin_models()["cone"], "cloud")
