"""The plan of one approach: its waypoints in joint space, the linear approach of the palm, and their times."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from taxel.hand.arm.base import ARM_JOINT_NAMES
from taxel.planning.timing import SpeedLimits, TimedPath
from taxel.types import FloatArray

ARM_JOINTS = len(ARM_JOINT_NAMES)


@dataclass(frozen=True, eq=False)
class MotionPlan:
    """Collision-free motion of arm and hand from a start posture to a grasp; at rest at every waypoint.

    Attributes:
        what: name of the motion, such as "object cylinder, approach side_1".
        waypoints: joint angles from the start to the pre-grasp posture, f64[k, j], radians, k > 0; the arm's six joints
            first. Each step moves either arm joints or hand joints.
        grasping: arm and open hand at the object, f64[j]: end of the linear approach from the last waypoint. The
            withdrawal is the same motion backwards.
        limits: speeds and accelerations.
    """

    what: str
    waypoints: FloatArray
    grasping: FloatArray
    limits: SpeedLimits

    @cached_property
    def path(self) -> TimedPath:
        """The motion from the start to the pre-grasp posture."""
        return TimedPath(self.waypoints, self.limits)

    @cached_property
    def approach(self) -> TimedPath:
        """The linear approach of the palm from the pre-grasp posture to the object."""
        return TimedPath(np.stack([self.pregrasp, self.grasping]), self.limits)

    @property
    def pregrasp(self) -> FloatArray:
        """Arm and open hand before the linear approach, f64[j], radians."""
        return np.asarray(self.waypoints[-1])

    @property
    def duration_s(self) -> float:
        """Duration of the motion to the object, seconds."""
        return self.path.duration_s + self.approach.duration_s
