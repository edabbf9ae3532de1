"""The arm that carries the hand: interface, simulated arm, and the UR5e over RTDE."""

from taxel.hand.arm.base import ARM_JOINT_NAMES, UPRIGHT_RAD, Arm
from taxel.hand.arm.errors import ArmBusyError, ArmConnectionError, ArmError, ArmLimitError, ArmPackageMissingError
from taxel.hand.arm.rtde import Ur5eArm
from taxel.hand.arm.simulated import SimulatedArm

__all__ = [
    "ARM_JOINT_NAMES",
    "UPRIGHT_RAD",
    "Arm",
    "ArmBusyError",
    "ArmConnectionError",
    "ArmError",
    "ArmLimitError",
    "ArmPackageMissingError",
    "SimulatedArm",
    "Ur5eArm",
]
