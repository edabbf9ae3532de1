"""Simulated arm that follows its commands exactly, in virtual time."""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from taxel.hand.arm.base import ARM_JOINT_NAMES, check_target
from taxel.hand.arm.errors import ArmBusyError
from taxel.types import FloatArray

ACCELERATION_RAD_S2: Final = 1.4  # usual acceleration of a joint motion of UR arms
_NAME = "simulated arm"


@dataclass(frozen=True)
class TrapezoidalProfile:
    """Trapezoidal speed profile from rest to rest; triangular for a short distance.

    distance: above 0. speed: largest speed. acceleration: magnitude while accelerating and braking. The unit of the
    distance is arbitrary; times are in seconds.
    """

    distance: float
    speed: float
    acceleration: float

    @property
    def peak(self) -> float:
        """Largest speed that the motion reaches; below `speed` for a short motion."""
        return min(self.speed, math.sqrt(self.distance * self.acceleration))

    @property
    def duration_s(self) -> float:
        """Duration of the motion from rest to rest, seconds."""
        return self.distance / self.peak + self.peak / self.acceleration

    def evaluate(self, time_s: float) -> tuple[float, float]:
        """Compute (travelled distance in rad, speed in rad/s) of the trapezoidal speed profile at `time_s` seconds.

        The profile starts at 0 s: acceleration to the speed `peak`, constant speed, and deceleration until
        `duration_s`.
        """
        if time_s >= self.duration_s:
            return self.distance, 0.0
        remaining_s = self.duration_s - time_s
        ramp_s = self.peak / self.acceleration
        if time_s < ramp_s:
            return self.acceleration * time_s**2 / 2, self.acceleration * time_s
        if remaining_s < ramp_s:
            return self.distance - self.acceleration * remaining_s**2 / 2, self.acceleration * remaining_s
        return self.peak * (time_s - ramp_s / 2), self.peak


class SimulatedArm:
    """Arm whose joints move along a straight line in joint space with a trapezoidal speed profile.

    angles: start angles, f64[6], radians; default 0. acceleration_rad_s2: acceleration of the joint with the largest
    motion. Time advances only in `step`. Raises ArmLimitError for start angles outside the limits. Not modelled:
    dynamics, following error, collisions and safety limits of the controller.
    """

    def __init__(
        self, angles: npt.ArrayLike | None = None, *, acceleration_rad_s2: float = ACCELERATION_RAD_S2
    ) -> None:
        """Create a simulated arm at rest, whose time advances only in `step`.

        angles: start angles f64[6], radians; None: all 0. acceleration_rad_s2: acceleration of the joint with the
        largest motion. Raises ValueError for an acceleration that is not positive, and ArmLimitError for start angles
        outside the limits.
        """
        if not 0 < acceleration_rad_s2 < math.inf:
            raise ValueError(f"acceleration_rad_s2: expected a finite number above 0, found {acceleration_rad_s2}")
        start = np.zeros(len(ARM_JOINT_NAMES)) if angles is None else angles
        self._start_angles: FloatArray = check_target(_NAME, start, speed_rad_s=1.0)
        self._displacement: FloatArray = np.zeros_like(self._start_angles)  # target minus start
        self._acceleration = acceleration_rad_s2
        self._profile: TrapezoidalProfile | None = None
        self._elapsed_s = 0.0
        self._travelled = self._speed = 0.0  # of the joint with the largest motion, rad and rad/s
        self._is_braking = False

    @property
    def is_moving(self) -> bool:
        """Whether the arm is moving."""
        return self._profile is not None

    def read_joint_angles(self) -> FloatArray:
        """Return the present joint angles of the simulated arm, f64[6], radians."""
        if self._profile is None:
            return self._start_angles.copy()
        return self._start_angles + self._displacement * (self._travelled / self._profile.distance)

    def move_joints(self, target: npt.ArrayLike, speed_rad_s: float) -> None:
        """Start a motion to `target`, f64[6], radians, which `step` executes.

        Raises ArmLimitError before any motion, and ArmBusyError during a motion.
        """
        angles = check_target(_NAME, target, speed_rad_s)
        if self.is_moving:
            raise ArmBusyError(_NAME, "expected a standing arm, found a moving arm; wait, or call stop() first")
        self._displacement = angles - self._start_angles
        distance = float(np.abs(self._displacement).max())
        if distance > 0:
            self._profile = TrapezoidalProfile(distance, speed_rad_s, self._acceleration)
            self._elapsed_s = self._travelled = self._speed = 0.0
            self._is_braking = False

    def stop(self) -> None:
        """Brake along the path with the acceleration of the arm; takes effect in `step`."""
        self._is_braking = True

    def step(self, dt_s: float) -> None:
        """Advance the virtual time by `dt_s` seconds. Raises ValueError for a negative step."""
        if not dt_s >= 0:
            raise ValueError(f"dt_s: expected at least 0, found {dt_s}")
        if self._profile is None:
            return
        if self._is_braking:
            self._brake(dt_s, self._profile)
        else:
            self._elapsed_s += dt_s
            self._travelled, self._speed = self._profile.evaluate(self._elapsed_s)
        if self._speed == 0.0 and (self._is_braking or self._elapsed_s > 0):
            self._start_angles = self.read_joint_angles()
            self._profile = None

    def _brake(self, dt_s: float, profile: TrapezoidalProfile) -> None:
        """Decelerate the simulated arm along the path of its present motion for `dt_s` seconds, until it stands."""
        braking_s = min(dt_s, self._speed / self._acceleration)
        distance = self._speed * braking_s - self._acceleration * braking_s**2 / 2
        self._travelled = min(profile.distance, self._travelled + distance)
        self._speed = 0.0 if braking_s < dt_s else max(0.0, self._speed - self._acceleration * braking_s)
