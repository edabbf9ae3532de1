"""An arm that follows its commands exactly, in virtual time."""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from taxel.hand.arm.base import ARM_JOINT_NAMES, checked_target
from taxel.hand.arm.errors import ArmBusyError
from taxel.types import FloatArray

ACCELERATION_RAD_S2: Final = 1.4  # usual joint acceleration of a UR joint move
_NAME = "simulated arm"


@dataclass(frozen=True)
class TrapezoidalProfile:
    """Distance over time from rest to rest: accelerate, keep the speed, brake; a triangle where the way is short.

    distance: more than 0. speed: highest. acceleration: also of the braking. Any unit of length, seconds.
    """

    distance: float
    speed: float
    acceleration: float

    @property
    def peak(self) -> float:
        """Highest speed reached."""
        return min(self.speed, math.sqrt(self.distance * self.acceleration))

    @property
    def duration_s(self) -> float:
        """Seconds from rest to rest."""
        return self.distance / self.peak + self.peak / self.acceleration

    def at(self, time_s: float) -> tuple[float, float]:
        """(distance travelled, speed) after so many seconds."""
        if time_s >= self.duration_s:
            return self.distance, 0.0
        left_s = self.duration_s - time_s
        ramp_s = self.peak / self.acceleration
        if time_s < ramp_s:
            return self.acceleration * time_s**2 / 2, self.acceleration * time_s
        if left_s < ramp_s:
            return self.distance - self.acceleration * left_s**2 / 2, self.acceleration * left_s
        return self.peak * (time_s - ramp_s / 2), self.peak


class SimulatedArm:
    """Six joints that move together along a straight line in joint space; the furthest one follows the profile.

    angles: f64[6], radians, start; default is all zero. acceleration_rad_s2: of the joint that moves furthest.

    Time passes in `step` only. Raises ArmLimitError for a start outside the limits. Not modelled: dynamics, following
    error, collisions, and the controller's own safety limits.
    """

    def __init__(
        self, angles: npt.ArrayLike | None = None, *, acceleration_rad_s2: float = ACCELERATION_RAD_S2
    ) -> None:
        if not 0 < acceleration_rad_s2 < math.inf:
            raise ValueError(f"acceleration_rad_s2: expected more than 0, found {acceleration_rad_s2}")
        start = np.zeros(len(ARM_JOINT_NAMES)) if angles is None else angles
        self._from: FloatArray = checked_target(_NAME, start, speed_rad_s=1.0)
        self._way: FloatArray = np.zeros_like(self._from)  # from start to target
        self._acceleration = acceleration_rad_s2
        self._profile: TrapezoidalProfile | None = None
        self._since_s = 0.0
        self._travelled = self._speed = 0.0  # of the joint that moves furthest, rad and rad/s
        self._is_braking = False

    @property
    def is_moving(self) -> bool:
        """Whether a motion is under way."""
        return self._profile is not None

    def read_joint_angles(self) -> FloatArray:
        """Angles, f64[6], radians."""
        if self._profile is None:
            return self._from.copy()
        return self._from + self._way * (self._travelled / self._profile.distance)

    def move_joints(self, target: npt.ArrayLike, speed_rad_s: float) -> None:
        """Start moving to f64[6] radians. Raises ArmLimitError before any motion, ArmBusyError during one."""
        wanted = checked_target(_NAME, target, speed_rad_s)
        if self.is_moving:
            raise ArmBusyError(_NAME, "expected a standing arm, found it moving; wait, or stop() it first")
        self._way = wanted - self._from
        distance = float(np.abs(self._way).max())
        if distance > 0:
            self._profile = TrapezoidalProfile(distance, speed_rad_s, self._acceleration)
            self._since_s = self._travelled = self._speed = 0.0
            self._is_braking = False

    def stop(self) -> None:
        """Brake along the path with the arm's acceleration."""
        self._is_braking = True

    def step(self, dt_s: float) -> None:
        """Let `dt_s` virtual seconds pass. Raises ValueError for a negative step."""
        if not dt_s >= 0:
            raise ValueError(f"dt_s: expected at least 0, found {dt_s}")
        if self._profile is None:
            return
        if self._is_braking:
            self._brake(dt_s, self._profile)
        else:
            self._since_s += dt_s
            self._travelled, self._speed = self._profile.at(self._since_s)
        if self._speed == 0.0 and (self._is_braking or self._since_s > 0):
            self._from = self.read_joint_angles()
            self._profile = None

    def _brake(self, dt_s: float, profile: TrapezoidalProfile) -> None:
        braking_s = min(dt_s, self._speed / self._acceleration)
        way = self._speed * braking_s - self._acceleration * braking_s**2 / 2
        self._travelled = min(profile.distance, self._travelled + way)
        self._speed = 0.0 if braking_s < dt_s else max(0.0, self._speed - self._acceleration * braking_s)
