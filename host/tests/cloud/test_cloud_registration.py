"""Alignment to meshes and points: known motions, convergence, refused input."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from taxel.cloud.errors import CloudError, RegistrationError
from taxel.cloud.global_alignment import align_to_mesh_globally, align_to_points_globally, compute_guesses
from taxel.cloud.models import get_builtin_models
from taxel.cloud.registration import PointTarget, align_to_mesh, align_to_points
from taxel.hand.transforms import apply, check_rigid, from_rotation_vector, inverse, to_rotation_vector

SIX_NUMBERS = st.lists(st.floats(-1.0, 1.0), min_size=6, max_size=6)
PRISMS = ("rectangular_prism", "triangular_prism", "hexagonal_prism")


def build_motion(rotation, shift):
    """Build a rigid transform from a rotation vector (radians) and a shift (metres)."""
    transform = from_rotation_vector(np.array(rotation, float))
    transform[:3, 3] = shift
    return transform


def measure_difference(first, second):
    """Return the rotation in degrees and the shift in millimetres between two transforms."""
    difference = inverse(first) @ second
    return np.degrees(np.linalg.norm(to_rotation_vector(difference))), 1e3 * np.linalg.norm(difference[:3, 3])


def run_besl_mckay(points, mesh, steps=400):
    """Align points with the algorithm of Besl and McKay to the nearest points of the surface; return the RMS
    distance.
    """
    aligned = points.copy()
    for _ in range(steps):
        closest = mesh.find_closest(aligned).point
        centre, target = aligned.mean(axis=0), closest.mean(axis=0)
        u, _, v = np.linalg.svd((aligned - centre).T @ (closest - target))
        rotation = (u @ np.diag([1.0, 1.0, np.linalg.det(u @ v)]) @ v).T
        aligned = (aligned - centre) @ rotation.T + target
    return np.sqrt(np.mean(mesh.find_closest(aligned).distance ** 2))


@settings(max_examples=20, deadline=None, derandomize=True)
@given(SIX_NUMBERS, st.sampled_from(PRISMS))
def test_alignment_to_a_mesh_reverses_a_small_motion(numbers, name):
    mesh = get_builtin_models()[name]
    applied = build_motion(0.05 * np.array(numbers[:3]), 0.003 * np.array(numbers[3:]))
    result = align_to_mesh(apply(applied, mesh.sample(500, seed=3)), mesh, tolerance=1e-12)
    degrees, mm = measure_difference(inverse(applied), result.transform)
    assert result.converged
    assert result.rms_m < 1e-6
    assert degrees < 0.01
    assert mm < 0.02


@settings(max_examples=15, deadline=None, derandomize=True)
@given(SIX_NUMBERS)
def test_alignment_to_a_cloud_reverses_a_small_motion(numbers):
    target = np.random.default_rng(5).uniform(-0.05, 0.05, (300, 3))
    applied = build_motion(0.02 * np.array(numbers[:3]), 0.001 * np.array(numbers[3:]))
    result = align_to_points(apply(applied, target[::2]), PointTarget(target))
    degrees, mm = measure_difference(inverse(applied), result.transform)
    assert result.rms_m < 1e-7
    assert degrees < 1e-3
    assert mm < 1e-3


@pytest.mark.parametrize("name", get_builtin_models())
def test_alignment_reaches_the_minimum_of_besl_and_mckay_in_fewer_than_100_iterations(name, surface_cloud):
    mesh = get_builtin_models()[name]
    points = apply(build_motion([0.05, -0.08, 0.04], [0.004, -0.003, 0.002]), surface_cloud(name, noise_m=0.001).points)
    result = align_to_mesh(points, mesh, tolerance=1e-9)
    assert result.rms_m <= 1.001 * run_besl_mckay(points, mesh)
    assert result.iterations < 100


def test_rms_of_an_alignment_to_a_mesh_is_that_of_the_transformed_points(surface_cloud):
    points, mesh = surface_cloud("cylinder").points, get_builtin_models()["cylinder"]
    result = align_to_mesh(points, mesh)
    distance = mesh.find_closest(apply(result.transform, points)).distance
    assert result.rms_m == pytest.approx(np.sqrt(np.mean(distance**2)), rel=1e-9)


def test_rms_of_an_alignment_to_a_cloud_is_that_of_the_transformed_points(surface_cloud):
    points = surface_cloud("cylinder").points
    target = surface_cloud("cylinder", seed=9).points
    result = align_to_points(points, PointTarget(target))
    distance = cKDTree(target).query(apply(result.transform, points))[0]
    assert result.rms_m == pytest.approx(np.sqrt(np.mean(distance**2)), rel=1e-5)


def test_alignment_never_increases_the_rms(surface_cloud):
    points = surface_cloud("cone").points
    for name, mesh in get_builtin_models().items():
        before = np.sqrt(np.mean(mesh.find_closest(points).distance ** 2))
        assert align_to_mesh(points, mesh).rms_m <= before, name


def test_repeated_alignment_of_the_same_points_gives_identical_bits(surface_cloud):
    points, mesh = surface_cloud("hexagonal_prism", seed=4).points, get_builtin_models()["cylinder"]
    assert (align_to_mesh(points, mesh).transform == align_to_mesh(points, mesh).transform).all()
    target = PointTarget.from_mesh(mesh, 3000)
    assert (align_to_points(points, target).transform == align_to_points(points, target).transform).all()


def test_transform_of_an_alignment_is_rigid(surface_cloud):
    points, mesh = surface_cloud("hexagonal_prism", seed=4).points, get_builtin_models()["cylinder"]
    check_rigid(align_to_mesh(points, mesh).transform)


def test_points_on_a_plane_move_only_along_its_normal():
    mesh = get_builtin_models()["rectangular_prism"]
    top = mesh.sample(4000)
    top = top[top[:, 2] > 0.215 - 1e-12] * [0.5, 0.5, 1.0]  # the middle of the top face, far from its edges
    result = align_to_mesh(top + np.array([0.0, 0.0, 0.001]), mesh)
    assert result.rms_m < 1e-9
    assert result.transform[:3, 3] == pytest.approx([0.0, 0.0, -0.001], abs=1e-9)


def test_alignment_reports_when_it_reaches_the_maximum_number_of_steps(surface_cloud):
    points = surface_cloud("cylinder").points + 0.01
    result = align_to_mesh(points, get_builtin_models()["cylinder"], max_iterations=2)
    assert (result.iterations, result.converged) == (2, False)


@settings(max_examples=4, deadline=None, derandomize=True)
@given(SIX_NUMBERS)
def test_cloud_in_an_unknown_pose_is_aligned_to_its_mesh(numbers):
    mesh = get_builtin_models()["triangular_prism"]
    points = apply(build_motion(3.0 * np.array(numbers[:3]), numbers[3:]), mesh.sample(600, seed=3))
    assert align_to_mesh_globally(points, mesh).rms_m < 1e-4


def test_cloud_in_an_unknown_pose_is_aligned_to_a_cloud(surface_cloud):
    target = surface_cloud("rectangular_prism", noise_m=0.0).points
    points = apply(build_motion([1.0, 2.0, -1.5], [0.3, 0.2, 0.1]), target[::2])
    assert align_to_points_globally(points, PointTarget(target)).rms_m < 1e-6


def test_guesses_are_25_rigid_transforms_of_which_all_but_the_identity_map_centre_to_centre():
    """The guesses are the identity, and the 24 rotations that align the principal axes of both clouds."""
    rng = np.random.default_rng(3)
    points, target = rng.normal(0.0, [0.03, 0.02, 0.01], (200, 3)), rng.normal(0.1, [0.01, 0.03, 0.02], (300, 3))
    guesses = compute_guesses(points, target)
    assert len(guesses) == 25
    check_rigid(np.stack(guesses))
    for guess in guesses[1:]:
        assert apply(guess, points).mean(axis=0) == pytest.approx(target.mean(axis=0))


@pytest.mark.parametrize(
    ("points", "found"),
    [
        (np.zeros((0, 3)), "found 0"),
        (np.eye(3)[:2], "found 2"),
        (np.linspace(0.0, 1.0, 50)[:, None] * [1.0, 2.0, 3.0], "found 50 on one line"),
        (np.ones((5, 3)), "found 5 on one line"),
    ],
    ids=["none", "two", "a line", "one point"],
)
def test_points_that_do_not_determine_a_rotation_are_refused_in_one_line(points, found, surface_cloud):
    line = f"points: expected three or more that do not lie on one line, {found}"
    with pytest.raises(RegistrationError, match=f"cloud: {line}"):
        align_to_mesh(points, get_builtin_models()["cone"], name="cloud")
    with pytest.raises(RegistrationError, match=f"target: {line}"):
        PointTarget(points)
    with pytest.raises(RegistrationError, match=f"cloud: {line}"):
        align_to_points(points, PointTarget(surface_cloud("cone").points), name="cloud")


def test_points_on_a_line_with_one_point_beside_it_are_accepted_as_a_target():
    points = np.concatenate([np.linspace(0.0, 0.1, 300)[:, None] * [1.0, 0.0, 0.0], [[0.05, 0.01, 0.0]]])
    assert PointTarget(points).points is points


def test_alignment_of_points_with_nan_is_refused_in_one_line():
    with pytest.raises(CloudError, match="cloud: points: expected finite coordinates"):
        align_to_mesh(np.full((5, 3), np.nan), get_builtin_models()["cone"], name="cloud")


def test_cloud_beyond_the_largest_pair_distance_is_refused(surface_cloud):
    points = surface_cloud("cone").points
    with pytest.raises(RegistrationError, match="cloud: alignment: expected convergence, found divergence"):
        align_to_points(points + 1e5, PointTarget(points), name="cloud")
