"""Where an object on a soft mount comes to rest against the emulated skin, for a force that grows from touch to hold.

The mount pushes along its line with a given force, and holds the object across it and about its middle with springs;
the skin answers with the load that the emulator's own contact gives. Six equations, solved by Newton's method from the
load's stiffness, whose error (the surfaces' curvature is not in it) secant updates take out (Broyden 1965).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from taxel.campaign.press.errors import PressError
from taxel.campaign.press.plan import PressMount
from taxel.emulated.contact import SkinContact
from taxel.types import FloatArray

FORCE_SHARES = (0.01, 0.03, 0.07, 0.13, 0.2, 0.3, 0.42, 0.55, 0.7, 0.85, 1.0)
"""Of the nominal force: where rest is solved for. Denser where the layer is soft."""

BALANCED, NEARLY = 3e-4, 1e-2
"""Force left over at rest, as a share of the mount's; and where nothing balances better, because a cell at the rim of a
cylinder bears much or nothing.
"""

ARM_M = 0.02
"""A moment counts as the force that makes it at this arm."""

MOST_STEPS = 30
LONGEST_STEP = np.array([3e-4] * 3 + [0.01] * 3)
SHORTEST_SHARE = 1.0 / 64.0
FIRST_SINK_M = 2e-5
FARTHEST_SEARCH_M = 0.02


class Pressed(NamedTuple):
    """Rest from touch to hold. travel_m: of the mount, f64[k], rising; pose: of the object, world, f64[k, 4, 4]."""

    travel_m: FloatArray
    pose: FloatArray


class EmulatedRest:
    """One object in front of the emulated skin.

    contact, index: the skin, and which of its objects. bracket_poses: f64[s, 4, 4], believed. mount: springs at
    `centre` f64[3], object frame. touch_pose: f64[4, 4], where the object is at travel 0. direction: f64[3].
    """

    def __init__(
        self,
        contact: SkinContact,
        index: int,
        bracket_poses: FloatArray,
        mount: PressMount,
        centre: FloatArray,
        touch_pose: FloatArray,
        direction: FloatArray,
    ) -> None:
        self._contact, self._index, self._brackets = contact, index, bracket_poses
        self._rest, self._direction = touch_pose, direction
        self._centre = touch_pose[:3, :3] @ centre + touch_pose[:3, 3]
        across = mount.n_per_m * (np.eye(3) - np.outer(direction, direction))
        self._along = mount.n_per_m
        self._springs = np.zeros((6, 6))
        self._springs[:3, :3], self._springs[3:, 3:] = across, mount.nm_per_rad * np.eye(3)
        self._to_world = np.stack(
            [_wrench_map(pose @ contact.bracket_offset(board)) for board, pose in enumerate(bracket_poses)]
        )

    def press(self, force_n: float) -> Pressed:
        """From the first touch to `force_n`. Raises `PressError` if nothing bears it."""
        touch = self._touch_travel()
        travels, poses = [touch], [self._pose(np.concatenate([touch * self._direction, np.zeros(3)]))]
        state = self._sunk(touch, FORCE_SHARES[0] * force_n)
        last, change = 0.0, np.zeros(6)
        for share in FORCE_SHARES:
            # The rest changes evenly with the logarithm of the force, near enough for a first guess.
            guess = state + change * (np.log(share / last) if last else 0.0)
            found = self._solve(guess, share * force_n)
            change = (found - state) / np.log(share / last) if last else np.zeros(6)
            state, last = found, share
            travels.append(float(state[:3] @ self._direction) + share * force_n / self._along)
            poses.append(self._pose(state))
        # Where the object snaps into place, the mount waits.
        return Pressed(np.maximum.accumulate(travels), np.stack(poses))

    def _pose(self, state: FloatArray) -> FloatArray:
        """The object moved by state[:3] and turned by state[3:] (rotation vector) about the mount's point."""
        turn = _turn(state[3:])
        pose = self._rest.copy()
        pose[:3, :3] = turn @ self._rest[:3, :3]
        pose[:3, 3] = state[:3] + self._centre + turn @ (self._rest[:3, 3] - self._centre)
        return pose

    def _touches(self, travel: float) -> bool:
        pose = self._rest.copy()
        pose[:3, 3] += travel * self._direction
        return self._contact.load(self._index, pose, self._brackets).touched > 0

    def _touch_travel(self) -> float:
        """Travel of a rigid mount up to the first touch, metres, to a micrometre."""
        step, free = 4e-4, 0.0
        while self._touches(free):
            free -= step
            if free < -FARTHEST_SEARCH_M:
                raise PressError("starts inside the skin")
        while not self._touches(free + step):
            free += step
            if free > FARTHEST_SEARCH_M:
                raise PressError("meets no skin")
        touching = free + step
        while touching - free > 1e-6:
            middle = 0.5 * (free + touching)
            free, touching = (free, middle) if self._touches(middle) else (middle, touching)
        return touching

    def _sunk(self, touch: float, force: float) -> FloatArray:
        """Rigidly so far in that the skin bears at least `force`: from there Newton's method comes back safely."""
        sink = FIRST_SINK_M
        while sink < FARTHEST_SEARCH_M:
            state = np.concatenate([(touch + sink) * self._direction, np.zeros(3)])
            residual, _ = self._balance(state, force)
            if residual[:3] @ self._direction < 0.0:
                return state
            sink *= 1.6
        raise PressError("meets no skin that bears it")

    def _balance(self, state: FloatArray, force: float) -> tuple[FloatArray, FloatArray]:
        """What is left over of force and moment about the mount's point f64[6], and how it falls with motion."""
        load = self._contact.load(self._index, self._pose(state), self._brackets)
        own = np.flatnonzero(load.wrench.any(axis=1))
        shift = np.eye(6)
        shift[3:, :3] = -_cross_matrix(self._centre + state[:3])  # a moment about the world's origin to the point
        maps = shift @ self._to_world[own]
        stiffness = (maps @ load.stiffness[own] @ maps.transpose(0, 2, 1)).sum(axis=0)
        residual = -(maps @ load.wrench[own, :, None]).sum(axis=0)[:, 0] - self._springs @ state
        residual[:3] += force * self._direction
        return residual, stiffness + self._springs

    def _solve(self, state: FloatArray, force: float) -> FloatArray:
        residual, system = self._balance(state, force)
        left = _size(residual)
        best, least = state, left
        for _ in range(MOST_STEPS):
            if left < BALANCED * force:
                return state
            step = _solved(system, residual)
            step *= min(1.0, 1.0 / float(np.max(np.abs(step) / LONGEST_STEP)))
            share = 1.0
            while True:
                next_residual, next_system = self._balance(state + share * step, force)
                next_left = _size(next_residual)
                if next_left < left or share <= SHORTEST_SHARE:
                    break
                share *= 0.5
            moved = share * step
            # Secant update of the new stiffness: it must explain what the last step changed.
            miss = (residual - next_residual) - next_system @ moved
            system = next_system + np.outer(miss, moved / SCALE) / (moved @ (moved / SCALE))
            state, residual, left = state + moved, next_residual, next_left
            best, least = (state, left) if left < least else (best, least)
        if least < NEARLY * force:
            return best
        raise PressError(f"does not come to rest under {force:.1f} N")


