"""Rigid transforms as f64[..., 4, 4] arrays; leading axes are batch axes and broadcast.

The transform ``a_T_b`` is the pose of frame b in frame a and maps coordinates in b to coordinates in a:
``p_a = R p_b + t``. Transforms are composed with ``@``: ``a_T_c = a_T_b @ b_T_c``. Lengths are metres, angles radians,
quaternions (w, x, y, z).
"""

import numpy as np
import numpy.typing as npt

from taxel.types import FloatArray

__all__ = [
    "apply",
    "check_rigid",
    "from_quaternion",
    "from_rotation_vector",
    "interpolate",
    "inverse",
    "make_pose",
    "rotate",
    "to_quaternion",
    "to_rotation_vector",
    "to_rpy",
]

RIGID_TOLERANCE = 1e-9
"""Largest entry of R^T R - 1 of a rigid transform: far above rounding errors, far below the resolution of sensors."""


def from_quaternion(quaternion: npt.ArrayLike) -> FloatArray:
    """Convert quaternions to rotations, f64[..., 4, 4].

    quaternion: f64[..., 4] as (w, x, y, z), of any length above 0. Raises ValueError for another last axis, a zero
    quaternion or a value that is not finite.
    """
    values = _check_vectors("quaternion", quaternion, 4)
    length = np.linalg.norm(values, axis=-1, keepdims=True)
    if not (np.isfinite(length) & (length > 0)).all():
        raise ValueError("quaternion: expected a finite length above 0, found 0, NaN or infinity")
    w, x, y, z = np.moveaxis(values / length, -1, 0)
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    return _stack_rotation(rows)


def to_quaternion(transform: npt.ArrayLike) -> FloatArray:
    """Convert rotations to unit quaternions (w, x, y, z), f64[..., 4].

    The sign is chosen so that the first component that is not 0 is positive. transform: f64[..., 4, 4].
    """
    m = _check_matrices(transform)
    xx, yy, zz = m[..., 0, 0], m[..., 1, 1], m[..., 2, 2]
    x, y, z = m[..., 2, 1] - m[..., 1, 2], m[..., 0, 2] - m[..., 2, 0], m[..., 1, 0] - m[..., 0, 1]
    xy, xz, yz = m[..., 0, 1] + m[..., 1, 0], m[..., 0, 2] + m[..., 2, 0], m[..., 1, 2] + m[..., 2, 1]
    # Four times q q^T. The row with the largest diagonal entry is free of cancellation (Shepperd 1978).
    outer = np.stack(
        [
            np.stack([1 + xx + yy + zz, x, y, z], axis=-1),
            np.stack([x, 1 + xx - yy - zz, xy, xz], axis=-1),
            np.stack([y, xy, 1 - xx + yy - zz, yz], axis=-1),
            np.stack([z, xz, yz, 1 - xx - yy + zz], axis=-1),
        ],
        axis=-2,
    )
    largest = np.argmax(np.diagonal(outer, axis1=-2, axis2=-1), axis=-1)
    row = np.take_along_axis(outer, largest[..., np.newaxis, np.newaxis], axis=-2)[..., 0, :]
    unit = row / np.linalg.norm(row, axis=-1, keepdims=True)
    first = np.argmax(unit != 0, axis=-1)[..., np.newaxis]
    result: FloatArray = np.where(np.take_along_axis(unit, first, axis=-1) < 0, -unit, unit)
    return result


def to_rpy(transform: npt.ArrayLike) -> FloatArray:
    """Convert rotations to roll, pitch and yaw about the fixed x, y and z axes, f64[..., 3].

    This is the `rpy` of a URDF `origin`: R = Rz(yaw) Ry(pitch) Rx(roll), with the pitch from -pi/2 to pi/2. At a pitch
    of a right angle, roll and yaw are not unique; the returned angles still describe the rotation.
    """
    m = _check_matrices(transform)
    roll = np.arctan2(m[..., 2, 1], m[..., 2, 2])
    pitch = np.arctan2(-m[..., 2, 0], np.hypot(m[..., 2, 1], m[..., 2, 2]))
    # Yaw of the rotation after removal of this roll, so that both are consistent at gimbal lock.
    s, c = np.sin(roll), np.cos(roll)
    yaw = np.arctan2(s * m[..., 0, 2] - c * m[..., 0, 1], c * m[..., 1, 1] - s * m[..., 1, 2])
    return np.stack([roll, pitch, yaw], axis=-1)


def from_rotation_vector(vector: npt.ArrayLike) -> FloatArray:
    """Convert rotation vectors f64[..., 3] (axis times angle in radians) to rotations, f64[..., 4, 4]."""
    values = _check_vectors("vector", vector, 3)
    angle = np.linalg.norm(values, axis=-1, keepdims=True)
    # np.sinc(x) = sin(pi x) / (pi x) avoids a division by a small angle.
    return from_quaternion(np.concatenate([np.cos(angle / 2), 0.5 * np.sinc(angle / (2 * np.pi)) * values], axis=-1))


def to_rotation_vector(transform: npt.ArrayLike) -> FloatArray:
    """Convert the rotations of f64[..., 4, 4] to rotation vectors f64[..., 3] (axis times angle) of length 0 to pi."""
    quaternion = to_quaternion(transform)
    w, xyz = quaternion[..., :1], quaternion[..., 1:]
    sine = np.linalg.norm(xyz, axis=-1, keepdims=True)  # sine of half the angle
    scale: FloatArray = 2 * np.arctan2(sine, w) / np.where(sine == 0, 1, sine)
    return scale * xyz


