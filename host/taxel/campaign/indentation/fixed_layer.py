"""The simulator's elastic layer on fixed boards, for one object at a time.

The springs are those of `taxel.sim.soft_contact`, each along the normal of its square with the same force law. Because
the boards do not move, the lines of the springs are computed once, and many springs per taxel are affordable.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel.grasp.shapes import Shape
from taxel.hand import Hand
from taxel.hand.sheet import build_sheet
from taxel.sim.soft_contact import MAX_DEPTH_M, LayerLaw
from taxel.types import FloatArray

SPRINGS_PER_SIDE = 5
"""Springs along each side of a taxel. Under rounded edges the counts differ by 4 RMS from those with 9 springs; with 3
springs they differ by 12."""

NEAR_M = 0.004
"""Springs farther than this from the surface of the unloaded object at first contact are ignored."""


class FixedSprings(NamedTuple):
    """m springs of the elastic layer on fixed boards, world frame.

    point: f64[m, 3], foot of the spring at the level of the electrodes. normal: f64[m, 3], direction of the spring.
    moment: f64[m, 3], moment of a unit force along the normal about the world's origin. area_share: f64[m], area of the
    spring as a fraction of the area for which the force law holds. taxel: intp[m], index of the taxel over which the
    spring stands; at least the number of taxels for springs on the bare margin of a board.
    """

    point: FloatArray
    normal: FloatArray
    moment: FloatArray
    area_share: FloatArray
    taxel: NDArray[np.intp]

    def select(self, mask: NDArray[np.bool_]) -> FixedSprings:
        """Return the springs for which the mask bool[m] is true."""
        return FixedSprings(
            self.point[mask], self.normal[mask], self.moment[mask], self.area_share[mask], self.taxel[mask]
        )


class FixedSkinLayer:
    """The layer of `hand` with brackets at `bracket_poses` f64[s, 4, 4] and springs_per_side^2 springs per taxel."""

    def __init__(
        self, hand: Hand, bracket_poses: FloatArray, law: LayerLaw, springs_per_side: int = SPRINGS_PER_SIDE
    ) -> None:
        """Create the springs that represent the elastic layer of a hand whose boards are at fixed poses.

        bracket_poses: f64[s, 4, 4], world. law: force of a taxel as a function of its compression. springs_per_side:
        springs along one side of a taxel.
        """
        sheet = build_sheet(hand, springs_per_side)
        pose = bracket_poses[sheet.board_index]
        point = np.einsum("mij,mj->mi", pose[:, :3, :3], sheet.position) + pose[:, :3, 3]
        normal = np.einsum("mij,mj->mi", pose[:, :3, :3], sheet.normal)
        taxel = np.arange(sheet.n_taxels) // springs_per_side**2
        self.springs = FixedSprings(point, normal, np.cross(point, normal), sheet.area_share, taxel)
        self.thickness_m = sheet.layer_m or 0.0
        self.n_taxels = hand.n_taxels
        self._law = law

    def near(self, shape: Shape, object_pose: FloatArray) -> FixedSprings:
        """Select the springs whose upper ends are less than `NEAR_M` from an object, so that it can compress them.

        object_pose: pose of the object at its first contact, f64[4, 4].
        """
        low, high = shape.bounds
        middle = object_pose[:3, :3] @ (0.5 * (low + high)) + object_pose[:3, 3]
        reach = 0.5 * float(np.linalg.norm(high - low)) + self.thickness_m + NEAR_M
        # The quick test with the bounding sphere of the object leaves few springs for the slower test of the distance.
        ball = self.springs.select(np.sum((self.springs.point - middle) ** 2, axis=1) < reach**2)
        surface = ball.point + self.thickness_m * ball.normal - object_pose[:3, 3]
        return ball.select(shape.distance_bound(surface @ object_pose[:3, :3]) < NEAR_M)

    def depth(self, springs: FixedSprings, shape: Shape, object_pose: FloatArray) -> FloatArray:
        """Compute the compression of each spring by an object at `object_pose` f64[4, 4], metres, f64[m].

        0 for a spring that the object does not touch. A spring whose line meets the object only far below the
        electrodes (more than `MAX_DEPTH_M`) is treated as not touched: the object is behind the board.
        """
        rotation = object_pose[:3, :3]
        separation = shape.ray_separation((springs.point - object_pose[:3, 3]) @ rotation, springs.normal @ rotation)
        depth = self.thickness_m - separation
        return np.where((depth > 0.0) & (depth < self.thickness_m + MAX_DEPTH_M), depth, 0.0)

    def force(self, springs: FixedSprings, depth_m: FloatArray) -> FloatArray:
        """Compute the force of each spring, newtons, f64[m]. depth_m: compression of each spring f64[m]."""
        return np.asarray(springs.area_share * self._law.compute_force(depth_m))

    def stiffness(self, springs: FixedSprings, depth_m: FloatArray) -> FloatArray:
        """Compute the stiffness of each spring, newtons per metre, f64[m]. depth_m: compression of each, f64[m]."""
        return np.asarray(springs.area_share * self._law.compute_stiffness(depth_m))

    def taxel_forces(self, springs: FixedSprings, shape: Shape, object_pose: FloatArray) -> FloatArray:
        """Compute the normal force of an object at `object_pose` f64[4, 4] on every taxel, newtons, f64[n].

        springs: those that the object can reach. Forces on the bare margin of a board belong to no taxel.
        """
        force = self.force(springs, self.depth(springs, shape, object_pose))
        # Springs on the margin have taxel numbers from n on; the slice removes their sums.
        return np.asarray(np.bincount(springs.taxel, force, self.n_taxels)[: self.n_taxels], dtype=np.float64)