SCALE = np.array([1.0] * 3 + [1.0 / ARM_M**2] * 3)
"""Turns weigh in a secant update as the motion that they make at the arm."""


def _size(residual: FloatArray) -> float:
    return float(np.sqrt(residual[:3] @ residual[:3] + residual[3:] @ residual[3:] / ARM_M**2))


def _solved(system: FloatArray, residual: FloatArray) -> FloatArray:
    # Force and moment differ in unit: scaled, or the solution would lose digits.
    scale = np.array([1.0] * 3 + [ARM_M] * 3)
    scaled = system / scale[:, None] / scale
    try:
        return np.asarray(np.linalg.solve(scaled, residual / scale) / scale)
    except np.linalg.LinAlgError:
        raise PressError("loses the skin") from None


def _wrench_map(pose: FloatArray) -> FloatArray:
    """From a wrench in a bracket's frame, about its origin, to the world's, about the world's origin, f64[6, 6]."""
    rotation = pose[:3, :3]
    result = np.zeros((6, 6))
    result[:3, :3] = result[3:, 3:] = rotation
    result[3:, :3] = _cross_matrix(pose[:3, 3]) @ rotation
    return result


def _turn(vector: FloatArray) -> FloatArray:
    """The rotation by |vector| radians about its direction, f64[3, 3] (Rodrigues' formula)."""
    angle = float(np.sqrt(vector @ vector))
    skew = _cross_matrix(vector)
    sine, cosine = (np.sin(angle) / angle, (1.0 - np.cos(angle)) / angle**2) if angle > 1e-8 else (1.0, 0.5)
    return np.asarray(np.eye(3) + sine * skew + cosine * (skew @ skew))


def _cross_matrix(v: FloatArray) -> FloatArray:
    x, y, z = v.tolist()
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
