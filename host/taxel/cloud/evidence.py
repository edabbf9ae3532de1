"""Marginal likelihood of a shape, given the active and inactive taxels of grasps with uncertain object poses.

The thesis registers "the coordinates of both the active and inactive taxels" (5.4). Here a taxel whose electrode lies
at the signed distance d from the shape is active with the probability

    p(d) = STRAY + (1 - 2 STRAY) / (1 + exp((d - reach) / blur)).

reach is the distance up to which contact activates a taxel (thickness of the layer plus contact propagation), and blur
is the width of the transition. Neither is known for a skin, and the pose of the object in a grasp is known only within
a few millimetres. The likelihood is therefore averaged over reach, blur and pose. The evidence of a shape is the
marginal likelihood (MacKay 2003, chapter 28)

    ln mean over (reach, blur) of product over grasps of mean over poses of product over taxels of p or 1 - p,

with poses around the pose that the dataset states (`pose_average`). A model that is too small has a low evidence
because it explains the contacts only with a long reach; a model that is too large, because it explains them only with a
displaced object in every grasp. Taxels are treated as independent, although they are not: the sign of a difference of
evidence is more reliable than its size.
"""

from functools import cache, partial
from typing import Final
from weakref import WeakKeyDictionary

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.special import expit

from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.distance_grid import BIN_COUNT, BIN_WIDTH_M, MAX_DISTANCE_M, MIN_DISTANCE_M, DistanceGrid
from taxel.cloud.mesh import TriangleMesh
from taxel.cloud.pose_average import POSE_STD_M, TURN_ARM_M, average_over_poses, log_sum_exp
from taxel.types import Float32Array, FloatArray

REACH_M: Final = tuple(0.001 + 0.00075 * step for step in range(9))
"""Values of reach (the distance from the shape up to which taxels are active) over which the likelihood is averaged, 1
to 7 mm: from a thin layer in light contact to a thick layer in which contact propagates."""

BLUR_M: Final = (0.0003, 0.0006, 0.001, 0.0016)
"""Values of blur (the width of the transition at this distance) over which the likelihood is averaged."""

STRAY: Final = 0.01
"""Probability that a taxel is active far from the shape or inactive on the shape: noise, broken lines, coupling."""

FREE_DEPTH_M: Final = 0.002
"""Depth of an active taxel inside the shape without a penalty. Beyond this depth, ln p decreases by half the square of
(depth - FREE_DEPTH_M) / FREE_DEPTH_M, since an active taxel cannot lie inside a rigid object."""


class ShapeLikelihood:
    """Likelihood of the active and inactive taxels of grasps for one shape, averaged over object poses."""

    def __init__(self, mesh: TriangleMesh) -> None:
        """Create the likelihood of contact points for one shape; computes a grid of distances to its surface."""
        self._grid = DistanceGrid.from_mesh(mesh)
        self._bounds = mesh.bounds
        self._centre = mesh.bounds.mean(axis=0)

    def compute_by_grasp(self, cloud: ContactCloud) -> FloatArray:
        """Compute the log likelihood of the contacts of each grasp for the shape, averaged over poses, f64[G, K].

        G: grasps. K: pairs of the parameters reach (distance from the shape up to which taxels are active) and blur
        (width of the transition). The row of a grasp without an active taxel is 0. The cloud is in the frame of the
        shape, up to the uncertainty of the object pose.
        """
        result = np.zeros((len(cloud.grasps), len(REACH_M) * len(BLUR_M)))
        margin = MAX_DISTANCE_M + 3.0 * max(POSE_STD_M)  # taxels farther away are inactive in every pose
        for row in np.unique(cloud.grasp):
            active = cloud.points[cloud.grasp == row]
            inactive = cloud.inactive_points[cloud.inactive_grasp == row]
            is_near = ((inactive > self._bounds[0] - margin) & (inactive < self._bounds[1] + margin)).all(axis=1)
            points = (np.concatenate([active, inactive[is_near]]) - self._centre).astype(np.float32)
            result[row] = average_over_poses(partial(self._log_likelihood, points, len(active)), int(row))
        return result

    def _log_likelihood(self, points: Float32Array, active_count: int, poses: FloatArray) -> FloatArray:
        """Compute the log likelihood of the points of one grasp for P poses f64[P, 6]: f64[P, K].

        poses: shift in metres, then rotation vector times a lever arm in metres. points: f32[n, 3], relative to the
        centre of the shape; the first `active_count` of them are active. K is the number of pairs of the model
        parameters reach and blur.
        """
        rotations = Rotation.from_rotvec(poses[:, 3:] / TURN_ARM_M).as_matrix()
        counts = self._grid.count_points(points, active_count, rotations, poses[:, :3] + self._centre)
        return np.asarray(counts.astype(np.float64) @ _log_likelihood_table())


_LIKELIHOODS: WeakKeyDictionary[TriangleMesh, ShapeLikelihood] = WeakKeyDictionary()
"""A grid takes half a second and some megabytes, so it is kept as long as its mesh."""


def get_shape_likelihood(mesh: TriangleMesh) -> ShapeLikelihood:
    """Return the `ShapeLikelihood` (probability of contacts given the shape) of a mesh; computed at the first call."""
    if mesh not in _LIKELIHOODS:
        _LIKELIHOODS[mesh] = ShapeLikelihood(mesh)
    return _LIKELIHOODS[mesh]


def compute_evidence(by_grasp: FloatArray, times: FloatArray | None = None) -> FloatArray:
    """Compute the natural logarithm of the marginal likelihood (evidence) of grasps, f64[D].

    by_grasp: log likelihoods f64[G, K] from `ShapeLikelihood.compute_by_grasp`. times: f64[D, G], number of times that
    each of D bootstrap samples contains each grasp; None: one sample that contains each grasp once.
    """
    summed = np.atleast_2d(by_grasp.sum(axis=0) if times is None else times @ by_grasp)
    return np.asarray(log_sum_exp(summed, axis=1) - np.log(by_grasp.shape[1]))


@cache
def _log_likelihood_table() -> FloatArray:
    """Compute the log likelihood of an active and of an inactive taxel by distance bin, f64[2 BIN_COUNT, K].

    The rows of active taxels come first; K is the number of pairs of the parameters reach and blur. The probability of
    an active taxel falls from 1 to 0 around the distance `reach`, over the width `blur`; a small share of taxels is
    active or inactive regardless of distance. An active taxel deep inside the shape has a lower likelihood. An inactive
    taxel far away has the value 0, so that the number of such taxels does not matter.
    """
    centre = MIN_DISTANCE_M + BIN_WIDTH_M * (np.arange(BIN_COUNT) + 0.5)
    reach, blur = (values.ravel() for values in np.meshgrid(REACH_M, BLUR_M, indexing="ij"))
    active = STRAY + (1.0 - 2.0 * STRAY) * expit((reach - centre[:, None]) / blur)
    excess = np.maximum(-centre - FREE_DEPTH_M, 0.0) / FREE_DEPTH_M
    return np.concatenate([np.log(active) - 0.5 * excess[:, None] ** 2, np.log((1.0 - active) / (1.0 - STRAY))])
