"""The torques that close the hand, hold and open it again: the same law for a simulated, a virtual and a real hand."""

from __future__ import annotations

from typing import Final

import numpy as np

from taxel.grasp.plan import Approach
from taxel.grasp.timeline import Timeline
from taxel.types import FloatArray

TORQUE_LIMIT_NM: Final = 0.7  # of every joint (Wonik's data sheet of the Allegro hand)

# Chosen. A held joint gives way by 0.05 rad under 0.5 Nm; damping is near critical for a geared finger joint's inertia.
HOLD_NM_PER_RAD: Final = 10.0
HOLD_NM_S_PER_RAD: Final = 0.3
# Chosen. Opening is soft; the damping limits the speed at which a closing finger meets the object.
OPEN_NM_PER_RAD: Final = 1.0
OPEN_NM_S_PER_RAD: Final = 0.045


class GraspController:
    """Torques for one grasp: f64[j] Nm at time t from the joints' angles and velocities; it keeps no state.

    Held joints follow their targets all the time. The others hold their open angles, softly, in the baseline; close
    with a torque that rises to the planned one and stays there; and return to the open angles. At rest in the hold
    phase their torque is exactly the planned one times `torque_scale`. The limit is `TORQUE_LIMIT_NM`.
    """

    def __init__(self, approach: Approach, timeline: Timeline, torque_scale: float = 1.0) -> None:
        if not 0 <= torque_scale < np.inf:
            raise ValueError(f"torque_scale: expected at least 0, found {torque_scale}")
        self.approach = approach
        self.timeline = timeline
        self._held = approach.held
        self._target = np.where(self._held, approach.base_targets, approach.open_angles)
        self._grip = approach.torque * torque_scale
        self._stiffness = np.where(self._held, HOLD_NM_PER_RAD, OPEN_NM_PER_RAD)
        self._damping = np.where(self._held, HOLD_NM_S_PER_RAD, OPEN_NM_S_PER_RAD)

    def torque(self, t: float, angles: FloatArray, velocities: FloatArray) -> FloatArray:
        """Motor torques f64[j], Nm, at `t` seconds from the start of the grasp.

        angles: f64[j], radians. velocities: f64[j], radians a second.
        """
        grip = self.timeline.grip_at(t)
        position = self._stiffness * (self._target - angles)
        wanted = np.where(self._held, position, grip * self._grip + (1.0 - grip) * position)
        wanted -= self._damping * velocities
        return np.asarray(wanted.clip(-TORQUE_LIMIT_NM, TORQUE_LIMIT_NM))
