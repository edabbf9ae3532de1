"""Where an object on a soft mount comes to rest against the simulator's layer of springs.

Of the mount's springs the one along the line carries a given force; the others, and the layer, give way. The root of
the six balances is found with MINPACK's hybrid method (Powell 1970), from the layer's stiffness.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator  # type: ignore[import-untyped, unused-ignore]
from scipy.optimize import root  # type: ignore[import-untyped, unused-ignore]

from taxel.campaign.press.errors import PressError
from taxel.campaign.press.plan import PressMount
from taxel.grasp.shapes import Shape
from taxel.hand import Hand
from taxel.hand.transforms import from_rotation_vector, inverse
from taxel.sim.soft_contact import SoftContact

Array = NDArray[np.float64]

LEVELS = (0.02, 0.06, 0.14, 0.26, 0.42, 0.6, 0.8, 1.0)
"""Shares of the force at which rest is solved for; between them it is interpolated over the travel."""

BALANCED = 1e-3
"""Force left over at rest that is one, as a share of the mount's."""

LENGTH_M = 1e-4
"""Unit of the unknowns: what the skin gives way by."""

ARM_M = 0.025
"""A turn counts as the motion that it makes at this arm, a moment as the force."""

SINK_M = np.geomspace(1e-5, 4e-3, 40)
"""How far the rigid object is tried to sink in for a first guess."""


class SoftPress(NamedTuple):
    """A press that came to rest. travel_m: of the mount in the hold. motion: f64[6] of the object in the hold, moved
    and turned (rotation vector) about the mount's point. path: the same over the travel, from the first touch on.
    """

    travel_m: float
    motion: Array
    path: PchipInterpolator

    def motions(self, travel_m: Array, direction: Array) -> Array:
        """The object's motion at `travel_m` f64[k] of the mount, f64[k, 6]; before the touch the mount is at rest."""
        loaded = np.asarray(self.path(np.clip(travel_m, self.path.x[0], self.travel_m)))
        loaded[:, :3] += np.minimum(travel_m - self.path.x[0], 0.0)[:, None] * direction
        return loaded


class SoftRest:
    """One object in front of a simulated skin that stands still.

    law: of the layer. bracket_poses: f64[s, 4, 4], world. touch_pose: f64[4, 4], where the object is at travel 0.
    direction: unit vector f64[3] along which it comes. The mount holds it in the middle of its bounds.
    """

    def __init__(
        self,
        hand: Hand,
        shape: Shape,
        law: LayerLaw,
        bracket_poses: Array,
        mount: PressMount,
        touch_pose: Array,
        direction: Array,
    ) -> None:
        self.soft = SoftContact(hand, shape, law)
        self._shape, self._brackets, self._mount = shape, bracket_poses, mount
        self._touch, self._direction = touch_pose, direction
        self._arm = -touch_pose[:3, :3] @ shape.bounds.mean(axis=0)
        self._pivot = touch_pose[:3, 3] - self._arm
        lateral = np.eye(3) - np.outer(direction, direction)
        self._holding = np.zeros((6, 6))
        self._holding[:3, :3] = mount.n_per_m * lateral
        self._holding[3:, 3:] = mount.nm_per_rad * np.eye(3)
        self._unit = LENGTH_M * np.array([1.0] * 3 + [1.0 / ARM_M] * 3)

    def press(self, force_n: float, levels: tuple[float, ...] = LEVELS) -> SoftPress:
        """Rest from the first touch up to `force_n`. Raises `PressError` if nothing bears it."""
        touch_m = self._touch_travel()
        motion = self._first(levels[0] * force_n, touch_m)
        # The layer may be met a little before the middle of any of its pieces is.
        touch_m = min(touch_m, float(motion[:3] @ self._direction) - SINK_M[0])
        travels, motions = [touch_m], [np.concatenate([touch_m * self._direction, np.zeros(3)])]
        for level in levels:
            motion = self._balanced(motion, level * force_n)
            travels.append(float(motion[:3] @ self._direction) + level * force_n / self._mount.n_per_m)
            motions.append(motion)
        if np.min(np.diff(travels)) <= 0.0:
            raise PressError("slips off the skin")
        path = PchipInterpolator(np.array(travels), np.stack(motions), axis=0)
        return SoftPress(travels[-1], motion, path)

    def pose(self, motion: Array) -> Array:
        """The object after a motion f64[6], world, f64[4, 4]."""
        turn = from_rotation_vector(motion[3:])
        turned = turn @ self._touch
        turned[:3, 3] = motion[:3] + self._pivot + turn[:3, :3] @ self._arm
        return np.asarray(turned)

    def _touch_travel(self) -> float:
        """Travel at which the object touches the middle of the first piece of the sheet, metres."""
        sheet = self.soft.sheet
        poses = (inverse(self._touch) @ self._brackets)[sheet.board_index]
        outer = sheet.position + (sheet.layer_m or 0.0) * sheet.normal
        points = np.einsum("mij,mj->mi", poses[:, :3, :3], outer) + poses[:, :3, 3]
        travel = self._shape.ray_separation(points, -self._touch[:3, :3].T @ self._direction)
        return float(travel.min())

    def _first(self, force: float, touch_m: float) -> Array:
        for sink in SINK_M:
            motion = np.concatenate([(touch_m + sink) * self._direction, np.zeros(3)])
            load = self.soft.load(self._brackets, self.pose(motion))
            if load.wrench[:, :3].sum(axis=0) @ self._direction > force:
                return motion
        raise PressError("meets no skin that bears it")

    def _left_over(self, scaled: Array, force: float) -> tuple[Array, Array]:
        """Force and moment about the mount's point that nothing balances, and their rise with the motion, scaled."""
        motion = scaled * self._unit
        load = self.soft.load(self._brackets, self.pose(motion))
        board = self.soft.sheet.board_index[load.square]
        normal = load.line[:, :3]
        arms = self._brackets[board, :3, 3] - (self._pivot + motion[:3])
        lines = np.hstack([normal, load.line[:, 3:] + np.cross(arms, normal)])
        left = load.force @ lines - self._holding @ motion
        left[:3] += force * self._direction
        rise = -(lines * load.rate[:, None]).T @ lines - self._holding
        weight = np.array([1.0] * 3 + [1.0 / ARM_M] * 3) / force
        return weight * left, weight[:, None] * rise * self._unit

    def _balanced(self, start: Array, force: float) -> Array:
        found = root(self._left_over, start / self._unit, args=(force,), jac=True, options={"xtol": 1e-7})
        if float(np.linalg.norm(found.fun)) > BALANCED:
            raise PressError(f"does not come to rest under {force:.1f} N")
        return np.asarray(found.x * self._unit)
