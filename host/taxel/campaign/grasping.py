"""One grasp by a hand on CAN, emulated or physical: read the joints, ask the controller, send torques, each 3 ms."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.grasp.controller import GraspController
from taxel.hand.allegro.driver import AllegroHand
from taxel.hand.allegro.errors import AllegroError
from taxel.hand.allegro.joints import JOINT_COUNT
from taxel.hand.allegro.virtual import MAX_TORQUE_NM

PERIOD_S = 0.003
SPEED_FILTER_S = 0.009
"""Time constant of the joint speeds: differences of encoder counts over one period are coarse."""


@dataclass(frozen=True, eq=False)
class JointLog:
    """What the encoders said. time_s: [k], seconds since the grasp began; angles: [k, j], radians."""

    time_s: NDArray[np.float64]
    angles: NDArray[np.float64]

    def at(self, times_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Joint angles [T, j] at `times_s` [T]; before and after the log its first and last."""
        columns = [np.interp(times_s, self.time_s, column) for column in self.angles.T]
        return np.column_stack(columns)


def perform(
    hand: AllegroHand,
    controller: GraspController,
    begin_s: float,
    end_s: float,
    wait: Callable[[], int],
    watch: Callable[[float], object] | None = None,
) -> JointLog:
    """Control the hand from `begin_s` to `end_s` of the grasp's timeline; it is without torque afterwards.

    wait: waits for the next period and returns its number, which jumps over periods that were missed (a
    `ControlLoop`'s, or one that moves a virtual hand on). watch: called in each period with the grasp's time. Raises
    the driver's errors (`AllegroError`) at once.
    """
    try:
        log = _control(hand, controller, begin_s, end_s, wait, watch or (lambda _: None))
    except BaseException:
        with contextlib.suppress(AllegroError):  # the error on its way out says more
            hand.set_torque(np.zeros(JOINT_COUNT))
        raise
    hand.set_torque(np.zeros(JOINT_COUNT))
    return log


def _control(
    hand: AllegroHand,
    controller: GraspController,
    begin_s: float,
    end_s: float,
    wait: Callable[[], int],
    watch: Callable[[float], object],
) -> JointLog:
    first, angles = _first_report(hand, wait)
    period, speeds = first, np.zeros_like(angles)
    times, seen = [], []
    while period - first < round((end_s - begin_s) / PERIOD_S):
        time_s = begin_s + (period - first) * PERIOD_S
        times.append(time_s)
        seen.append(angles)
        hand.set_torque(controller.torque(time_s, angles, speeds) / MAX_TORQUE_NM)
        watch(time_s)
        before, period = period, wait()
        hand.update()
        latest, passed_s = hand.joint_angles().angles, (period - before) * PERIOD_S
        speeds += min(passed_s / SPEED_FILTER_S, 1.0) * ((latest - angles) / passed_s - speeds)
        angles = latest
    return JointLog(np.array(times), np.array(seen))


def _first_report(hand: AllegroHand, wait: Callable[[], int]) -> tuple[int, NDArray[np.float64]]:
    """The period in which every finger has reported, and the angles; the driver complains of one that never does."""
    while True:
        period = wait()
        hand.update()
        angles = hand.joint_angles().angles
        if np.isfinite(angles).all():
            return period, angles
