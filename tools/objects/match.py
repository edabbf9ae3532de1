"""Rigid matching of clouds to a prism's surface, many clouds and many starts at once.

It ends where ICP (closest point and rigid fit, all points) ends: at a minimum of the sum of squared distances to
the surface. The steps are those of Levenberg and Marquardt on the distances, which need some ten times fewer.
"""

import numpy as np
from surfaces import Prism

from taxel.types import FloatArray

STEPS = 60
FIRST_STEPS = 8
KEPT = 2
"""Starts of a cloud that go on after FIRST_STEPS."""
STILL = 1e-5
"""Part of the sum of squares; a step that gains less is the last."""
LEAST_DAMPING = 1e-6
MOST_DAMPING = 1e3
TURNS_DEG = (0.0, 30.0, 90.0, 180.0)
"""Turns about the upright axis that a match starts from."""


def starts_of(cloud: FloatArray, cloud_height: float, height: float) -> FloatArray:
    """Starting positions, f64[s, n, 3], mm, of a cloud, f64[n, 3]: each turn with equal tops and equal mid heights."""
    angles = np.radians(TURNS_DEG)
    cos, sin = np.cos(angles), np.sin(angles)
    turned = np.empty((len(angles), *cloud.shape))
    turned[..., 0] = cos[:, None] * cloud[:, 0] - sin[:, None] * cloud[:, 1]
    turned[..., 1] = sin[:, None] * cloud[:, 0] + cos[:, None] * cloud[:, 1]
    turned[..., 2] = cloud[:, 2]
    to_top = np.array([0.0, 0.0, height - cloud_height])
    return np.concatenate([turned + to_top, turned + to_top / 2])


def settle(points: FloatArray, prism: Prism, steps: int = STEPS) -> tuple[FloatArray, FloatArray]:
    """Move k clouds, f64[k, n, 3], mm, each rigidly towards a minimum. Returns the moved clouds and their
    distances to the surface, f64[k, n], mm. A cloud rests when a step gains less than STILL of its sum of squares.
    """
    points = points.copy()
    damping = np.full(len(points), 1e-3)
    away = points - prism.nearest(points)
    cost = np.sum(away**2, axis=(1, 2))
    active = np.arange(len(points))
    for _ in range(steps):
        moved = _moved(points[active], away[active], damping[active])
        moved_away = moved - prism.nearest(moved)
        moved_cost = np.sum(moved_away**2, axis=(1, 2))
        before = cost[active]
        better = moved_cost < before
        taken = active[better]
        points[taken], away[taken], cost[taken] = moved[better], moved_away[better], moved_cost[better]
        damping[active] = np.maximum(damping[active] * np.where(better, 0.2, 8.0), LEAST_DAMPING)
        still = np.where(better, before - moved_cost < STILL * before, damping[active] > MOST_DAMPING)
        active = active[~still]
        if not active.size:
            break
    return points, np.asarray(np.sqrt(np.sum(away**2, axis=2)))


def match(starts: list[FloatArray], prism: Prism) -> list[FloatArray]:
    """Distances, f64[n], mm, of each cloud at its best match. starts: of each cloud, f64[s, n, 3], mm.

    All starts take FIRST_STEPS; only the KEPT best of each cloud go on to rest.
    """
    counts = np.cumsum([len(block) for block in starts])[:-1]
    points, away = settle(np.concatenate(starts), prism, FIRST_STEPS)
    kept = [
        block[np.argsort(np.sum(far**2, axis=1))[:KEPT]]
        for block, far in zip(np.split(points, counts), np.split(away, counts), strict=True)
    ]
    _, settled = settle(np.concatenate(kept), prism)
    blocks = np.split(settled, np.cumsum([len(block) for block in kept])[:-1])
    return [block[np.argmin(np.sum(block**2, axis=1))] for block in blocks]


def _moved(points: FloatArray, away: FloatArray, damping: FloatArray) -> FloatArray:
    """The clouds after one damped step, a turn about each centroid and a shift."""
    centre = points.mean(axis=1, keepdims=True)
    arms = points - centre
    distance = np.sqrt(np.sum(away**2, axis=2))
    normal = away / np.maximum(distance, 1e-9)[..., None]
    scale = np.sqrt(np.mean(arms**2, axis=(1, 2)))[:, None, None]
    slopes = np.concatenate([normal, np.cross(arms, normal) / scale], axis=2)
    transposed = slopes.transpose(0, 2, 1)
    normal_matrix = transposed @ slopes + damping[:, None, None] * points.shape[1] * np.eye(6)
    step = -np.linalg.solve(normal_matrix, transposed @ distance[..., None])[..., 0]
    turn = _rotation(step[:, 3:] / scale[:, :, 0])
    return np.asarray(arms @ turn.transpose(0, 2, 1) + centre + step[:, None, :3])


def _rotation(vector: FloatArray) -> FloatArray:
    """Rotation matrices, f64[k, 3, 3], of rotation vectors, f64[k, 3], rad (Rodrigues)."""
    angle = np.maximum(np.linalg.norm(vector, axis=1), 1e-12)[:, None, None]
    x, y, z = (vector / angle[:, :, 0]).T
    zero = np.zeros_like(x)
    skew = np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]).transpose(2, 0, 1)
    return np.asarray(np.eye(3) + np.sin(angle) * skew + (1 - np.cos(angle)) * (skew @ skew))
