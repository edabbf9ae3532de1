"""Rigid transforms agree with the rotations of scipy, also near angles of 0 and pi."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from taxel.hand import transforms as tf

SEED = 20
TOLERANCE = 1e-12


def make_angles() -> NDArray[np.float64]:
    """Make angles from 0 to pi, dense at both ends."""
    small = np.concatenate([[0.0], np.logspace(-300, -1, 60)])
    return np.concatenate([small, np.linspace(0.2, 3.0, 30), np.pi - small])


def make_rotation_vectors() -> NDArray[np.float64]:
    """Make rotation vectors about random axes and the coordinate axes, f64[n, 3]."""
    print(f"seed {SEED}")
    axes = np.random.default_rng(SEED).normal(size=(20, make_angles().size, 3))
    axes[:3] = np.eye(3)[:, np.newaxis]
    axes /= np.linalg.norm(axes, axis=-1, keepdims=True)
    vectors: NDArray[np.float64] = (axes * make_angles()[:, np.newaxis]).reshape(-1, 3)
    return vectors


def make_random_transforms(*shape: int) -> NDArray[np.float64]:
    """Make random rigid transforms, f64[*shape, 4, 4]."""
    print(f"seed {SEED}")
    rng = np.random.default_rng(SEED)
    return tf.make_pose(rng.normal(size=(*shape, 3)), rng.normal(size=(*shape, 4)))


def make_rpy_transforms(rpy: NDArray[np.float64]) -> NDArray[np.float64]:
    """Make transforms f64[n, 4, 4] from roll, pitch and yaw f64[n, 3] with SciPy."""
    transforms = np.broadcast_to(np.eye(4), (len(rpy), 4, 4)).copy()
    transforms[:, :3, :3] = Rotation.from_euler("xyz", rpy).as_matrix()
    return transforms


def assert_close(result: NDArray[np.float64], expected: NDArray[np.float64], tolerance: float = TOLERANCE) -> None:
    np.testing.assert_allclose(result, expected, rtol=0, atol=tolerance)


def test_the_matrix_of_a_rotation_vector_agrees_with_scipy() -> None:
    vectors = make_rotation_vectors()
    assert_close(tf.from_rotation_vector(vectors)[:, :3, :3], Rotation.from_rotvec(vectors).as_matrix())


def test_a_rotation_vector_is_recovered_from_its_matrix() -> None:
    vectors = make_rotation_vectors()
    recovered = tf.to_rotation_vector(tf.from_rotation_vector(vectors))
    # At an angle of pi both directions of the axis give the same rotation.
    is_flipped = (np.linalg.norm(vectors, axis=1) > np.pi - 1e-12) & ((recovered * vectors).sum(axis=1) < 0)
    assert_close(np.where(is_flipped[:, np.newaxis], -recovered, recovered), vectors)


def test_a_small_rotation_vector_keeps_its_relative_accuracy() -> None:
    vector = np.array([3e-9, -4e-9, 1e-12])
    np.testing.assert_allclose(tf.to_rotation_vector(tf.from_rotation_vector(vector)), vector, rtol=1e-15)


def test_quaternions_agree_with_scipy() -> None:
    rotation = Rotation.from_rotvec(make_rotation_vectors())
    quaternions = np.roll(rotation.as_quat(canonical=True), 1, axis=-1)
    transforms = tf.from_quaternion(quaternions)
    assert_close(transforms[:, :3, :3], rotation.as_matrix())
    recovered = tf.to_quaternion(transforms)
    assert_close(np.abs((recovered * quaternions).sum(axis=1)), np.ones(len(recovered)))
    assert_close(np.minimum(abs(recovered - quaternions), abs(recovered + quaternions)), np.zeros_like(recovered))


def test_the_first_non_zero_component_of_a_quaternion_is_positive() -> None:
    for quaternion, expected in (
        ([-1, 0, 0, 0], [1, 0, 0, 0]),
        ([0, -1, 0, 0], [0, 1, 0, 0]),
        ([0, 0, -3, 4], [0, 0, 0.6, -0.8]),
        ([0, 0, 0, -2], [0, 0, 0, 1]),
    ):
        assert_close(tf.to_quaternion(tf.from_quaternion(quaternion)), np.array(expected, dtype=float))


def test_roll_pitch_and_yaw_follow_the_urdf_convention() -> None:
    rpy = np.random.default_rng(SEED).uniform(-np.pi, np.pi, (500, 3))
    assert_close(tf.to_rpy(make_rpy_transforms(rpy)), Rotation.from_euler("xyz", rpy).as_euler("xyz"), 1e-11)


@pytest.mark.parametrize("distance_to_lock", [0.0, 1e-16, 1e-12, 1e-9, 1e-8, 1e-5])
@pytest.mark.parametrize("sign", [-1, 1])
def test_roll_pitch_and_yaw_describe_the_rotation_at_gimbal_lock(distance_to_lock: float, sign: int) -> None:
    rpy = np.random.default_rng(SEED).uniform(-np.pi, np.pi, (200, 3))
    rpy[:, 1] = sign * (np.pi / 2 - distance_to_lock)
    transforms = make_rpy_transforms(rpy)
    assert_close(make_rpy_transforms(tf.to_rpy(transforms)), transforms)


def test_a_pose_contains_its_position_and_rotation() -> None:
    transform = tf.make_pose([1, 2, 3], [np.sqrt(0.5), 0, 0, np.sqrt(0.5)])
    assert_close(transform, np.array([[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]], dtype=float))


def test_positions_and_quaternions_of_a_pose_broadcast() -> None:
    assert tf.make_pose(np.zeros((5, 1, 3)), np.ones((7, 4))).shape == (5, 7, 4, 4)


def test_the_inverse_undoes_a_transform() -> None:
    transforms = make_random_transforms(3, 50)
    assert_close(tf.inverse(transforms) @ transforms, np.broadcast_to(np.eye(4), transforms.shape))
    assert_close(tf.inverse(transforms), np.linalg.inv(transforms))


def test_points_are_rotated_and_translated_and_directions_only_rotated() -> None:
    transforms = make_random_transforms(2, 5)
    points = np.random.default_rng(SEED).normal(size=(5, 7, 3))
    homogeneous = np.concatenate([points, np.ones((5, 7, 1))], axis=-1)
    expected = np.einsum("abij,bnj->abni", transforms, homogeneous)[..., :3]
    assert_close(tf.apply(transforms, points), expected)
    assert_close(tf.rotate(transforms, points), expected - transforms[..., np.newaxis, :3, 3])


def test_a_single_point_needs_no_point_axis() -> None:
    transforms = make_random_transforms(4)
    assert_close(tf.apply(transforms, [1, 2, 3]), tf.apply(transforms, [[1, 2, 3]])[:, 0])
    assert tf.apply(transforms[0], [1, 2, 3]).shape == (3,)


def test_composition_is_the_matrix_product() -> None:
    outer, inner = make_random_transforms(2)
    points = np.random.default_rng(SEED).normal(size=(9, 3))
    assert_close(tf.apply(outer @ inner, points), tf.apply(outer, tf.apply(inner, points)))


def test_interpolation_is_linear_in_position_and_angle() -> None:
    start, end = tf.make_pose([0, 0, 0], [1, 0, 0, 0]), tf.from_rotation_vector([0, 0, 2.0])
    end[:3, 3] = 1, 2, 3
    result = tf.interpolate(start, end, [0, 0.25, 1])
    assert_close(tf.to_rotation_vector(result), np.array([[0, 0, 0], [0, 0, 0.5], [0, 0, 2]]))
    assert_close(result[:, :3, 3], np.array([[0, 0, 0], [0.25, 0.5, 0.75], [1, 2, 3]]))


def test_every_result_is_rigid() -> None:
    tf.check_rigid(tf.from_rotation_vector(make_rotation_vectors()), TOLERANCE)
    tf.check_rigid(make_random_transforms(6, 6), TOLERANCE)


@pytest.mark.parametrize(
    ("transform", "message"),
    [
        (np.eye(3), r"expected shape \[..., 4, 4\], found \(3, 3\)"),
        (np.eye(4) * np.nan, "finite"),
        (make_random_transforms().T, "check for a transposed matrix"),
        (np.diag([1.001, 1, 1, 1]), "remove scale and shear"),
        (np.diag([1, 1, -1, 1]), "found a reflection"),
        (np.stack([np.eye(4), np.diag([2, 1, 1, 1])]), "remove scale and shear"),
    ],
)
def test_a_transform_that_is_not_rigid_is_rejected(transform: NDArray[np.float64], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        tf.check_rigid(transform)


@pytest.mark.parametrize("quaternion", [[0, 0, 0, 0], [np.nan, 0, 0, 1], [np.inf, 0, 0, 0]])
def test_a_quaternion_of_zero_or_infinite_length_is_rejected(quaternion: list[float]) -> None:
    with pytest.raises(ValueError, match="quaternion: expected a finite length above 0"):
        tf.from_quaternion(quaternion)


def test_a_wrong_last_axis_is_rejected() -> None:
    with pytest.raises(ValueError, match=r"points: expected 3 numbers in the last axis, found shape \(2, 4\)"):
        tf.apply(np.eye(4), np.zeros((2, 4)))
