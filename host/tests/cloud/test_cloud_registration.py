"""Alignment finds the motion that was made, ends where closest points end, and says in one line what it cannot do."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from taxel.cloud.errors import CloudError, RegistrationError
from taxel.cloud.first_guess import align_to_mesh_from_anywhere, align_to_points_from_anywhere, principal_guesses
from taxel.cloud.models import models
from taxel.cloud.registration import PointTarget, align_to_mesh, align_to_points
from taxel.hand.transforms import apply, check_rigid, from_rotation_vector, inverse, to_rotation_vector

SIX = st.lists(st.floats(-1.0, 1.0), min_size=6, max_size=6)
EDGY = ("rectangular_prism", "triangular_prism", "hexagonal_prism")


def motion(turn, shift):
    transform = from_rotation_vector(np.array(turn, float))
    transform[:3, 3] = shift
    return transform


def apart(one, other):
    """Degrees and millimetres between two transforms."""
    rest = inverse(one) @ other
    return np.degrees(np.linalg.norm(to_rotation_vector(rest))), 1e3 * np.linalg.norm(rest[:3, 3])


def closest_points_loop(points, mesh, steps=400):
    """Besl and McKay, to the surface itself: the RMS at the end."""
    moved = points.copy()
    for _ in range(steps):
        near = mesh.closest(moved).point
        here, there = moved.mean(axis=0), near.mean(axis=0)
        u, _, v = np.linalg.svd((moved - here).T @ (near - there))
        turn = (u @ np.diag([1.0, 1.0, np.linalg.det(u @ v)]) @ v).T
        moved = (moved - here) @ turn.T + there
    return np.sqrt(np.mean(mesh.closest(moved).distance ** 2))


@settings(max_examples=20, deadline=None, derandomize=True)
@given(SIX, st.sampled_from(EDGY))
def test_a_small_motion_is_undone_on_a_mesh(numbers, name):
    mesh = models()[name]
    made = motion(0.05 * np.array(numbers[:3]), 0.003 * np.array(numbers[3:]))
    found = align_to_mesh(apply(made, mesh.sample(500, seed=3)), mesh, still=1e-12)
    degrees, mm = apart(inverse(made), found.transform)
    assert found.converged
    assert found.rms_m < 1e-6
    assert degrees < 0.01
    assert mm < 0.02


@settings(max_examples=15, deadline=None, derandomize=True)
@given(SIX)
def test_a_small_motion_is_undone_on_a_cloud(numbers):
    target = np.random.default_rng(5).uniform(-0.05, 0.05, (300, 3))
    made = motion(0.02 * np.array(numbers[:3]), 0.001 * np.array(numbers[3:]))
    found = align_to_points(apply(made, target[::2]), PointTarget(target))
    degrees, mm = apart(inverse(made), found.transform)
    assert found.rms_m < 1e-7
    assert degrees < 1e-3
    assert mm < 1e-3


@pytest.mark.parametrize("name", models())
def test_it_ends_where_closest_points_end(name, surface_cloud):
    mesh = models()[name]
    points = apply(motion([0.05, -0.08, 0.04], [0.004, -0.003, 0.002]), surface_cloud(name, noise_m=0.001).points)
    found = align_to_mesh(points, mesh, still=1e-9)
    assert found.rms_m <= 1.001 * closest_points_loop(points, mesh)
    assert found.iterations < 100


def test_the_rms_is_that_of_the_moved_points(surface_cloud):
    points, mesh = surface_cloud("cylinder").points, models()["cylinder"]
    found = align_to_mesh(points, mesh)
    distance = mesh.closest(apply(found.transform, points)).distance
    assert found.rms_m == pytest.approx(np.sqrt(np.mean(distance**2)), rel=1e-9)
    other = surface_cloud("cylinder", seed=9).points
    found = align_to_points(points, PointTarget(other))
    distance = cKDTree(other).query(apply(found.transform, points))[0]
    assert found.rms_m == pytest.approx(np.sqrt(np.mean(distance**2)), rel=1e-5)


def test_alignment_never_makes_it_worse(surface_cloud):
    points = surface_cloud("cone").points
    for name, mesh in models().items():
        before = np.sqrt(np.mean(mesh.closest(points).distance ** 2))
        assert align_to_mesh(points, mesh).rms_m <= before, name


def test_the_same_input_gives_the_same_bits(surface_cloud):
    points, mesh = surface_cloud("hexagonal_prism", seed=4).points, models()["cylinder"]
    assert (align_to_mesh(points, mesh).transform == align_to_mesh(points, mesh).transform).all()
    target = PointTarget.on_mesh(mesh, 3000)
    assert (align_to_points(points, target).transform == align_to_points(points, target).transform).all()
    check_rigid(align_to_mesh(points, mesh).transform)


def test_points_of_a_plane_on_a_plane_stay_where_they_are():
    mesh = models()["rectangular_prism"]
    top = mesh.sample(4000)
    top = top[top[:, 2] > 0.13 - 1e-12] * [0.5, 0.5, 1.0]
    found = align_to_mesh(top + np.array([0.0, 0.0, 0.001]), mesh)
    assert found.rms_m < 1e-9
    assert found.transform[:3, 3] == pytest.approx([0.0, 0.0, -0.001], abs=1e-9)


def test_few_steps_are_not_the_end(surface_cloud):
    points = surface_cloud("cylinder").points + 0.01
    found = align_to_mesh(points, models()["cylinder"], iterations=2)
    assert (found.iterations, found.converged) == (2, False)


@settings(max_examples=4, deadline=None, derandomize=True)
@given(SIX)
def test_from_anywhere_a_cloud_is_laid_on_its_mesh(numbers):
    mesh = models()["triangular_prism"]
    points = apply(motion(3.0 * np.array(numbers[:3]), numbers[3:]), mesh.sample(600, seed=3))
    assert align_to_mesh_from_anywhere(points, mesh).rms_m < 1e-4


def test_from_anywhere_a_cloud_is_laid_on_a_cloud(surface_cloud):
    target = surface_cloud("rectangular_prism", noise_m=0.0).points
    points = apply(motion([1.0, 2.0, -1.5], [0.3, 0.2, 0.1]), target[::2])
    assert align_to_points_from_anywhere(points, PointTarget(target)).rms_m < 1e-6


def test_guesses_are_rotations_and_centre_on_centre():
    rng = np.random.default_rng(3)
    points, target = rng.normal(0.0, [0.03, 0.02, 0.01], (200, 3)), rng.normal(0.1, [0.01, 0.03, 0.02], (300, 3))
    guesses = principal_guesses(points, target)
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
    ids=["none", "two", "a line", "one place"],
)
def test_points_that_fix_no_turn_are_one_line(points, found, surface_cloud):
    line = f"points: expected three or more that do not lie on one line, {found}"
    with pytest.raises(RegistrationError, match=f"mine: {line}"):
        align_to_mesh(points, models()["cone"], name="mine")
    with pytest.raises(RegistrationError, match=f"target: {line}"):
        PointTarget(points)
    with pytest.raises(RegistrationError, match=f"mine: {line}"):
        align_to_points(points, PointTarget(surface_cloud("cone").points), name="mine")


def test_few_points_on_a_line_and_one_beside_it_are_enough():
    points = np.concatenate([np.linspace(0.0, 0.1, 300)[:, None] * [1.0, 0.0, 0.0], [[0.05, 0.01, 0.0]]])
    assert PointTarget(points).points is points


def test_a_nan_is_one_line():
    with pytest.raises(CloudError, match="mine: points: expected finite coordinates"):
        align_to_mesh(np.full((5, 3), np.nan), models()["cone"], name="mine")


def test_a_cloud_that_lies_farther_than_anything_a_hand_holds_runs_away(surface_cloud):
    points = surface_cloud("cone").points
    with pytest.raises(
        RegistrationError, match="mine: alignment: expected one that converges, found one that runs away"
    ):
        align_to_points(points + 1e5, PointTarget(points), name="mine")
