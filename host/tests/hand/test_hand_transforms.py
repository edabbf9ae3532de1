"""Rigid transforms agree with scipy's rotations to rounding, also near no turn and near half a turn."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from taxel.hand import transforms as tf

SEED = 20
EXACT = 1e-12


def angles() -> NDArray[np.float64]:
    """Angles from 0 to pi, dense at both ends."""
    small = np.concatenate([[0.0], np.logspace(-300, -1, 60)])
    return np.concatenate([small, np.linspace(0.2, 3.0, 30), np.pi - small])


def rotation_vectors() -> NDArray[np.float64]:
    print(f"seed {SEED}")
    axes = np.random.default_rng(SEED).normal(size=(20, angles().size, 3))
    axes[:3] = np.eye(3)[:, np.newaxis]
    axes /= np.linalg.norm(axes, axis=-1, keepdims=True)
    vectors: NDArray[np.float64] = (axes * angles()[:, np.newaxis]).reshape(-1, 3)
    return vectors


def random_transforms(*shape: int) -> NDArray[np.float64]:
    print(f"seed {SEED}")
    rng = np.random.default_rng(SEED)
    return tf.make_pose(rng.normal(size=(*shape, 3)), rng.normal(size=(*shape, 4)))


def close(found: NDArray[np.float64], expected: NDArray[np.float64], tolerance: float = EXACT) -> None:
    np.testing.assert_allclose(found, expected, rtol=0, atol=tolerance)


def test_a_rotation_vector_gives_the_matrix_that_scipy_gives() -> None:
    vectors = rotation_vectors()
    close(tf.from_rotation_vector(vectors)[:, :3, :3], Rotation.from_rotvec(vectors).as_matrix())


def test_a_rotation_vector_comes_back_from_its_matrix() -> None:
    vectors = rotation_vectors()
    back = tf.to_rotation_vector(tf.from_rotation_vector(vectors))
    # At half a turn both directions of the axis are the same rotation.
    flipped = (np.linalg.norm(vectors, axis=1) > np.pi - 1e-12) & ((back * vectors).sum(axis=1) < 0)
    close(np.where(flipped[:, np.newaxis], -back, back), vectors)


def test_a_small_rotation_vector_keeps_its_digits() -> None:
    vector = np.array([3e-9, -4e-9, 1e-12])
    np.testing.assert_allclose(tf.to_rotation_vector(tf.from_rotation_vector(vector)), vector, rtol=1e-15)


def test_quaternions_are_those_of_scipy() -> None:
    rotation = Rotation.from_rotvec(rotation_vectors())
    quaternions = np.roll(rotation.as_quat(canonical=True), 1, axis=-1)
    transforms = tf.from_quaternion(quaternions)
    close(transforms[:, :3, :3], rotation.as_matrix())
    back = tf.to_quaternion(transforms)
    close(np.abs((back * quaternions).sum(axis=1)), np.ones(len(back)))
    close(np.minimum(abs(back - quaternions), abs(back + quaternions)), np.zeros_like(back))


def test_the_first_component_of_a_quaternion_that_is_not_zero_is_positive() -> None:
    for given, expected in (
        ([-1, 0, 0, 0], [1, 0, 0, 0]),
        ([0, -1, 0, 0], [0, 1, 0, 0]),
        ([0, 0, -3, 4], [0, 0, 0.6, -0.8]),
        ([0, 0, 0, -2], [0, 0, 0, 1]),
    ):
        close(tf.to_quaternion(tf.from_quaternion(given)), np.array(expected, dtype=float))


def test_roll_pitch_and_yaw_are_those_of_a_urdf() -> None:
    rpy = np.random.default_rng(SEED).uniform(-np.pi, np.pi, (500, 3))
    close(tf.from_rpy(rpy)[:, :3, :3], Rotation.from_euler("xyz", rpy).as_matrix())
    close(tf.to_rpy(tf.from_rpy(rpy)), Rotation.from_euler("xyz", rpy).as_euler("xyz"), 1e-11)


@pytest.mark.parametrize("off", [0.0, 1e-16, 1e-12, 1e-9, 1e-8, 1e-5])
@pytest.mark.parametrize("sign", [-1, 1])
def test_roll_pitch_and_yaw_give_the_same_rotation_at_gimbal_lock(off: float, sign: int) -> None:
    rpy = np.random.default_rng(SEED).uniform(-np.pi, np.pi, (200, 3))
    rpy[:, 1] = sign * (np.pi / 2 - off)
    transforms = tf.from_rpy(rpy)
    close(tf.from_rpy(tf.to_rpy(transforms)), transforms)


def test_a_pose_has_its_position_and_its_rotation() -> None:
    transform = tf.make_pose([1, 2, 3], [np.sqrt(0.5), 0, 0, np.sqrt(0.5)])
    close(transform, np.array([[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]], dtype=float))


def test_positions_and_quaternions_of_a_pose_broadcast() -> None:
    assert tf.make_pose(np.zeros((5, 1, 3)), np.ones((7, 4))).shape == (5, 7, 4, 4)


def test_the_inverse_undoes_a_transform() -> None:
    transforms = random_transforms(3, 50)
    close(tf.inverse(transforms) @ transforms, np.broadcast_to(np.eye(4), transforms.shape))
    close(tf.inverse(transforms), np.linalg.inv(transforms))


def test_points_are_turned_and_moved_and_directions_only_turned() -> None:
    transforms = random_transforms(2, 5)
    points = np.random.default_rng(SEED).normal(size=(5, 7, 3))
    homogeneous = np.concatenate([points, np.ones((5, 7, 1))], axis=-1)
    expected = np.einsum("abij,bnj->abni", transforms, homogeneous)[..., :3]
    close(tf.apply(transforms, points), expected)
    close(tf.rotate(transforms, points), expected - transforms[..., np.newaxis, :3, 3])


def test_a_single_point_may_be_given_without_its_axis() -> None:
    transforms = random_transforms(4)
    close(tf.apply(transforms, [1, 2, 3]), tf.apply(transforms, [[1, 2, 3]])[:, 0])
    assert tf.apply(transforms[0], [1, 2, 3]).shape == (3,)


def test_composition_is_the_matrix_product() -> None:
    first, second = random_transforms(2)
    points = np.random.default_rng(SEED).normal(size=(9, 3))
    close(tf.apply(first @ second, points), tf.apply(first, tf.apply(second, points)))


def test_interpolation_is_linear_in_position_and_even_in_angle() -> None:
    start, end = tf.make_pose([0, 0, 0], [1, 0, 0, 0]), tf.from_rotation_vector([0, 0, 2.0])
    end[:3, 3] = 1, 2, 3
    found = tf.interpolate(start, end, [0, 0.25, 1])
    close(tf.to_rotation_vector(found), np.array([[0, 0, 0], [0, 0, 0.5], [0, 0, 2]]))
    close(found[:, :3, 3], np.array([[0, 0, 0], [0.25, 0.5, 0.75], [1, 2, 3]]))


def test_every_result_is_rigid() -> None:
    tf.check_rigid(tf.from_rotation_vector(rotation_vectors()), EXACT)
    tf.check_rigid(random_transforms(6, 6), EXACT)


@pytest.mark.parametrize(
    ("transform", "piece"),
    [
        (np.eye(3), r"expected shape \[..., 4, 4\], found \(3, 3\)"),
        (np.eye(4) * np.nan, "finite"),
        (random_transforms().T, "is it transposed"),
        (np.diag([1.001, 1, 1, 1]), "scaled"),
        (np.diag([1, 1, -1, 1]), "mirrored"),
        (np.stack([np.eye(4), np.diag([2, 1, 1, 1])]), "scaled"),
    ],
)
def test_what_is_no_rigid_transform_is_refused(transform: NDArray[np.float64], piece: str) -> None:
    with pytest.raises(ValueError, match=piece):
        tf.check_rigid(transform)


@pytest.mark.parametrize("quaternion", [[0, 0, 0, 0], [np.nan, 0, 0, 1], [np.inf, 0, 0, 0]])
def test_a_quaternion_without_a_direction_is_refused(quaternion: list[float]) -> None:
    with pytest.raises(ValueError, match="quaternion: expected a finite length above 0"):
        tf.from_quaternion(quaternion)


def test_a_wrong_last_axis_is_refused() -> None:
    with pytest.raises(ValueError, match=r"points: expected 3 numbers in the last axis, found shape \(2, 4\)"):
        tf.apply(np.eye(4), np.zeros((2, 4)))
