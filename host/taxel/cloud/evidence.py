"""How well a shape explains which taxels felt it and which did not, whatever lay a little otherwise than believed.

The thesis registers "the coordinates of both the active and inactive taxels" (5.4). Here a taxel whose electrode lies
at the signed distance d from the shape is active with the probability

    p(d) = STRAY + (1 - 2 STRAY) / (1 + exp((d - reach) / blur)).

reach: how far the shape is felt, which is the layer's thickness and what contact propagation adds; blur: over what
distance that ends. Nobody knows either of a skin for sure, nor where in the hand an object lay at each grasp, by some
millimetres. So both are integrated over. The evidence of a shape is the marginal likelihood (MacKay 2003, ch. 28)

    ln mean over (reach, blur) of product over grasps of mean over poses of product over taxels of p or 1 - p,

with poses about the place that the dataset states (`pose_average`). A small object that would have to be felt from far
away, and a large one that would have to have slipped aside in every grasp, both lose. Taxels are taken as independent,
which they are not: the sign of a difference can be trusted further than its size.
"""

from __future__ import annotations

from functools import cache, partial
from typing import Final
from weakref import WeakKeyDictionary

import numpy as np
from scipy.spatial.transform import Rotation
from scipy.special import expit

from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.distance_grid import BIN_M, BINS, HIGH_M, LOW_M, DistanceGrid
from taxel.cloud.mesh import TriangleMesh
from taxel.cloud.pose_average import ARM_M, ASIDE_M, average_over_poses, log_sum
from taxel.types import Float32Array, FloatArray

REACH_M: Final = tuple(0.001 + 0.00075 * step for step in range(9))
"""1 to 7 mm: a thin layer that is touched lightly, a thick one that contact spreads in."""

BLUR_M: Final = (0.0003, 0.0006, 0.001, 0.0016)

STRAY: Final = 0.01
"""Share of taxels that tell the contrary: noise, broken lines, coupling."""

DEEP_M: Final = 0.002
"""An active taxel cannot lie in the solid: being deeper in it than this counts against the shape, by half the square of
the excess over this."""


class Explainer:
    """A shape against which the grasps of clouds are held."""

    def __init__(self, mesh: TriangleMesh) -> None:
        self._grid = DistanceGrid.of(mesh)
        self._bounds = mesh.bounds
        self._middle = mesh.bounds.mean(axis=0)

    def by_grasp(self, cloud: ContactCloud) -> FloatArray:
        """The likelihood of each grasp, averaged over poses, as natural logarithm: f64[G, K], for K pairs of reach and
        blur. A grasp that touched nothing tells nothing: 0.

        The cloud is in the frame of the shape, to within what an object may lie aside.
        """
        result = np.zeros((len(cloud.grasps), len(REACH_M) * len(BLUR_M)))
        far = HIGH_M + 3.0 * max(ASIDE_M)  # taxels farther away are silent in every pose
        for row in np.unique(cloud.grasp):
            felt, quiet = cloud.points[cloud.grasp == row], cloud.quiet[cloud.quiet_grasp == row]
            near = ((quiet > self._bounds[0] - far) & (quiet < self._bounds[1] + far)).all(axis=1)
            places = (np.concatenate([felt, quiet[near]]) - self._middle).astype(np.float32)
            result[row] = average_over_poses(partial(self._told, places, len(felt)), int(row))
        return result

    def _told(self, places: Float32Array, felt: int, poses: FloatArray) -> FloatArray:
        """Logarithm of the likelihood of places f32[n, 3] about the middle, the first `felt` of them active, in poses
        f64[P, 6]: f64[P, K].
        """
        turns = Rotation.from_rotvec(poses[:, 3:] / ARM_M).as_matrix()
        counted = self._grid.counted(places, felt, turns, poses[:, :3] + self._middle)
        return np.asarray(counted.astype(np.float64) @ _table())


_KNOWN: WeakKeyDictionary[TriangleMesh, Explainer] = WeakKeyDictionary()
"""Grids are some megabytes and half a second each, and wanted again while their mesh is."""


def explainer(mesh: TriangleMesh) -> Explainer:
    """That of a mesh, made once."""
    if mesh not in _KNOWN:
        _KNOWN[mesh] = Explainer(mesh)
    return _KNOWN[mesh]


def evidence(by_grasp: FloatArray, times: FloatArray | None = None) -> FloatArray:
    """Ln marginal likelihood of grasps f64[G, K], each counted `times` f64[D, G] times: f64[D]; None: once, f64[1]."""
    together = np.atleast_2d(by_grasp.sum(axis=0) if times is None else times @ by_grasp)
    return np.asarray(log_sum(together, axis=1) - np.log(by_grasp.shape[1]))


@cache
def _table() -> FloatArray:
    """Ln likelihood of an active taxel in each bin of distance, then of a silent one, f64[2 BINS, K].

    A silent taxel far away counts 0, so that it does not matter how many of them there are.
    """
    middle = LOW_M + BIN_M * (np.arange(BINS) + 0.5)
    reach, blur = (each.ravel() for each in np.meshgrid(REACH_M, BLUR_M, indexing="ij"))
    active = STRAY + (1.0 - 2.0 * STRAY) * expit((reach - middle[:, None]) / blur)
    deep = np.maximum(-middle - DEEP_M, 0.0) / DEEP_M
    return np.concatenate([np.log(active) - 0.5 * deep[:, None] ** 2, np.log((1.0 - active) / (1.0 - STRAY))])
