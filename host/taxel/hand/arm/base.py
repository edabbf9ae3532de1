"""What the rest of the library asks of an arm, and what a UR5e will not do."""

import math
from typing import Final, Protocol

import numpy as np
import numpy.typing as npt

from taxel.hand.arm.errors import ArmLimitError
from taxel.types import FloatArray

ARM_JOINT_NAMES: Final = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
# Radians, plus and minus. Source: the maker's description of the UR5e: one turn each way, the elbow half of it.
JOINT_LIMIT_RAD: Final = (2 * math.pi, 2 * math.pi, math.pi, 2 * math.pi, 2 * math.pi, 2 * math.pi)
MAX_SPEED_RAD_S: Final = math.pi  # of every joint; source: UR5e data sheet, 180 degrees a second


class Arm(Protocol):
    """A six-joint arm. Angles are f64[6], radians, in the order of `ARM_JOINT_NAMES`."""

    @property
    def is_moving(self) -> bool:
        """Whether a motion is under way."""
        ...

    def read_joint_angles(self) -> FloatArray:
        """Measured angles, f64[6], radians."""
        ...

    def move_joints(self, target: npt.ArrayLike, speed_rad_s: float) -> None:
        """Start moving in joint space to f64[6] radians and return at once; `speed_rad_s` is that of the joint that
        moves furthest. Raises ArmLimitError, before any motion, and ArmBusyError while a motion is under way.
        """
        ...

    def stop(self) -> None:
        """Brake along the path; `is_moving` says when the arm stands."""
        ...


def checked_target(arm: str, target: npt.ArrayLike, speed_rad_s: float) -> FloatArray:
    """`target` as f64[6]. Raises ArmLimitError, naming the joint, for what the arm will not do."""
    angles = np.array(target, dtype=np.float64)
    if angles.shape != (len(ARM_JOINT_NAMES),):
        raise ArmLimitError(arm, f"expected 6 joint angles, found shape {angles.shape}; the arm has not moved")
    for name, angle, limit in zip(ARM_JOINT_NAMES, angles.tolist(), JOINT_LIMIT_RAD, strict=True):
        if not abs(angle) <= limit:  # refuses NaN too
            raise ArmLimitError(
                arm,
                f"{name}: expected {-limit:.4f} to {limit:.4f} rad, found {angle:.4f}; "
                "the arm has not moved, choose a target within the limits",
            )
    if not 0 < speed_rad_s <= MAX_SPEED_RAD_S:
        raise ArmLimitError(
            arm,
            f"speed: expected above 0 and at most {MAX_SPEED_RAD_S:.4f} rad/s, found {speed_rad_s}; "
            "the arm has not moved, choose a slower speed",
        )
    return angles
