"""Search of a collision-free path to one of several pre-grasp postures, in which arm and hand move in turn."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from taxel.hand.arm.base import UPRIGHT_RAD
from taxel.planning.clearance import Clearances, Collision
from taxel.planning.errors import (
    NoPathError,
)
from taxel.planning.plan import ARM_JOINTS
from taxel.planning.search import SearchSpace, find_path, shorten_path
from taxel.planning.timing import SpeedLimits, compute_duration_s
from taxel.types import FloatArray

VIA_CANDIDATES: Final = 100
"""Largest number of random arm postures that are checked as intermediate postures (chosen); about a tenth is free."""

_SAME_POSTURE_RAD: Final = 1e-9


@dataclass(frozen=True)
class PlannerSettings:
    """Settings of a planner.

    seed: of the random search; equal inputs give equal plans. iterations: largest number of random postures of a
    search. via_postures: number of intermediate arm postures that are tried for a motion of the hand if neither the
    start nor the goal posture permits it. limits: speeds and accelerations.
    """

    seed: int = 1
    iterations: int = 1500
    via_postures: int = 6
    limits: SpeedLimits = field(default_factory=SpeedLimits)


@dataclass(frozen=True, eq=False)
class Goal:
    """A free pre-grasp posture: arm angles f64[6] there and at the object, and hand angles f64[j - 6]."""

    pregrasp: FloatArray
    grasping: FloatArray
    hand: FloatArray


class PathSearch:
    """Search of a path from a start posture to one of several pre-grasp postures.

    The arm moves with a hand posture that is kept, and the hand moves while the arm is at rest: the finger controller
    of a physical hand follows an arm in motion too slowly for a common path.
    """

    def __init__(
        self, clearances: Clearances, required: FloatArray, lower: FloatArray, upper: FloatArray, start: FloatArray
    ) -> None:
        """Create a search. required: distance of each pair, f64[p], metres. lower, upper: joint limits f64[j].

        start: start posture f64[j].
        """
        self._clearances, self._required, self._start = clearances, required, start
        self._lower, self._upper = lower, upper

    def run(self, what: str, goals: list[Goal], settings: PlannerSettings) -> tuple[FloatArray, Goal]:
        """Search the path; return its waypoints f64[k, j] and the goal that it reaches. Raises NoPathError.

        what: name of the motion in messages.
        """
        rng = np.random.default_rng(settings.seed)
        for part in self._try_orders(goals, settings, rng):
            if part is not None:
                waypoints, goal = part
                is_step = np.r_[True, np.abs(np.diff(waypoints, axis=0)).max(axis=1) > _SAME_POSTURE_RAD]
                return waypoints[is_step], goal
        collision = self._clearances.check_segment(self._start, np.r_[goals[0].pregrasp, goals[0].hand], self._required)
        blocked = (
            "" if collision is None else f"; on the straight path: {describe_collision(self._clearances, collision)}"
        )
        raise NoPathError(
            what,
            f"no collision-free path from the start posture within {settings.iterations} random postures{blocked}; "
            "move the arm to a freer posture by hand, or move the object",
        )

    def _try_orders(
        self, goals: list[Goal], settings: PlannerSettings, rng: np.random.Generator
    ) -> Iterator[tuple[FloatArray, Goal] | None]:
        """Yield paths, or None for a failed attempt: hand first, arm first, and by way of a random arm posture."""
        arm, hand = self._start[:ARM_JOINTS], self._start[ARM_JOINTS:]
        target = goals[0].hand  # of all goals
        yield self._join(
            self._move_hand(arm, hand, target, settings, rng), arm, goals, settings.iterations, settings, rng
        )
        if (found := self._move_arm(arm, hand, goals, settings.iterations // 3, settings, rng)) is not None:
            path, goal = found
            fingers = self._move_hand(goal.pregrasp, hand, target, settings, rng)
            yield None if fingers is None else (np.vstack([path, fingers]), goal)
        for via in self._find_via_postures(arm, goals, settings, rng):
            fingers = self._move_hand(via, hand, target, settings, rng)
            if fingers is None:
                continue
            way = self._move_arm(arm, hand, [Goal(via, via, hand)], settings.iterations // 5, settings, rng)
            if way is not None:
                continuation = self._join(fingers, via, goals, settings.iterations // 5, settings, rng)
                yield None if continuation is None else (np.vstack([way[0], continuation[0]]), continuation[1])

    def _find_via_postures(
        self, arm: FloatArray, goals: list[Goal], settings: PlannerSettings, rng: np.random.Generator
    ) -> Iterator[FloatArray]:
        """Yield arm postures f64[6] that are free with the hand posture of the start and with that of the goals.

        The first candidate is the upright arm, the others are random.
        """
        low, high = self._find_range(arm, goals)
        candidates = [np.array(UPRIGHT_RAD)]
        candidates += [low + rng.uniform(size=ARM_JOINTS) * (high - low) for _ in range(VIA_CANDIDATES)]
        count = 0
        for via in candidates:
            if count == settings.via_postures:
                return
            postures = (np.r_[via, fingers] for fingers in (self._start[ARM_JOINTS:], goals[0].hand))
            if any(self._clearances.find_collision(posture, self._required) is not None for posture in postures):
                continue
            yield via
            count += 1

    def _join(
        self,
        fingers: FloatArray | None,
        arm: FloatArray,
        goals: list[Goal],
        iterations: int,
        settings: PlannerSettings,
        rng: np.random.Generator,
    ) -> tuple[FloatArray, Goal] | None:
        """Append a path of the arm to one of the goals to `fingers`, the path of the hand; return both with the goal.

        None if `fingers` is None, or if no path of the arm is found. arm: arm posture during the motion of the hand.
        """
        if fingers is None:
            return None
        found = self._move_arm(arm, goals[0].hand, goals, iterations, settings, rng)
        return None if found is None else (np.vstack([fingers, found[0]]), found[1])

    def _move_arm(
        self,
        arm: FloatArray,
        hand: FloatArray,
        goals: list[Goal],
        iterations: int,
        settings: PlannerSettings,
        rng: np.random.Generator,
    ) -> tuple[FloatArray, Goal] | None:
        """Search a path of the arm with a constant hand posture: waypoints f64[k, j] and the goal; None: none found."""
        low, high = self._find_range(arm, goals)

        def complete(angles: FloatArray) -> FloatArray:
            """Append the hand posture to arm angles f64[..., 6]."""
            return np.concatenate([angles, np.broadcast_to(hand, (*angles.shape[:-1], len(hand)))], axis=-1)

        space = SearchSpace(
            low,
            high,
            lambda a, b: self._clearances.check_segment(complete(a), complete(b), self._required) is None,
            lambda path: compute_duration_s(complete(path), settings.limits),
        )
        path = find_path(arm, [goal.pregrasp for goal in goals], space, rng, iterations)
        if path is None:
            return None
        goal = next(goal for goal in goals if np.array_equal(goal.pregrasp, path[-1]))
        return complete(shorten_path(path, space, rng)), goal

    def _move_hand(
        self, arm: FloatArray, hand: FloatArray, target: FloatArray, settings: PlannerSettings, rng: np.random.Generator
    ) -> FloatArray | None:
        """Search a path of the hand with the arm at rest: waypoints f64[k, j]; None: none found."""
        clearances, start, end = self._clearances, np.r_[arm, hand], np.r_[arm, target]
        if any(clearances.find_collision(posture, self._required) is not None for posture in (start, end)):
            return None

        def complete(angles: FloatArray) -> FloatArray:
            """Prepend the arm angles to hand angles f64[..., j - 6]."""
            return np.concatenate([np.broadcast_to(arm, (*angles.shape[:-1], ARM_JOINTS)), angles], axis=-1)

        # Joint limits, extended to start and target: the measured start may be slightly outside its limits.
        low, high = (
            bound(bound(limits[ARM_JOINTS:], hand), target)
            for bound, limits in ((np.minimum, self._lower), (np.maximum, self._upper))
        )
        space = SearchSpace(
            low,
            high,
            lambda a, b: clearances.check_segment(complete(a), complete(b), self._required) is None,
            lambda path: compute_duration_s(complete(path), settings.limits),
        )
        path = find_path(hand, [target], space, rng, settings.iterations // 5)
        return None if path is None else complete(shorten_path(path, space, rng))

    def _find_range(self, arm: FloatArray, goals: list[Goal]) -> tuple[FloatArray, FloatArray]:
        """Find the range of arm angles of a search, f64[6] each: one turn about 0, extended by start and goals."""
        ends = np.stack([arm, *(goal.pregrasp for goal in goals)])
        low = np.maximum(self._lower[:ARM_JOINTS], np.minimum(ends.min(axis=0), -np.pi))
        return low, np.minimum(self._upper[:ARM_JOINTS], np.maximum(ends.max(axis=0), np.pi))


def describe_collision(clearances: Clearances, collision: Collision) -> str:
    """Return text that describes a collision: the names of the two bodies, and their overlap or distance."""
    pair, distance_mm = clearances.bodies.format_pair(collision.pair), collision.distance_m * 1e3
    if distance_mm < 0:
        return f"{pair} overlap by {-distance_mm:.1f} mm"
    return f"{pair} are {distance_mm:.1f} mm apart, too near"
