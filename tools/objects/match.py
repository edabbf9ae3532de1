"""Rigid registration of clouds to the surface of a prism, for many clouds and many starts at the same time.

The result is a minimum of the sum of squared distances to the surface, as of ICP (closest point and rigid fit of all
points). The steps are Levenberg-Marquardt steps on the distances, of which about ten times fewer are needed.
"""

import numpy as np
from surfaces import Prism

from taxel.types import FloatArray

STEPS = 60
FIRST_STEPS = 8
CONTINUED_STARTS = 2
"""Number of starts of each cloud that continue after FIRST_STEPS."""
SMALLEST_GAIN = 1e-5
"""Relative decrease of the sum of squares below which a step is the last one."""
MIN_DAMPING = 1e-6
MAX_DAMPING = 1e3
START_ANGLES_DEG = (0.0, 30.0, 90.0, 180.0)
"""Rotations about the vertical axis at which a registration starts."""


def build_starting_clouds(cloud: FloatArray, cloud_height: float, height: float) -> FloatArray:
    """Return the s starting positions f64[s, n, 3] of the registration of a cloud f64[n, 3] to an object, mm.

    The cloud is rotated about the vertical axis by each of START_ANGLES_DEG. Each rotation occurs twice: with the tops
    of the cloud and the object at the same height, and with their middles at the same height. cloud_height: height of
    the object to which the cloud belongs. height: height of the object to which it is registered.
    """
    angles = np.radians(START_ANGLES_DEG)
    cos, sin = np.cos(angles), np.sin(angles)
    rotated = np.empty((len(angles), *cloud.shape))
    rotated[..., 0] = cos[:, None] * cloud[:, 0] - sin[:, None] * cloud[:, 1]
    rotated[..., 1] = sin[:, None] * cloud[:, 0] + cos[:, None] * cloud[:, 1]
    rotated[..., 2] = cloud[:, 2]
    to_top = np.array([0.0, 0.0, height - cloud_height])
    return np.concatenate([rotated + to_top, rotated + to_top / 2])


def minimise_distances(points: FloatArray, prism: Prism, steps: int = STEPS) -> tuple[FloatArray, FloatArray]:
    """Move k clouds f64[k, n, 3], mm, each rigidly to a minimum of the sum of its squared distances to the surface.

    Returns the clouds and their distances f64[k, n], mm. A cloud is finished when a step decreases its sum of squares
    by less than SMALLEST_GAIN. The method is that of Levenberg and Marquardt: the damping is lowered after a step that
    decreases the sum, and raised after one that does not, which is discarded.
    """
    points = points.copy()
    damping = np.full(len(points), 1e-3)
    offset = points - prism.nearest(points)
    cost = np.sum(offset**2, axis=(1, 2))
    unfinished = np.arange(len(points))
    for _ in range(steps):
        moved = _take_step(points[unfinished], offset[unfinished], damping[unfinished])
        moved_offset = moved - prism.nearest(moved)
        moved_cost = np.sum(moved_offset**2, axis=(1, 2))
        previous = cost[unfinished]
        is_better = moved_cost < previous
        improved = unfinished[is_better]
        points[improved], offset[improved] = moved[is_better], moved_offset[is_better]
        cost[improved] = moved_cost[is_better]
        damping[unfinished] = np.maximum(damping[unfinished] * np.where(is_better, 0.2, 8.0), MIN_DAMPING)
        is_converged = previous - moved_cost < SMALLEST_GAIN * previous
        is_finished = np.where(is_better, is_converged, damping[unfinished] > MAX_DAMPING)
        unfinished = unfinished[~is_finished]
        if not unfinished.size:
            break
    return points, np.asarray(np.sqrt(np.sum(offset**2, axis=2)))


def match_clouds(starts: list[FloatArray], prism: Prism) -> list[FloatArray]:
    """Return the distances f64[n], mm, of each cloud to the surface after its best registration.

    starts: starting positions f64[s, n, 3] of each cloud, mm. All starts take FIRST_STEPS; only the best
    CONTINUED_STARTS of each cloud continue to a minimum.
    """
    counts = np.cumsum([len(block) for block in starts])[:-1]
    points, offsets = minimise_distances(np.concatenate(starts), prism, FIRST_STEPS)
    continued = [
        block[np.argsort(np.sum(distances**2, axis=1))[:CONTINUED_STARTS]]
        for block, distances in zip(np.split(points, counts), np.split(offsets, counts), strict=True)
    ]
    _, final = minimise_distances(np.concatenate(continued), prism)
    blocks = np.split(final, np.cumsum([len(block) for block in continued])[:-1])
    return [block[np.argmin(np.sum(block**2, axis=1))] for block in blocks]


def _take_step(points: FloatArray, offset: FloatArray, damping: FloatArray) -> FloatArray:
    """Move each cloud by one damped Gauss-Newton step towards a surface: a rotation about its centroid and a
    translation.

    points: f64[k, n, 3]. offset: from the nearest surface point to each point, f64[k, n, 3]. damping: f64[k], larger
    for smaller steps.
    """
    centre = points.mean(axis=1, keepdims=True)
    arms = points - centre
    distance = np.sqrt(np.sum(offset**2, axis=2))
    normal = offset / np.maximum(distance, 1e-9)[..., None]
    # Rotations are scaled by the size of the cloud, so that all six unknowns are lengths of similar magnitude.
    scale = np.sqrt(np.mean(arms**2, axis=(1, 2)))[:, None, None]
    slopes = np.concatenate([normal, np.cross(arms, normal) / scale], axis=2)
    transposed = slopes.transpose(0, 2, 1)
    normal_matrix = transposed @ slopes + damping[:, None, None] * points.shape[1] * np.eye(6)
    step = -np.linalg.solve(normal_matrix, transposed @ distance[..., None])[..., 0]
    rotation = _build_rotation_matrices(step[:, 3:] / scale[:, :, 0])
    return np.asarray(arms @ rotation.transpose(0, 2, 1) + centre + step[:, None, :3])


def _build_rotation_matrices(vector: FloatArray) -> FloatArray:
    """Return the rotation matrices f64[k, 3, 3] of rotation vectors f64[k, 3] in radians (Rodrigues' formula)."""
    angle = np.maximum(np.linalg.norm(vector, axis=1), 1e-12)[:, None, None]
    x, y, z = (vector / angle[:, :, 0]).T
    zero = np.zeros_like(x)
    skew = np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]).transpose(2, 0, 1)
    return np.asarray(np.eye(3) + np.sin(angle) * skew + (1 - np.cos(angle)) * (skew @ skew))