def make_pose(position: npt.ArrayLike, quaternion: npt.ArrayLike) -> FloatArray:
    """Make transforms f64[..., 4, 4] from positions f64[..., 3] (metres) and quaternions f64[..., 4] (w, x, y, z)."""
    translation = _check_vectors("position", position, 3)
    rotation = from_quaternion(quaternion)
    transform = np.broadcast_to(
        rotation, (*np.broadcast_shapes(translation.shape[:-1], rotation.shape[:-2]), 4, 4)
    ).copy()
    transform[..., :3, 3] = translation
    return transform


def inverse(transform: npt.ArrayLike) -> FloatArray:
    """Invert rigid transforms f64[..., 4, 4]; the rotation is transposed, which causes no rounding error."""
    m = _check_matrices(transform)
    result = np.zeros_like(m)
    result[..., :3, :3] = np.swapaxes(m[..., :3, :3], -1, -2)
    result[..., :3, 3] = -(result[..., :3, :3] @ m[..., :3, 3, np.newaxis])[..., 0]
    result[..., 3, 3] = 1
    return result


def apply(transform: npt.ArrayLike, points: npt.ArrayLike) -> FloatArray:
    """Transform points f64[..., n, 3], or one point f64[3], by f64[..., 4, 4]; the axes before n broadcast."""
    m = _check_matrices(transform)
    rotated = rotate(m, points)
    # The result for a single point has no axis n.
    offset = m[..., :3, 3] if np.ndim(points) == 1 else m[..., np.newaxis, :3, 3]
    return rotated + offset


def rotate(transform: npt.ArrayLike, vectors: npt.ArrayLike) -> FloatArray:
    """Rotate directions f64[..., n, 3], or one direction f64[3], by the rotations of transforms f64[..., 4, 4]."""
    m = _check_matrices(transform)
    return _check_vectors("points", vectors, 3) @ np.swapaxes(m[..., :3, :3], -1, -2)


def interpolate(start: npt.ArrayLike, end: npt.ArrayLike, fraction: npt.ArrayLike) -> FloatArray:
    """Interpolate transforms: linear in position, spherical linear in rotation along the shorter arc.

    start, end: f64[..., 4, 4]; fraction: f64[...], 0 gives `start` exactly. Returns f64[..., 4, 4].
    """
    a, b, weight = _check_matrices(start), _check_matrices(end), np.asarray(fraction, dtype=np.float64)
    rotation = to_rotation_vector(inverse(a) @ b)
    result = a @ from_rotation_vector(weight[..., np.newaxis] * rotation)
    result[..., :3, 3] = a[..., :3, 3] + weight[..., np.newaxis] * (b[..., :3, 3] - a[..., :3, 3])
    return result


def check_rigid(transform: npt.ArrayLike, tolerance: float = RIGID_TOLERANCE) -> None:
    """Raise ValueError unless every transform is a rotation and a translation, with finite numbers.

    transform: f64[..., 4, 4], last row 0 0 0 1, right-handed, without scale or shear. tolerance: largest allowed
    absolute entry of R^T R - I, where R is the rotation part.
    """
    m = _check_matrices(transform)
    if not np.isfinite(m).all():
        raise ValueError("transform: expected finite numbers, found NaN or infinity")
    if not (m[..., 3, :] == [0, 0, 0, 1]).all():
        raise ValueError("transform: expected the last row 0 0 0 1, found another row; check for a transposed matrix")
    r = m[..., :3, :3]
    error = np.abs(np.swapaxes(r, -1, -2) @ r - np.eye(3)).max(initial=0.0)
    if error > tolerance:
        raise ValueError(
            f"transform: expected R^T R = 1 within {tolerance:g}, found a difference of {error:.3g}; remove scale and "
            "shear"
        )
    if (np.linalg.det(r) < 0).any():
        raise ValueError("transform: expected a right-handed rotation, found a reflection; check the axes")


def _stack_rotation(rows: tuple[tuple[FloatArray, FloatArray, FloatArray], ...]) -> FloatArray:
    """Build transforms f64[..., 4, 4] without translation from 3 x 3 rotation entries, each an array f64[...]."""
    result = np.zeros((*np.shape(rows[0][0]), 4, 4))
    for i, row in enumerate(rows):
        for j, entry in enumerate(row):
            result[..., i, j] = entry
    result[..., 3, 3] = 1
    return result


def _check_vectors(name: str, values: npt.ArrayLike, size: int) -> FloatArray:
    """Return `values` as f64[..., size]. Raises ValueError for another last axis; name: the argument in the message."""
    array = np.asarray(values, dtype=np.float64)
    if array.shape[-1:] != (size,):
        raise ValueError(f"{name}: expected {size} numbers in the last axis, found shape {array.shape}")
    return array


def _check_matrices(transform: npt.ArrayLike) -> FloatArray:
    """Return `transform` as f64[..., 4, 4]. Raises ValueError for another shape."""
    array = np.asarray(transform, dtype=np.float64)
    if array.shape[-2:] != (4, 4):
        raise ValueError(f"transform: expected shape [..., 4, 4], found {array.shape}")
    return array


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Compute the cross product over the last axis, f64[..., 3]; much faster than `np.cross` on short arrays."""
    result = np.empty(np.broadcast_shapes(a.shape, b.shape))
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        result[..., k] = a[..., i] * b[..., j] - a[..., j] * b[..., i]
    return result
