"""Poses of boards relative to a simulated object, estimated from the simulated separations.

A grasp dataset states nominal poses. In a simulation the object moves while the hand closes, often by millimetres, and
the surface of the layer may lie above the stated positions of the taxels. The separations that the simulator states
for its taxels determine the actual poses much more precisely.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.hand.transforms import from_rotation_vector
from taxel.types import FloatArray

PRIOR_STD: Final = np.array([5e-3] * 3 + [np.radians(5.0)] * 3 + [3e-3])
"""Prior standard deviation of the seven unknowns: translation in metres, rotation vector in radians, offset of the
surface in metres. Chosen: it determines only the unknowns that the separations leave free, such as a translation along
a plane face."""

SEPARATION_STD_M: Final = 1e-4
"""Standard deviation of a stated separation, metres. Chosen: the mean over hold of a position that moves slightly."""

DEGREES_OF_FREEDOM: Final = 4.0
"""Degrees of freedom of the Student-t distribution of the deviations. Chosen, as in robust regression (Lange et al.
1989): a ray beside an edge may hit another face than in the simulation."""

NEAR_SURFACE_M: Final = 2e-3
"""Separation in metres at which a taxel has half the weight of a loaded taxel (chosen): a contact depends on the shape
of the object near its loaded taxels."""

MISSED_DEVIATION_M: Final = 3e-3
"""Deviation in metres that is assumed for a ray which misses the object although the simulator states a separation
(chosen)."""

ITERATIONS: Final = 8
"""Iterations of the Levenberg-Marquardt method. Chosen: the costs change little afterwards."""

STEPS: Final = np.array([1e-5] * 3 + [1e-3] * 3)
"""Steps of the numerical derivatives: metres, radians."""

MAX_SLOPE: Final = np.array([50.0] * 3 + [1.0] * 3)
"""Largest derivative of a depth by a translation, and by a rotation in metres per radian. A larger difference is a jump
of the ray to another face."""

DepthFunction = Callable[[FloatArray], FloatArray]
"""Function that returns the depths of all centres of taxels, f64[M], metres, NaN where a ray misses the object, for
poses f64[N, 4, 4] of N boards."""


@dataclass(frozen=True, eq=False)
class SurfaceSamples:
    """Stated separations of M centres of taxels on N boards.

    board: [M], sorted, index of the board. depth: f64[M], metres, stated depth below the surface of the object. centre:
    f64[N, 3], mean position of the taxels of each board in the bracket frame, metres.
    """

    board: NDArray[np.intp]
    depth: FloatArray
    centre: FloatArray


def estimate_poses(
    nominal: FloatArray, grasp: NDArray[np.intp], samples: SurfaceSamples, compute_depths: DepthFunction
) -> FloatArray:
    """Return the estimated poses of N boards in the object frame, f64[N, 4, 4].

    nominal: f64[N, 4, 4], stated poses. grasp: [N], sorted, index of the simulated grasp of each board. A common motion
    of all boards of a grasp is estimated first, then a motion of each board. The estimate maximises the posterior
    density with normal priors (`PRIOR_STD`) and Student-t deviations (`DEGREES_OF_FREEDOM`) of the computed depths from
    the stated ones.
    """
    if not len(samples.board):
        return nominal
    poses = _fit_motions(nominal, grasp, samples, compute_depths)
    return _fit_motions(poses, np.arange(len(nominal)), samples, compute_depths)


def _fit_motions(
    start: FloatArray, group: NDArray[np.intp], samples: SurfaceSamples, compute_depths: DepthFunction
) -> FloatArray:
    """Return the poses f64[N, 4, 4] of N boards after one motion for each group of boards.

    start: poses before the motion, f64[N, 4, 4]. group: [N], sorted, index of the group of each board; every index from
    0 to the largest occurs.

    Each group has seven unknowns: translation in metres, rotation vector in radians, and offset of the surface in
    metres. The Levenberg-Marquardt method solves for them with numerical derivatives of the depths.
    """
    count = int(group[-1]) + 1
    members = np.bincount(group)[:, None]
    centres = np.einsum("nij,nj->ni", start[:, :3, :3], samples.centre) + start[:, :3, 3]
    pivot = np.stack([np.bincount(group, axis, count) for axis in centres.T], axis=1) / members
    sample_group = group[samples.board]
    first = np.searchsorted(sample_group, np.arange(count))
    has_samples = np.bincount(sample_group, minlength=count) > 0
    base_weight = 1.0 / (1.0 + (samples.depth / NEAR_SURFACE_M) ** 2)

    def sum_groups(values: FloatArray) -> FloatArray:
        """Return the sums f64[count, ...] over the samples of each group of values f64[M, ...]."""
        padded = np.concatenate([values, np.zeros((1, *values.shape[1:]))])
        return np.where(has_samples.reshape(-1, *[1] * (values.ndim - 1)), np.add.reduceat(padded, first, axis=0), 0.0)

    def move(unknowns: FloatArray) -> FloatArray:
        """Return the poses f64[N, 4, 4] for unknowns f64[count, 7] (translation in metres, rotation vector in radians,
        offset of the surface, which moves nothing); each group rotates about its pivot.
        """
        motion = from_rotation_vector(unknowns[:, 3:6])
        motion[:, :3, 3] = pivot + unknowns[:, :3] - np.einsum("gij,gj->gi", motion[:, :3, :3], pivot)
        return np.asarray(motion[group] @ start)

    def compute_cost(deviation: FloatArray, unknowns: FloatArray) -> FloatArray:
        """Return the negative log posterior density of each group, f64[count], up to a constant.

        deviation: f64[M], stated minus computed depth of each sample, metres; NaN for a ray that misses the object.
        unknowns: f64[count, 7], motion of each group and offset of its surface.
        """
        known = np.nan_to_num(deviation, nan=MISSED_DEVIATION_M)
        loss = 0.5 * (DEGREES_OF_FREEDOM + 1.0) * np.log1p((known / SEPARATION_STD_M) ** 2 / DEGREES_OF_FREEDOM)
        prior = 0.5 * ((unknowns / PRIOR_STD) ** 2).sum(axis=1)
        return np.asarray(sum_groups(base_weight * loss) + prior)

    unknowns = np.zeros((count, 7))
    damping = np.full(count, 1e-3)
    depth = compute_depths(start)
    deviation = samples.depth - depth
    cost = compute_cost(deviation, unknowns)
    for _ in range(ITERATIONS):
        slopes = np.ones((len(depth), 7))
        for column, step in enumerate(STEPS):
            changed = unknowns.copy()
            changed[:, column] += step
            slope = (compute_depths(move(changed)) - depth) / step
            slopes[:, column] = np.where(np.abs(slope) < MAX_SLOPE[column], slope, 0.0)
        known = np.nan_to_num(deviation)
        weight = base_weight * (DEGREES_OF_FREEDOM + 1.0) / (DEGREES_OF_FREEDOM * SEPARATION_STD_M**2 + known**2)
        weight = np.where(np.isnan(deviation), 0.0, weight)
        matrix = sum_groups(weight[:, None, None] * slopes[:, :, None] * slopes[:, None, :])
        matrix += np.diag(PRIOR_STD**-2.0)
        gradient = sum_groups((weight * known)[:, None] * slopes) - unknowns / PRIOR_STD**2
        damped = matrix * (1.0 + damping[:, None, None] * np.eye(7))
        proposed = unknowns + np.linalg.solve(damped, gradient[:, :, None])[:, :, 0]
        proposed_depth = compute_depths(move(proposed))
        proposed_deviation = samples.depth - proposed_depth - proposed[sample_group, 6]
        proposed_cost = compute_cost(proposed_deviation, proposed)
        is_better = proposed_cost < cost
        is_better_sample = is_better[sample_group]
        unknowns = np.where(is_better[:, None], proposed, unknowns)
        depth = np.where(is_better_sample, proposed_depth, depth)
        deviation = np.where(is_better_sample, proposed_deviation, deviation)
        cost, damping = np.where(is_better, proposed_cost, cost), np.where(is_better, 0.3 * damping, 10.0 * damping)
    return move(unknowns)
