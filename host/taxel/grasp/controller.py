"""Joint torques of a grasp (closing, hold, release) for a simulated, a virtual and a physical hand."""

from typing import Final

import numpy as np

from taxel.grasp.plan import Approach
from taxel.grasp.timeline import Timeline
from taxel.types import FloatArray

TORQUE_LIMIT_NM: Final = 0.7  # of every joint; source: Wonik's data sheet of the Allegro hand

# Assumed: a held joint deflects by 0.05 rad under 0.5 Nm; near-critical damping for a geared finger joint.
HOLD_NM_PER_RAD: Final = 10.0
HOLD_NM_S_PER_RAD: Final = 0.3
# Assumed: low stiffness for opening; damping as small as that of the joint, so that a finger under torque is at rest
# before the hold begins.
OPEN_NM_PER_RAD: Final = 1.0
OPEN_NM_S_PER_RAD: Final = 0.03
# Assumed: a closing joint follows an angle that moves by this amount at a constant speed, with the stiffness of a held
# joint, until the permitted torque is reached: it touches the object slowly. More than the range of any joint.
CLOSING_RAD: Final = 2.2


class GraspController:
    """Stateless controller of one grasp: joint torques from time, joint angles and joint velocities.

    Held joints follow their targets in all phases. The other joints hold their open angles with a low stiffness in the
    baseline, close at a constant speed until an obstacle requires a part of the planned torque, then tighten to the
    planned torque, and return to the open angles. At standstill in the hold phase their torque equals the planned
    torque times `torque_scale`. All torques are limited to `TORQUE_LIMIT_NM`. Raises ValueError for a scale below 0 or
    not finite.
    """

    def __init__(self, approach: Approach, timeline: Timeline, torque_scale: float = 1.0) -> None:
        """Create the joint controller of one grasp.

        approach: joint angles and torques of the grasp. timeline: durations of the phases. torque_scale: factor on the
        planned torques, at least 0.
        """
        if not 0 <= torque_scale < np.inf:
            raise ValueError(f"torque_scale: expected a finite number of at least 0, found {torque_scale}")
        self.approach = approach
        self.timeline = timeline
        self._is_held = approach.is_held
        self._target = np.where(self._is_held, approach.base_targets, approach.open_angles)
        self._planned_torque = approach.torque * torque_scale
        self._stiffness = np.where(self._is_held, HOLD_NM_PER_RAD, OPEN_NM_PER_RAD)
        self._damping = np.where(self._is_held, HOLD_NM_S_PER_RAD, OPEN_NM_S_PER_RAD)

    def compute_torque(self, t: float, angles: FloatArray, velocities: FloatArray) -> FloatArray:
        """Compute the motor torques f64[j], Nm, at `t` seconds after the start of the grasp.

        Held joints are controlled to their targets. The torque of a closing joint is a weighted mean of two torques:
        the closing torque, whose weight is the grip fraction of the timeline, and the torque of the position control to
        the open angle. The closing torque follows an angle that moves with constant speed. Its limit is the part of the
        planned torque that the timeline permits. angles: f64[j], radians. velocities: f64[j], radians per second.
        """
        fraction = self.timeline.get_grip_fraction(t)
        position_torque = self._stiffness * (self._target - angles)
        advance = np.sign(self._planned_torque) * CLOSING_RAD * self.timeline.get_closing_fraction(t)
        closing_torque = HOLD_NM_PER_RAD * (self._target + advance - angles)
        limit = np.abs(self._planned_torque) * self.timeline.get_tightening(t)
        torque = np.where(
            self._is_held,
            position_torque,
            fraction * closing_torque.clip(-limit, limit) + (1.0 - fraction) * position_torque,
        )
        torque -= self._damping * velocities
        return np.asarray(torque.clip(-TORQUE_LIMIT_NM, TORQUE_LIMIT_NM))
