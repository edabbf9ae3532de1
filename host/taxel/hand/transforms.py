"""Rigid transforms as f64[..., 4, 4] arrays; leading axes are a batch and broadcast.

A transform ``T`` of frame b in frame a maps coordinates in b to coordinates in a: ``p_a = R p_b + t``. Two follow one
another by ``@``: ``a_T_c = a_T_b @ b_T_c``. Lengths are metres, angles radians, quaternions (w, x, y, z).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from taxel.types import FloatArray

__all__ = [
    "apply",
    "check_rigid",
    "from_quaternion",
    "from_rotation_vector",
    "from_rpy",
    "interpolate",
    "inverse",
    "make_pose",
    "rotate",
    "to_quaternion",
    "to_rotation_vector",
    "to_rpy",
]


RIGID_TOLERANCE = 1e-9  # largest entry of R^T R - 1; far above rounding, far below what a sensor resolves


def from_quaternion(quaternion: npt.ArrayLike) -> FloatArray:
    """Pure rotations from quaternions.

    quaternion: f64[..., 4] as (w, x, y, z), of any length but zero. Returns f64[..., 4, 4].
    Raises ValueError for another last axis, a zero or a value that is not finite.
    """
    given = _vectors("quaternion", quaternion, 4)
    length = np.linalg.norm(given, axis=-1, keepdims=True)
    if not (np.isfinite(length) & (length > 0)).all():
        raise ValueError("quaternion: expected a finite length above 0, found a zero, a NaN or an infinity")
    w, x, y, z = np.moveaxis(given / length, -1, 0)
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    return _rotation(rows)


def to_quaternion(transform: npt.ArrayLike) -> FloatArray:
    """Unit quaternions (w, x, y, z) of the rotations, f64[..., 4].

    Of the two signs, the first component that is not zero is positive. transform: f64[..., 4, 4].
    """
    m = _matrices(transform)
    xx, yy, zz = m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]
    x, y, z = m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]
    xy, xz, yz = m[..., 0, 1] + m[..., 1, 0], m[..., 0, 2] + m[..., 2, 0], m[..., 1, 2] + m[..., 2, 1]
    # Four times q q^T. Its row with the largest diagonal loses no digits, whatever the angle (Shepperd 1978).
    outer = np.stack(
        [
            np.stack([1 + xx + yy + zz, x, y, z], axis=-1),
            np.stack([x, 1 + xx - yy - zz, xy, xz], axis=-1),
            np.stack([y, xy, 1 - xx + yy - zz, yz], axis=-1),
            np.stack([z, xz, yz, 1 - xx - yy + zz], axis=-1),
        ],
        axis=-2,
    )
    best = np.argmax(np.diagonal(outer, axis1=-2, axis2=-1), axis=-1)
    row = np.take_along_axis(outer, best[..., np.newaxis, np.newaxis], axis=-2)[..., 0, :]
    unit = row / np.linalg.norm(row, axis=-1, keepdims=True)
    first = np.argmax(unit != 0, axis=-1)[..., np.newaxis]
    result: FloatArray = np.where(np.take_along_axis(unit, first, axis=-1) < 0, -unit, unit)
    return result


def from_rpy(rpy: npt.ArrayLike) -> FloatArray:
    """Pure rotations from roll, pitch and yaw about the fixed x, y and z axes, in that order.

    This is the `rpy` of a URDF `origin`: R = Rz(yaw) Ry(pitch) Rx(roll). rpy: f64[..., 3]. Returns f64[..., 4, 4].
    """
    angles = _vectors("rpy", rpy, 3)
    (sr, sp, sy), (cr, cp, cy) = np.moveaxis(np.sin(angles), -1, 0), np.moveaxis(np.cos(angles), -1, 0)
    rows = (
        (cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
        (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
        (-sp, cp * sr, cp * cr),
    )
    return _rotation(rows)


def to_rpy(transform: npt.ArrayLike) -> FloatArray:
    """Roll, pitch (-pi/2 to pi/2) and yaw of the rotations, f64[..., 3].

    With the pitch at a right angle only roll and yaw together are defined; the three still give the same rotation.
    """
    m = _matrices(transform)
    roll = np.arctan2(m[..., 2, 1], m[..., 2, 2])
    pitch = np.arctan2(-m[..., 2, 0], np.hypot(m[..., 2, 1], m[..., 2, 2]))
    # The yaw that remains once this roll is taken off, so that the two agree even where roll is only rounding.
    s, c = np.sin(roll), np.cos(roll)
    yaw = np.arctan2(s * m[..., 0, 2] - c * m[..., 0, 1], c * m[..., 1, 1] - s * m[..., 1, 2])
    return np.stack([roll, pitch, yaw], axis=-1)


def from_rotation_vector(vector: npt.ArrayLike) -> FloatArray:
    """Pure rotations by |vector| radians about its direction. vector: f64[..., 3]. Returns f64[..., 4, 4]."""
    given = _vectors("vector", vector, 3)
    angle = np.linalg.norm(given, axis=-1, keepdims=True)
    # np.sinc(x) is sin(pi x) / (pi x): no division by a small angle.
    return from_quaternion(np.concatenate([np.cos(angle / 2), 0.5 * np.sinc(angle / (2 * np.pi)) * given], axis=-1))


def to_rotation_vector(transform: npt.ArrayLike) -> FloatArray:
    """Rotation vectors f64[..., 3] of length 0 to pi."""
    quaternion = to_quaternion(transform)
    w, xyz = quaternion[..., :1], quaternion[..., 1:]
    sine = np.linalg.norm(xyz, axis=-1, keepdims=True)  # of half the angle
    per_sine: FloatArray = 2 * np.arctan2(sine, w) / np.where(sine == 0, 1, sine)
    return per_sine * xyz


def make_pose(position: npt.ArrayLike, quaternion: npt.ArrayLike) -> FloatArray:
    """Transforms f64[..., 4, 4] from positions f64[..., 3] (metres) and quaternions f64[..., 4] (w, x, y, z)."""
    where = _vectors("position", position, 3)
    rotation = from_quaternion(quaternion)
    transform = np.broadcast_to(rotation, (*np.broadcast_shapes(where.shape[:-1], rotation.shape[:-2]), 4, 4)).copy()
    transform[..., :3, 3] = where
    return transform


def inverse(transform: npt.ArrayLike) -> FloatArray:
    """The inverses of rigid transforms, f64[..., 4, 4]; exact in the rotation, which is only transposed."""
    m = _matrices(transform)
    result = np.zeros_like(m)
    result[..., :3, :3] = np.swapaxes(m[..., :3, :3], -1, -2)
    result[..., :3, 3] = -(result[..., :3, :3] @ m[..., :3, 3, np.newaxis])[..., 0]
    result[..., 3, 3] = 1
    return result


def apply(transform: npt.ArrayLike, points: npt.ArrayLike) -> FloatArray:
    """Points f64[..., n, 3] mapped by transforms f64[..., 4, 4]; the axes before n broadcast. One point: f64[3]."""
    m = _matrices(transform)
    turned = rotate(m, points)
    # The result of a single point has no axis n to be spread along.
    offset = m[..., :3, 3] if np.ndim(points) == 1 else m[..., np.newaxis, :3, 3]
    return turned + offset


def rotate(transform: npt.ArrayLike, vectors: npt.ArrayLike) -> FloatArray:
    """Directions f64[..., n, 3] turned by transforms f64[..., 4, 4], not moved. One vector: f64[3]."""
    m = _matrices(transform)
    return _vectors("points", vectors, 3) @ np.swapaxes(m[..., :3, :3], -1, -2)


def interpolate(start: npt.ArrayLike, end: npt.ArrayLike, fraction: npt.ArrayLike) -> FloatArray:
    """Transforms between two: linear in position, spherical linear in rotation (the shorter way round).

    start, end: f64[..., 4, 4]; fraction: f64[...], 0 gives `start` exactly. Returns f64[..., 4, 4].
    """
    a, b, share = _matrices(start), _matrices(end), np.asarray(fraction, dtype=np.float64)
    turn = to_rotation_vector(inverse(a) @ b)
    result = a @ from_rotation_vector(share[..., np.newaxis] * turn)
    result[..., :3, 3] = a[..., :3, 3] + share[..., np.newaxis] * (b[..., :3, 3] - a[..., :3, 3])
    return result


def check_rigid(transform: npt.ArrayLike, tolerance: float = RIGID_TOLERANCE) -> None:
    """Raise ValueError unless every transform is finite, right-handed, without scale or shear, with row 0 0 0 1.

    transform: f64[..., 4, 4]. tolerance: largest allowed entry of R^T R - 1.
    """
    m = _matrices(transform)
    if not np.isfinite(m).all():
        raise ValueError("transform: expected finite numbers, found a NaN or an infinity")
    if not (m[..., 3, :] == [0, 0, 0, 1]).all():
        raise ValueError("transform: expected the last row 0 0 0 1, found another; is it transposed?")
    r = m[..., :3, :3]
    error = np.abs(np.swapaxes(r, -1, -2) @ r - np.eye(3)).max(initial=0.0)
    if error > tolerance:
        raise ValueError(f"transform: expected R^T R = 1 within {tolerance:g}, found {error:.3g} off; scaled?")
    if (np.linalg.det(r) < 0).any():
        raise ValueError("transform: expected a right-handed rotation, found a mirrored one")


def _rotation(rows: tuple[tuple[FloatArray, FloatArray, FloatArray], ...]) -> FloatArray:
    result = np.zeros((*np.shape(rows[0][0]), 4, 4))
    for i, row in enumerate(rows):
        for j, entry in enumerate(row):
            result[..., i, j] = entry
    result[..., 3, 3] = 1
    return result


def _vectors(name: str, values: npt.ArrayLike, size: int) -> FloatArray:
    array = np.asarray(values, dtype=np.float64)
    if array.shape[-1:] != (size,):
        raise ValueError(f"{name}: expected {size} numbers in the last axis, found shape {array.shape}")
    return array


def _matrices(transform: npt.ArrayLike) -> FloatArray:
    array = np.asarray(transform, dtype=np.float64)
    if array.shape[-2:] != (4, 4):
        raise ValueError(f"transform: expected shape [..., 4, 4], found {array.shape}")
    return array


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Cross product over the last axis, f64[..., 3]; `np.cross` takes several times as long on short arrays."""
    result = np.empty(np.broadcast_shapes(a.shape, b.shape))
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        result[..., k] = a[..., i] * b[..., j] - a[..., j] * b[..., i]
    return result
