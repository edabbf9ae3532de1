"""Where an object on a soft mount comes to rest against the simulator's layer of springs.

Of the mount's springs the one along the line carries a given force; the others, and the layer, give way. The root of
the six balances is found with MINPACK's hybrid method (Powell 1970), from the layer's stiffness.
"""

from __future__ import annotations

from bisect import bisect_left
from typing import Literal, NamedTuple

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.optimize import root

from taxel.campaign.press.errors import PressError
from taxel.campaign.press.plan import PressMount
from taxel.campaign.press.standing_layer import StandingLayer
from taxel.grasp.shapes import Shape
from taxel.hand.transforms import from_rotation_vector
from taxel.types import FloatArray

LEVELS = (0.02, 0.07, 0.17, 0.33, 0.6, 1.0)
"""Shares of the force at which rest is solved for; between them it is interpolated over the travel."""

BALANCED, ALMOST = 1e-3, 1e-2
"""Force left over at rest, as a share of the mount's; and where springs at a sharp rim let nothing balance better."""

LENGTH_M = 1e-4
"""Unit of the unknowns: what the skin gives way by."""

ARM_M = 0.025
"""A turn counts as the motion that it makes at this arm, a moment as the force."""

SINKS_M = np.geomspace(1e-5, 4e-3, 40).tolist()
"""How far the rigid object is tried to sink in for a first guess."""


class SoftPress(NamedTuple):
    """A press that came to rest. travel_m: of the mount in the hold. motion: f64[6] of the object in the hold, moved
    and turned (rotation vector) about the mount's point. path: the same over the travel, from the first touch on.
    """

    travel_m: float
    motion: FloatArray
    path: PchipInterpolator

    def motions(self, travel_m: FloatArray, direction: FloatArray) -> FloatArray:
        """The object's motion at `travel_m` f64[k] of the mount, f64[k, 6]; before the touch the mount is at rest."""
        loaded = np.asarray(self.path(np.clip(travel_m, self.path.x[0], self.travel_m)))
        loaded[:, :3] += np.minimum(travel_m - self.path.x[0], 0.0)[:, None] * direction
        return loaded


class SoftRest:
    """One object in front of a simulated skin that stands still.

    touch_pose: f64[4, 4], where the object is at travel 0. direction: unit vector f64[3] along which it comes. The
    mount holds it in the middle of its bounds.
    """

    def __init__(
        self, layer: StandingLayer, shape: Shape, mount: PressMount, touch_pose: FloatArray, direction: FloatArray
    ) -> None:
        self._layer, self._shape, self._mount = layer, shape, mount
        self._touch, self._direction = touch_pose, direction
        self._near = layer.near(shape, touch_pose)
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
        touch_m = min(touch_m, float(motion[:3] @ self._direction) - SINKS_M[0])
        travels, motions = [touch_m], [np.concatenate([touch_m * self._direction, np.zeros(3)])]
        last, slope = 0.0, np.zeros(6)
        for level in levels:
            ahead = np.log(level / last) if last else 1.0  # what gives way does so with the force's logarithm, nearly
            start, motion = motion, self._balanced(motion + ahead * slope, motion, level * force_n)
            slope, last = ((motion - start) / ahead if last else slope), level
            travels.append(float(motion[:3] @ self._direction) + level * force_n / self._mount.n_per_m)
            motions.append(motion)
        # Where the object snaps into place the mount's travel does not rise; the path goes past that.
        rising = [place for place, travel in enumerate(travels) if travel < min(travels[place + 1 :], default=np.inf)]
        path = PchipInterpolator(np.array(travels)[rising], np.stack(motions)[rising], axis=0)
        return SoftPress(travels[-1], motion, path)

    def pose(self, motion: FloatArray) -> FloatArray:
        """The object after a motion f64[6], world, f64[4, 4]."""
        turn = from_rotation_vector(motion[3:])
        turned = turn @ self._touch
        turned[:3, 3] = motion[:3] + self._pivot + turn[:3, :3] @ self._arm
        return np.asarray(turned)

    def taxel_forces(self, motion: FloatArray) -> FloatArray:
        """Normal force on every taxel after a motion f64[6], newtons, f64[n]."""
        return self._layer.taxel_forces(self._near, self._shape, self.pose(motion))

    def _touch_travel(self) -> float:
        """Travel at which the object touches the first piece of the layer's surface, metres."""
        surface = self._near.point + self._layer.thickness_m * self._near.normal
        points = (surface - self._touch[:3, 3]) @ self._touch[:3, :3]
        travel = self._shape.ray_separation(points, -self._touch[:3, :3].T @ self._direction)
        first = float(travel.min(initial=np.inf))
        if not np.isfinite(first):
            raise PressError("meets no skin")
        return first

    def _first(self, force: float, touch_m: float) -> FloatArray:
        """The rigid object so far in that the layer bears at least `force`."""

        def motion(sink: float) -> FloatArray:
            return np.concatenate([(touch_m + sink) * self._direction, np.zeros(3)])

        def pushed(sink: float) -> float:
            pushes = self._layer.force(self._layer.depth(self._near, self._shape, self.pose(motion(sink))))
            return -float(pushes @ (self._near.normal @ self._direction))

        place = bisect_left(SINKS_M, force, key=pushed)
        if place == len(SINKS_M):
            raise PressError("meets no skin that bears it")
        return motion(SINKS_M[place])

    def _left_over(self, scaled: FloatArray, force: float) -> tuple[FloatArray, FloatArray]:
        """Force and moment about the mount's point that nothing balances, and their rise with the motion, scaled."""
        motion = scaled * self._unit
        depth = self._layer.depth(self._near, self._shape, self.pose(motion))
        bears = depth > 0.0
        own, depth = self._near.some(bears), depth[bears]
        x, y, z = (self._pivot + motion[:3]).tolist()
        across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        lines = np.hstack([own.normal, own.moment - own.normal @ across.T])
        left = self._layer.force(depth) @ lines - self._holding @ motion
        left[:3] += force * self._direction
        rise = -(lines * self._layer.stiffness(depth)[:, None]).T @ lines - self._holding
        weight = np.array([1.0] * 3 + [1.0 / ARM_M] * 3) / force
        return weight * left, weight[:, None] * rise * self._unit

    def _balanced(self, guess: FloatArray, last: FloatArray, force: float) -> FloatArray:
        """Rest under `force`, from a first guess or else from the last rest; Levenberg and Marquardt's method is slower
        and gets where Powell's stops at a kink.
        """
        attempts: tuple[tuple[FloatArray, Literal["hybr", "lm"]], ...] = ((guess, "hybr"), (last, "hybr"), (last, "lm"))
        results = []
        for start, method in attempts:
            found = root(
                self._left_over, start / self._unit, args=(force,), method=method, jac=True, options={"xtol": 1e-5}
            )
            results.append((float(np.linalg.norm(found.fun)), np.asarray(found.x * self._unit)))
            if results[-1][0] < BALANCED:
                return results[-1][1]
        least, best = min(results, key=lambda result: result[0])
        if least < ALMOST:
            return best
        raise PressError(f"does not come to rest under {force:.1f} N")
