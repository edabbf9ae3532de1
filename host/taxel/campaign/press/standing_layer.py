"""The simulator's elastic layer on boards that stand still, one object at a time.

The same springs as those of `taxel.sim.soft_contact`, each along its piece's normal with its law; but as nothing turns,
their lines are worked out once, and so many of them can stand under a taxel that their number does not matter.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel.grasp.shapes import Shape
from taxel.hand import Hand
from taxel.hand.sheet import sheet_of
from taxel.sim.soft_contact import DEEPEST_M, LayerLaw
from taxel.types import FloatArray

PARTS = 5
"""Springs along each side of a taxel. Under rounded edges the counts are then 4 RMS from those of 9; with 3: 12."""

NEAR_M = 0.004
"""Pieces whose surface is farther from an unloaded object that just touches are out of its reach."""


class Standing(NamedTuple):
    """Springs whose boards stand still, world. point: f64[m, 3], on the electrode's level; normal: f64[m, 3]; moment:
    f64[m, 3], of the normal about the origin; taxel: [m], whose it is, n and more for the bare margin.
    """

    point: FloatArray
    normal: FloatArray
    moment: FloatArray
    taxel: NDArray[np.intp]

    def some(self, which: NDArray[np.bool_]) -> Standing:
        """Only those of bool[m]."""
        return Standing(self.point[which], self.normal[which], self.moment[which], self.taxel[which])


class StandingLayer:
    """The layer of `hand` with brackets at `bracket_poses` f64[s, 4, 4], parts x parts springs a taxel."""

    def __init__(self, hand: Hand, bracket_poses: FloatArray, law: LayerLaw, parts: int = PARTS) -> None:
        sheet = sheet_of(hand, parts)
        pose = bracket_poses[sheet.board_index]
        point = np.einsum("mij,mj->mi", pose[:, :3, :3], sheet.position) + pose[:, :3, 3]
        normal = np.einsum("mij,mj->mi", pose[:, :3, :3], sheet.normal)
        taxel = np.arange(sheet.n_taxels) // parts**2
        self.springs = Standing(point, normal, np.cross(point, normal), taxel)
        self.thickness_m = sheet.layer_m or 0.0
        self.n_taxels = hand.n_taxels
        self._law, self._share = law, 1.0 / parts**2

    def near(self, shape: Shape, object_pose: FloatArray) -> Standing:
        """The springs that an object which just touches at `object_pose` f64[4, 4] may reach."""
        low, high = shape.bounds
        middle = object_pose[:3, :3] @ (0.5 * (low + high)) + object_pose[:3, 3]
        reach = 0.5 * float(np.linalg.norm(high - low)) + self.thickness_m + NEAR_M
        ball = self.springs.some(np.sum((self.springs.point - middle) ** 2, axis=1) < reach**2)
        surface = ball.point + self.thickness_m * ball.normal - object_pose[:3, 3]
        return ball.some(shape.distance_bound(surface @ object_pose[:3, :3]) < NEAR_M)

    def depth(self, springs: Standing, shape: Shape, object_pose: FloatArray) -> FloatArray:
        """How far each spring is compressed, metres, f64[m]."""
        rotation = object_pose[:3, :3]
        separation = shape.ray_separation((springs.point - object_pose[:3, 3]) @ rotation, springs.normal @ rotation)
        depth = self.thickness_m - separation
        return np.where((depth > 0.0) & (depth < self.thickness_m + DEEPEST_M), depth, 0.0)

    def force(self, depth_m: FloatArray) -> FloatArray:
        """Of each spring, newtons."""
        return np.asarray(self._share * self._law.force(depth_m))

    def stiffness(self, depth_m: FloatArray) -> FloatArray:
        """Of each spring, newtons a metre."""
        return np.asarray(self._share * self._law.stiffness(depth_m))

    def taxel_forces(self, springs: Standing, shape: Shape, object_pose: FloatArray) -> FloatArray:
        """Normal force on every taxel, newtons, f64[n]; the bare margin's part is nobody's."""
        force = self.force(self.depth(springs, shape, object_pose))
        return np.asarray(np.bincount(springs.taxel, force, self.n_taxels)[: self.n_taxels], dtype=np.float64)
