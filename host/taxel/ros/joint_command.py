"""Joint commands for the Allegro hand as sensor_msgs/JointState messages, and their checks."""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from taxel.errors import TaxelError
from taxel.hand.allegro.joints import JOINT_COUNT, JOINT_NAMES
from taxel.hand.joint_names import ROBOT_JOINT_NAMES, ROS_JOINT_NAMES
from taxel.types import FloatArray

POSITION_JOINTS: Final = (0, 4, 8, 12, 13)
"""Joints that the original control node moves to positions; all others follow torques (facts of the original stack)."""

_INDEX: Final = {
    name: index for names in (ROS_JOINT_NAMES, JOINT_NAMES, ROBOT_JOINT_NAMES) for index, name in enumerate(names)
}


class JointCommandError(TaxelError, ValueError):
    """Error: a joint command is rejected; the message names topic and joint, and the previous command stays valid."""


class JointCommand(NamedTuple):
    """Checked command: target angles (radians) and torques (shares of full PWM), f64[16]; NaN: no value."""

    position: FloatArray
    torque: FloatArray


class JointLimits(NamedTuple):
    """Permitted target angles of the 16 joints, radians."""

    lower: FloatArray
    upper: FloatArray


def parse_command(
    topic: str, names: Sequence[str], position: Sequence[float], effort: Sequence[float], limits: JointLimits
) -> JointCommand:
    """Check the fields of a JointState message, and return the command. A joint without a value has NaN.

    topic: for error messages. names: `ROS_JOINT_NAMES`, the names of the driver or those of the robot; empty: all 16
    joints in order. position: radians. effort: shares of full PWM. Raises JointCommandError for an unknown or repeated
    name, a wrong number of values, a value that is not finite, an angle outside `limits`, or an effort outside -1 to 1.
    """
    indices = _find_joints(topic, names)
    values = {"position": list(position), "effort": list(effort)}
    if not position and not effort:
        raise JointCommandError(f"{topic}: command rejected: expected positions (rad) or efforts, found neither")
    for field, numbers in values.items():
        if numbers and len(numbers) != len(indices):
            raise JointCommandError(
                f"{topic}: command rejected: expected {len(indices)} values of {field}, found {len(numbers)}"
            )
    command = JointCommand(np.full(JOINT_COUNT, np.nan), np.full(JOINT_COUNT, np.nan))
    for index, value in zip(indices, values["position"], strict=False):
        command.position[index] = _check_value(topic, index, "rad", value, limits.lower[index], limits.upper[index])
    for index, value in zip(indices, values["effort"], strict=False):
        command.torque[index] = _check_value(topic, index, "of full PWM", value, -1.0, 1.0)
    return command


def apply_original_rule(command: JointCommand) -> JointCommand:
    """Return the command as the original node uses it: positions of `POSITION_JOINTS`, torques of the others."""
    is_position = np.isin(np.arange(JOINT_COUNT), POSITION_JOINTS)
    return JointCommand(np.where(is_position, command.position, np.nan), np.where(is_position, np.nan, command.torque))


def _find_joints(topic: str, names: Sequence[str]) -> list[int]:
    """Return the index of each named joint; all 16 indices without names.

    Raises JointCommandError for an unknown or repeated name.
    """
    if not names:
        return list(range(JOINT_COUNT))
    indices: list[int] = []
    for name in names:
        if name not in _INDEX:
            raise JointCommandError(
                f"{topic}: command rejected: unknown joint {str(name)[:40]!r}; expected joint_0.0 to joint_15.0"
            )
        if _INDEX[name] in indices:
            raise JointCommandError(f"{topic}: command rejected: joint {name} occurs twice; send each joint once")
        indices.append(_INDEX[name])
    return indices


def _check_value(topic: str, index: int, unit: str, value: float, low: float, high: float) -> float:
    """Return the value of the joint `index` if it is within `low` to `high`; otherwise raise JointCommandError.

    NaN and infinity are rejected, too. topic, unit: for the error message.
    """
    if not low <= value <= high:  # also false for nan
        raise JointCommandError(
            f"{topic}: command rejected: {ROS_JOINT_NAMES[index]} ({JOINT_NAMES[index]}): expected {low:g} to {high:g} "
            f"{unit}, found {value:g}; the previous command stays valid"
        )
    return float(value)
