"""Interface of an arm, and the limits of a UR5e."""

import math
from typing import Final, Protocol

import numpy as np
import numpy.typing as npt

from taxel.hand.arm.errors import ArmLimitError
from taxel.types import FloatArray

ARM_JOINT_NAMES: Final = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
JOINT_LIMIT_RAD: Final = (2 * math.pi, 2 * math.pi, math.pi, 2 * math.pi, 2 * math.pi, 2 * math.pi)
"""Largest absolute joint angles, radians. Source: manufacturer's description of the UR5e."""
MAX_SPEED_RAD_S: Final = math.pi
"""Largest joint speed. Source: UR5e data sheet, 180 degrees per second."""

UPRIGHT_RAD: Final = (0.0, -math.pi / 2, 0.0, -math.pi / 2, 0.0, 0.0)
"""Home position of UR arms, radians: upper arm and forearm vertical, far from table and object."""


class Arm(Protocol):
    """Arm with six joints. Angles are f64[6], radians, in the order of `ARM_JOINT_NAMES`."""

    @property
    def is_moving(self) -> bool:
        """Whether the arm is moving."""
        ...

    def read_joint_angles(self) -> FloatArray:
        """Read the measured joint angles, f64[6], radians."""
        ...

    def move_joints(self, target: npt.ArrayLike, speed_rad_s: float) -> None:
        """Start a motion in joint space to `target`, f64[6] radians, and return at once.

        `speed_rad_s`: speed of the joint with the largest motion. Raises ArmLimitError before any motion, and
        ArmBusyError while the arm is moving.
        """
        ...

    def stop(self) -> None:
        """Brake the arm along its path and return at once; `is_moving` becomes False at standstill."""
        ...


def check_target(arm: str, target: npt.ArrayLike, speed_rad_s: float) -> FloatArray:
    """Return `target` as f64[6]. Raises ArmLimitError for a target or speed outside the limits."""
    angles = np.array(target, dtype=np.float64)
    if angles.shape != (len(ARM_JOINT_NAMES),):
        raise ArmLimitError(arm, f"expected 6 joint angles, found shape {angles.shape}; the arm has not moved")
    for name, angle, limit in zip(ARM_JOINT_NAMES, angles.tolist(), JOINT_LIMIT_RAD, strict=True):
        if not abs(angle) <= limit:  # also true for NaN
            raise ArmLimitError(
                arm,
                f"{name}: expected {-limit:.4f} to {limit:.4f} rad, found {angle:.4f}; "
                "the arm has not moved; choose a target within the limits",
            )
    if not 0 < speed_rad_s <= MAX_SPEED_RAD_S:
        raise ArmLimitError(
            arm,
            f"speed: expected above 0 and at most {MAX_SPEED_RAD_S:.4f} rad/s, found {speed_rad_s}; "
            "the arm has not moved; choose a lower speed",
        )
    return angles
