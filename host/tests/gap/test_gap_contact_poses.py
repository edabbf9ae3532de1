"""Poses of boards relative to an object, estimated from the stated separations of their taxels."""

from __future__ import annotations

import numpy as np
import pytest

from taxel.gap.effects.contact_poses import SurfaceSamples, estimate_poses
from taxel.hand.transforms import from_rotation_vector, inverse

RADIUS_M, SURFACE_OFFSET_M = 0.03, 0.002
"""Radius of the object, a cylinder along z, and height of the layer's surface above the stated taxel positions."""

SIDE = 0.004 * (np.arange(6) - 2.5)
GRID = np.stack([*np.meshgrid(SIDE, SIDE, indexing="ij"), np.zeros((6, 6))], axis=2).reshape(-1, 3)
"""Taxels of a flat board in its own frame, f64[36, 3], metres; their normals are along z."""


def compute_depths(poses: np.ndarray) -> np.ndarray:
    """Return the depths of the taxels of all boards along their normals in the cylinder, metres; NaN for a miss."""
    points = (GRID @ poses[:, :3, :3].transpose(0, 2, 1) + poses[:, None, :3, 3]).reshape(-1, 3)
    normals = np.repeat(poses[:, :3, 2], len(GRID), axis=0)
    a = (normals[:, :2] ** 2).sum(axis=1)
    b = (points[:, :2] * normals[:, :2]).sum(axis=1)
    c = (points[:, :2] ** 2).sum(axis=1) - RADIUS_M**2
    with np.errstate(invalid="ignore"):
        return (b + np.sqrt(b**2 - a * c)) / a


def place_board(turn_rad: float) -> np.ndarray:
    """Return the pose of a board that faces the axis of the cylinder at its surface."""
    towards_axis = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
    pose = np.eye(4)
    pose[:3, :3] = towards_axis
    pose[0, 3] = RADIUS_M
    return from_rotation_vector(np.array([0.0, 0.0, turn_rad])) @ pose


def make_motion(seed: int) -> np.ndarray:
    """Return a random motion of some millimetres and degrees."""
    rng = np.random.default_rng(seed)
    motion = from_rotation_vector(np.radians(rng.normal(0.0, 2.0, 3)))
    motion[:3, 3] = rng.normal(0.0, 1.5e-3, 3)
    return motion


@pytest.fixture
def boards() -> np.ndarray:
    """Poses of three boards around the cylinder, f64[3, 4, 4]."""
    return np.stack([place_board(turn) for turn in (0.0, 2.0, 4.0)])


def make_samples(poses: np.ndarray) -> SurfaceSamples:
    """Return the depths that a simulator states for boards at these poses."""
    board = np.repeat(np.arange(len(poses)), len(GRID))
    return SurfaceSamples(board, compute_depths(poses) + SURFACE_OFFSET_M, np.zeros((len(poses), 3)))


def compute_shape_errors(found: np.ndarray, samples: SurfaceSamples) -> np.ndarray:
    """Return the deviations of the depths from the stated depths, f64[N, 36], metres, without a common offset."""
    errors = (compute_depths(found) - samples.depth).reshape(len(found), -1)
    return errors - np.median(errors, axis=1, keepdims=True)


def test_depths_at_the_estimated_poses_agree_with_the_stated_depths_up_to_an_offset(boards):
    """The object has moved in the grasp, and each board is bent a little.

    The height of the layer's surface above the taxels is unknown, so an offset of all depths of a board is no error.
    """
    true = make_motion(1) @ boards
    true = np.stack([pose @ from_rotation_vector(np.radians([0.5, -0.4, 0.0])) for pose in true])
    samples = make_samples(true)
    found = estimate_poses(nominal=boards, grasp=np.zeros(3, np.intp), samples=samples, compute_depths=compute_depths)
    assert np.abs(compute_shape_errors(boards, samples)).max() > 3e-4  # metres, at the nominal poses
    assert np.abs(compute_shape_errors(found, samples)).max() < 2e-5


def test_grasps_of_one_object_have_poses_of_their_own(boards):
    true = np.concatenate([make_motion(2) @ boards, make_motion(3) @ boards])
    samples = make_samples(true)
    nominal = np.concatenate([boards, boards])
    found = estimate_poses(nominal, np.repeat([0, 1], 3), samples, compute_depths)
    assert np.abs(compute_shape_errors(found, samples)).max() < 2e-5


def test_one_wrong_stated_depth_does_not_change_the_estimated_pose(boards):
    """The depths of all other samples agree with the estimated pose."""
    true = make_motion(4) @ boards
    samples = make_samples(true)
    samples.depth[7] += 3e-3  # metres; 7 is a sample of the first board
    found = estimate_poses(boards, np.zeros(3, np.intp), samples, compute_depths)
    errors = np.delete(compute_shape_errors(found, samples)[0], 7)
    assert np.abs(errors).max() < 1e-4


def test_a_board_without_separations_moves_with_its_grasp(boards):
    motion = make_motion(5)
    samples = make_samples(motion @ boards)
    is_stated = samples.board < 2
    stated = SurfaceSamples(samples.board[is_stated], samples.depth[is_stated], samples.centre)

    def compute_stated_depths(poses: np.ndarray) -> np.ndarray:
        return compute_depths(poses)[is_stated]

    found = estimate_poses(boards, np.zeros(3, np.intp), stated, compute_stated_depths)
    distance = np.linalg.norm((inverse(boards[2]) @ found[2])[:3, 3])
    assert distance > 1e-4
    assert np.linalg.norm(found[2, :2, 3] - (motion @ boards[2])[:2, 3]) < 5e-4


def test_nominal_poses_are_kept_without_separations(boards):
    nothing = SurfaceSamples(np.empty(0, np.intp), np.empty(0), np.zeros((3, 3)))
    found = estimate_poses(boards, np.zeros(3, np.intp), nothing, lambda poses: np.empty(0))
    np.testing.assert_array_equal(found, boards)
