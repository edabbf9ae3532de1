"""Time parametrisation of a path: rest to rest on every segment, with limited joint speeds and accelerations.

Every segment is a straight line in joint space with a trapezoidal speed profile. An arm executes exactly this motion
for one joint command (moveJ of the UR5e), so that its path is the checked path; blending would leave it.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from taxel.hand.arm.base import ARM_JOINT_NAMES, MAX_SPEED_RAD_S
from taxel.hand.arm.simulated import ACCELERATION_RAD_S2, TrapezoidalProfile
from taxel.types import FloatArray

ARM_SPEED_RAD_S: Final = 0.5
"""Speed of arm joints in a plan (chosen): a sixth of the largest speed of the UR5e."""

HAND_SPEED_RAD_S: Final = 1.0
"""Speed of hand joints in a plan (chosen): a finger opens or closes in one to two seconds."""

HAND_ACCELERATION_RAD_S2: Final = 5.0
"""Acceleration of hand joints in a plan (chosen): 0.2 s to the full speed."""


@dataclass(frozen=True)
class SpeedLimits:
    """Limits of arm and hand joints: speeds in rad/s and accelerations in rad/s2.

    Raises ValueError for a value that is not above 0, or an arm speed above that of the UR5e.
    """

    arm_speed: float = ARM_SPEED_RAD_S
    arm_acceleration: float = ACCELERATION_RAD_S2
    hand_speed: float = HAND_SPEED_RAD_S
    hand_acceleration: float = HAND_ACCELERATION_RAD_S2

    def __post_init__(self) -> None:
        """Raise ValueError for a limit that is not above 0, or an arm speed above that of the UR5e."""
        for name in ("arm_speed", "arm_acceleration", "hand_speed", "hand_acceleration"):
            if not 0 < getattr(self, name) < np.inf:
                raise ValueError(f"{name}: expected a finite number above 0, found {getattr(self, name)}")
        if self.arm_speed > MAX_SPEED_RAD_S:
            raise ValueError(f"arm_speed: expected at most {MAX_SPEED_RAD_S:.4f} rad/s, found {self.arm_speed}")

    def get_joint_limits(self, joints: int) -> tuple[FloatArray, FloatArray]:
        """Return speeds and accelerations of all joints, the arm's first, f64[joints] each."""
        hand = joints - len(ARM_JOINT_NAMES)
        speed = np.r_[np.full(len(ARM_JOINT_NAMES), self.arm_speed), np.full(hand, self.hand_speed)]
        acceleration = np.full(len(ARM_JOINT_NAMES), self.arm_acceleration)
        return speed, np.r_[acceleration, np.full(hand, self.hand_acceleration)]


@dataclass(frozen=True, eq=False)
class TimedPath:
    """Waypoints f64[k, j], radians, and the speed profile between each two; rests at every waypoint."""

    waypoints: FloatArray
    limits: SpeedLimits

    def _make_profiles(self) -> list[TrapezoidalProfile | None]:
        """Make the speed profile of every segment, for its fraction from 0 to 1; None for a segment without motion."""
        speed, acceleration = self.limits.get_joint_limits(self.waypoints.shape[1])
        profiles: list[TrapezoidalProfile | None] = []
        for step in np.abs(np.diff(self.waypoints, axis=0)):
            moving = step > 0
            profiles.append(
                TrapezoidalProfile(
                    1.0, float((speed[moving] / step[moving]).min()), float((acceleration[moving] / step[moving]).min())
                )
                if moving.any()
                else None
            )
        return profiles

    @property
    def durations_s(self) -> FloatArray:
        """Duration of every segment, f64[k - 1], seconds."""
        return np.array([profile.duration_s if profile is not None else 0.0 for profile in self._make_profiles()])

    @property
    def duration_s(self) -> float:
        """Duration of the path, seconds."""
        return float(self.durations_s.sum())

    def sample(self, times_s: FloatArray) -> FloatArray:
        """Compute the joint angles f64[t, j] at times f64[t] after the start; outside the path, those of its ends."""
        ends = np.cumsum(self.durations_s)
        result = np.empty((len(times_s), self.waypoints.shape[1]))
        profiles = self._make_profiles()
        for row, time_s in enumerate(times_s.tolist()):
            segment = int(np.searchsorted(ends, time_s, side="right"))
            if segment >= len(profiles):
                result[row] = self.waypoints[-1]
                continue
            elapsed_s = time_s - (ends[segment - 1] if segment else 0.0)
            profile = profiles[segment]
            share = profile.evaluate(elapsed_s)[0] if profile is not None and elapsed_s > 0 else 0.0
            result[row] = self.waypoints[segment] + share * (self.waypoints[segment + 1] - self.waypoints[segment])
        return result


def compute_duration_s(path: FloatArray, limits: SpeedLimits) -> float:
    """Compute the duration of a path f64[k, j] with rests at every waypoint, seconds."""
    return TimedPath(path, limits).duration_s
