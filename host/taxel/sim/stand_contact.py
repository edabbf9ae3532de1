"""Contact of the object with the plane on which it stands: corner points with a stiff spring and Coulomb friction."""

from typing import Final, NamedTuple

import numpy as np

from taxel.grasp.objects import STAND_FRICTION, STAND_N_PER_M
from taxel.grasp.shapes import ConvexPolytope, Cylinder, Shape
from taxel.hand.transforms import cross
from taxel.types import FloatArray

RIM_POINTS: Final = 16
"""Points on each edge of a cylinder (chosen)."""


class StandLoad(NamedTuple):
    """Load of the stand on the object, about the object's origin, in the world.

    wrench: f64[6], force (N) and moment (Nm). stiffness: f64[6, 6], its negative derivative with respect to a small
    motion of the object (translation, rotation).
    """

    wrench: FloatArray
    stiffness: FloatArray


class StandContact:
    """Contact of an object with the plane z = 0 of its stand.

    Each corner is a spring across the plane. A corner sticks to the point of the plane that it first touched, and
    slides where the force along the plane would exceed the friction coefficient times the force across.

    corners: f64[k, 3], object frame, metres. stiffness_n_per_m: of one corner. up, origin: f64[3], unit normal and a
    point of the plane, world.
    """

    def __init__(self, shape: Shape, pose: FloatArray) -> None:
        """Prepare the contact. shape: the object. pose: f64[4, 4] of the stand in the world; its z axis is upward."""
        self.corners = _find_corners(shape)
        is_bottom = self.corners[:, 2] < self.corners[:, 2].min() + 1e-6
        # The corners of an upright object together have the stiffness of the stand.
        self.stiffness_n_per_m = STAND_N_PER_M / max(int(is_bottom.sum()), 1)
        self.up, self.origin = pose[:3, 2].copy(), pose[:3, 3].copy()
        self._across = np.outer(self.up, self.up)
        self._anchors = np.full_like(self.corners, np.nan)

    def compute_load(self, object_pose: FloatArray, advance: bool = False) -> StandLoad:
        """Compute the load on the object at a pose f64[4, 4] in the world.

        advance: store where the corners stick to the stand; call it once per time step, with the poses of the step.
        """
        arms = self.corners @ object_pose[:3, :3].T
        points = arms + object_pose[:3, 3]
        depth = (self.origin - points) @ self.up
        touching = depth > 0.0
        if advance:
            self._anchors[~touching] = np.nan
        if not touching.any():
            return StandLoad(np.zeros(6), np.zeros((6, 6)))
        points, depth = points[touching], depth[touching]
        shear = points - self._anchors[touching]
        shear[np.isnan(shear)] = 0.0  # a corner that touches the stand for the first time
        shear -= (shear @ self.up)[:, None] * self.up
        length = np.sqrt((shear * shear).sum(axis=1))
        limit, sticking = STAND_FRICTION * self.stiffness_n_per_m * depth, self.stiffness_n_per_m * length
        slides = sticking > limit
        rate = np.where(slides, self.stiffness_n_per_m * limit / np.maximum(sticking, limit), self.stiffness_n_per_m)
        if advance:
            self._anchors[touching] = points - shear * (rate / self.stiffness_n_per_m)[:, None]
        # Full stiffness perpendicular to the plane, `rate` along it, and 0 in the direction in which a corner slides.
        along = np.where(slides, rate / np.maximum(length, 1e-12) ** 2, 0.0)
        springs = (self.stiffness_n_per_m - rate)[:, None, None] * self._across + rate[:, None, None] * np.eye(3)
        springs -= along[:, None, None] * shear[:, :, None] * shear[:, None, :]
        force = self.stiffness_n_per_m * depth[:, None] * self.up - rate[:, None] * shear
        motion = np.zeros((len(points), 6, 3))
        motion[:, :3] = np.eye(3)
        motion[:, 3:] = cross(arms[touching][:, None], np.eye(3)[None]).transpose(0, 2, 1)
        wrench = (motion @ force[:, :, None]).sum(axis=0)[:, 0]
        return StandLoad(wrench, (motion @ springs @ motion.transpose(0, 2, 1)).sum(axis=0))


def _find_corners(shape: Shape) -> FloatArray:
    """Return the points of an object that can touch a plane, f64[k, 3], object frame, metres.

    These are the vertices of a polytope, or `RIM_POINTS` points on each rim of a cylinder.
    """
    if isinstance(shape, ConvexPolytope):
        return shape.vertices
    assert isinstance(shape, Cylinder)
    angles = 2.0 * np.pi * np.arange(RIM_POINTS) / RIM_POINTS
    rim = shape.radius * np.column_stack([np.cos(angles), np.sin(angles)])
    return np.concatenate([np.column_stack([rim, np.full(RIM_POINTS, z)]) for z in (0.0, shape.height)])
