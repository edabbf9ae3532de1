"""A plan of presses drawn from a seed: objects, ways to press such that every board has its share, and their order."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel.campaign.counts import BACK
from taxel.campaign.press.errors import PressPlanError
from taxel.campaign.press.families import PressObject, drawn_objects
from taxel.campaign.press.placing import Placer, Skin
from taxel.campaign.press.plan import PressApproach, PressMount, PressPlan, ordered
from taxel.campaign.press.settings import press_timeline
from taxel.grasp.timeline import Timeline
from taxel.hand import Hand
from taxel.hand.kinematics import kinematics_of

EACH_BOARD = 2
"""Approaches that press a board, at least."""

TOGETHER = 0.25
"""Share of the approaches that press two boards, where boards are neighbours."""

ATTEMPTS, ATTEMPTS_TOGETHER = 1000, 100
"""Draws for one approach, until its board counts as out of reach, or its two boards as no pair."""

FORCE_N = (4.0, 20.0)


def random_press_plan(
    hand: Hand,
    seed: int,
    approaches: int = 8,
    sessions: int = 6,
    repeats: int = 2,
    objects: int = 3,
    force_n: tuple[float, float] = FORCE_N,
    mount: PressMount | None = None,
    timeline: Timeline | None = None,
    joints: ArrayLike | None = None,
) -> PressPlan:
    """Draw objects and `approaches` ways to press them into `hand`; each comes `repeats` times in every session.

    force_n: least and greatest nominal force, newtons. joints: radians f64[j], how the rig holds the hand; None: 0, or
    as near to it as the joints go. Boards on the back of a hand are not pressed, nor are those that no object
    reaches; every other one is pressed by `EACH_BOARD` approaches at least.

    Raises PressPlanError for numbers that make no plan, such as too few approaches for the boards.
    """
    for field, value in (
        ("approaches", approaches),
        ("sessions", sessions),
        ("repeats", repeats),
        ("objects", objects),
    ):
        if value < 1:
            raise PressPlanError(field, "at least 1", str(value))
    if not 0.0 < force_n[0] <= force_n[1] < np.inf:
        raise PressPlanError("force_n", "two forces above 0 newtons, the smaller first", str(force_n))
    rng = np.random.default_rng(seed)
    mount = mount or PressMount()
    skin = Skin.of(hand, _bracket_poses(hand, joints))
    things = drawn_objects(rng, objects)
    drawn = _Draw(skin, mount, things, force_n, rng).approaches(approaches)
    return PressPlan(
        hand,
        skin.bracket_poses,
        {thing.item.name: thing.item for thing in things},
        drawn,
        ordered(drawn, sessions, repeats, rng),
        timeline or press_timeline(hand),
        mount,
    )


def _bracket_poses(hand: Hand, joints: ArrayLike | None) -> NDArray[np.float64]:
    kinematics = kinematics_of(hand)
    robot = kinematics.robot
    angles = np.clip(np.zeros(len(robot.joint_names)), robot.lower, robot.upper) if joints is None else joints
    return kinematics.sensor_poses(angles)


class _Draw:
    """Approaches one after another, each on the boards that have been pressed least."""

    def __init__(
        self,
        skin: Skin,
        mount: PressMount,
        things: list[PressObject],
        force_n: tuple[float, float],
        rng: np.random.Generator,
    ) -> None:
        self._placer, self._things, self._force, self._rng = Placer(skin, mount, rng), things, force_n, rng
        boards = [index for index, board in enumerate(skin.hand.boards) if BACK not in board.kind.name]
        self._hand = skin.hand
        self._pressed = dict.fromkeys(boards, 0)
        self._pairs = skin.neighbours(boards)
        self._made: list[PressApproach] = []

    def approaches(self, count: int) -> tuple[PressApproach, ...]:
        """`count` of them, named in a drawn order. Raises PressPlanError."""
        together = round(TOGETHER * count)
        while len(self._made) < together and self._pairs:
            pair = min(self._pairs, key=lambda own: (sum(self._pressed[board] for board in own), self._rng.random()))
            if not self._add(pair):
                self._pairs.remove(pair)
        while len(self._made) < count:
            if not self._pressed:
                raise PressPlanError("hand", "a board that an object reaches", f"none on {self._hand.name!r}")
            board = min(self._pressed, key=lambda own: (self._pressed[own], self._rng.random()))
            if not self._add((board,)):
                del self._pressed[board]  # out of reach, or all but
        least = min(self._pressed.values())
        if least < EACH_BOARD:
            needed = EACH_BOARD * len(self._pressed)
            raise PressPlanError("approaches", f"up to {needed} for {len(self._pressed)} boards", str(count))
        order = self._rng.permutation(count).tolist()
        return tuple(replace(self._made[index], name=f"press_{place + 1}") for place, index in enumerate(order))

    def _add(self, boards: tuple[int, ...]) -> bool:
        used = [made.object for made in self._made]
        for attempt in range(ATTEMPTS if len(boards) == 1 else ATTEMPTS_TOGETHER):
            # The object that was used least; but another one if this one fits nowhere.
            order = sorted(self._things, key=lambda thing: (used.count(thing.item.name), self._rng.random()))
            thing = order[(attempt // 10) % len(order)]
            force = float(np.exp(self._rng.uniform(*np.log(self._force))))
            found = self._placer.draw(thing, boards, force)
            if found is not None:
                self._made.append(found)
                for board in boards:
                    self._pressed[board] += 1
                return True
        return False
