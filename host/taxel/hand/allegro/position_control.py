"""Torques of a position controller for the Allegro hand: proportional to the position error, with damping."""

from typing import Final

import numpy as np

from taxel.hand.allegro.joints import JOINT_COUNT
from taxel.types import FloatArray

STIFFNESS: Final = np.array(3 * [500.0, 800.0, 900.0, 500.0] + [1000.0, 700.0, 600.0, 600.0]) / 1200.0
"""Torque per position error, shares of full PWM per radian: usual start gains of the manufacturer's library, whose unit
is 1/1200 of full PWM. Larger values follow a command faster and press harder against an obstacle.
"""

DAMPING: Final = np.array(3 * [25.0, 50.0, 55.0, 40.0] + [50.0, 50.0, 50.0, 40.0]) / 1200.0
"""Torque per velocity, shares of full PWM per rad/s; source as for `STIFFNESS`. Smaller values overshoot."""

VELOCITY_FILTER_S: Final = 0.01
"""Time constant of the measured velocity, seconds: three control periods, against the steps of the encoders."""


class PositionControl:
    """Controller that computes torques from measured angles, target angles and additional torques."""

    def __init__(self) -> None:
        """Create a controller at rest."""
        self._angles: FloatArray | None = None
        self._time_s = 0.0
        self.velocities: FloatArray = np.zeros(JOINT_COUNT)
        """Filtered velocities, rad/s."""

    def measure(self, angles: FloatArray, time_s: float) -> None:
        """Update angles and filtered velocities from measured angles f64[16], radians, at `time_s` seconds.

        The velocities are unchanged at the first measurement, and if the time has not increased.
        """
        elapsed_s = time_s - self._time_s
        if self._angles is not None and elapsed_s > 0.0:
            # Weight of the new value in a first-order low-pass filter with the time constant `VELOCITY_FILTER_S`.
            share = elapsed_s / (elapsed_s + VELOCITY_FILTER_S)
            self.velocities += share * ((angles - self._angles) / elapsed_s - self.velocities)
        self._angles, self._time_s = angles.copy(), time_s

    def compute_torques(self, target: FloatArray, torque: FloatArray) -> FloatArray:
        """Compute torques f64[16], fractions of full PWM, clipped to -1 .. 1.

        target: f64[16], radians; NaN: no position control of the joint. torque: f64[16], added to the torques of the
        position control, fractions of full PWM; NaN is treated as 0.
        """
        angles = np.zeros(JOINT_COUNT) if self._angles is None else self._angles
        position = STIFFNESS * (target - angles) - DAMPING * self.velocities
        torques: FloatArray = np.where(np.isnan(target), 0.0, position) + np.nan_to_num(torque)
        return np.clip(torques, -1.0, 1.0)
