"""One grasp by a hand on CAN, emulated or physical: read the joints, ask the controller, send torques, each 3 ms."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.grasp.controller import GraspController
from taxel.hand.allegro.driver import AllegroHand
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
    wait: Callable[[], object],
    watch: Callable[[float], object] | None = None,
) -> JointLog:
    """Control the hand from `begin_s` to `end_s` of the grasp's timeline.

    wait: waits for the next period (a `ControlLoop`'s, or one that moves a virtual hand on). watch: called in each
    period with the grasp's time. Raises the driver's errors (`AllegroError`) at once; the hand is then without torque.
    """
    wait()  # for the first report of every finger
    hand.update()
    angles = hand.joint_angles().angles
    speeds = np.zeros_like(angles)
    times, seen = [], []
    for tick in range(round((end_s - begin_s) / PERIOD_S)):
        time_s = begin_s + tick * PERIOD_S
        times.append(time_s)
        seen.append(angles)
        hand.set_torque(controller.torque(time_s, angles, speeds) / MAX_TORQUE_NM)
        if watch is not None:
            watch(time_s)
        wait()
        hand.update()
        latest = hand.joint_angles().angles
        speeds += (PERIOD_S / SPEED_FILTER_S) * ((latest - angles) / PERIOD_S - speeds)
        angles = latest
    return JointLog(np.array(times), np.array(seen))
