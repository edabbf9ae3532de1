"""Control of the Allegro hand from a ROS topic, with a safe stop when the topic stops.

The input is a topic of sensor_msgs/JointState commands, the output a topic of the measured angles.
"""

import threading
from collections.abc import Callable
from enum import Enum
from typing import Any, Final

import numpy as np

from taxel.errors import TaxelError
from taxel.hand.allegro.driver import AllegroHand
from taxel.hand.allegro.joints import JOINT_COUNT, JOINT_MAX_RAD, JOINT_MIN_RAD
from taxel.hand.allegro.position_control import PositionControl
from taxel.hand.joint_names import ROS_JOINT_NAMES
from taxel.ros.control_times import HOLD_AFTER_S, STOP_AFTER_S
from taxel.ros.joint_command import (
    JointCommand,
    JointCommandError,
    JointLimits,
    apply_original_rule,
    parse_command,
)
from taxel.ros.tf_tree import make_header
from taxel.ros.topics import TopicMessage
from taxel.types import FloatArray

DEFAULT_LIMITS: Final = JointLimits(JOINT_MIN_RAD, JOINT_MAX_RAD)


class JointTopicStoppedError(TaxelError):
    """Error: no valid joint command has arrived for too long; the motors are switched off."""


class ControlState(Enum):
    """State of the control: no command so far, following the latest command, or holding the position."""

    WAITING = "waiting"
    FOLLOWING = "following"
    HOLDING = "holding"


class HandControl:
    """Control that moves an open Allegro hand by the commands of a topic.

    `take` may be called from a thread other than that of `tick`. The first command starts the control; before it, the
    torques are 0 and there is no time limit. After `hold_after_s` without a valid command the hand holds the angles
    that it has at this time; after `stop_after_s`, `tick` raises JointTopicStoppedError. A rejected command does not
    restart these times. report: called with one line for each rejected command whose message differs from the last
    one, and when the hand begins to hold.
    """

    def __init__(
        self,
        hand: AllegroHand,
        clock: Callable[[], float],
        topic: str,
        report: Callable[[str], None],
        *,
        limits: JointLimits = DEFAULT_LIMITS,
        has_original_rule: bool = False,
        hold_after_s: float = HOLD_AFTER_S,
        stop_after_s: float = STOP_AFTER_S,
    ) -> None:
        """Create the control of an open hand.

        clock: returns the time in seconds. topic: name of the topic, for messages to the user. report: called with one
        line for the user. limits: permitted target angles. has_original_rule: commands are restricted as by
        `apply_original_rule`. Raises ValueError unless 0 < hold_after_s < stop_after_s.
        """
        if not 0.0 < hold_after_s < stop_after_s:
            raise ValueError("hold_after_s: expected more than 0 and less than stop_after_s")
        self._hand, self._clock, self._topic, self._report = hand, clock, topic, report
        self._limits, self._has_original_rule = limits, has_original_rule
        self._hold_after_s, self._stop_after_s = hold_after_s, stop_after_s
        self._lock = threading.Lock()
        self._command: JointCommand | None = None
        self._command_s = 0.0
        self._control = PositionControl()
        self._hold_angles: FloatArray | None = None
        self._last_rejection = ""
        self.state = ControlState.WAITING
        self.torques: FloatArray = np.zeros(JOINT_COUNT)
        self.commands = 0
        """Number of accepted commands."""
        self.rejected = 0
        """Number of rejected commands."""

    def take(self, names: list[str], position: list[float], effort: list[float]) -> None:
        """Accept the fields of a JointState message as the new command, or reject and report it.

        A rejected command leaves the previous command valid. A joint without a value keeps its previous command.
        """
        try:
            command = parse_command(self._topic, names, position, effort, self._limits)
        except JointCommandError as error:
            with self._lock:
                self.rejected += 1
                is_new = str(error) != self._last_rejection
                self._last_rejection = str(error)
            if is_new:
                self._report(str(error))
            return
        if self._has_original_rule:
            command = apply_original_rule(command)
        with self._lock:
            self._command = self._merge(command)
            self._command_s = self._clock()
            self.commands += 1

    def _merge(self, command: JointCommand) -> JointCommand:
        """Return the command, with the previous command for joints that have no value in the new one."""
        if self._command is None:
            return command
        is_absent = np.isnan(command.position) & np.isnan(command.torque)
        return JointCommand(
            np.where(is_absent, self._command.position, command.position),
            np.where(is_absent, self._command.torque, command.torque),
        )

    def tick(self) -> FloatArray:
        """Process the reports of the hand, send the torques, and return the measured angles, f64[16], radians.

        Raises JointTopicStoppedError after `stop_after_s`, and the errors of `AllegroHand.update`.
        """
        self._hand.update()
        angles = self._hand.read_joint_angles().angles
        if np.isfinite(angles).all():
            self._control.measure(angles, self._clock())
        with self._lock:
            command, age_s = self._command, self._clock() - self._command_s
        self.torques = self._compute_torques(command, age_s, angles)
        self._hand.set_torque(self.torques)
        return angles

    def _compute_torques(self, command: JointCommand | None, age_s: float, angles: FloatArray) -> FloatArray:
        """Compute the torques, shares of full PWM, f64[16], and update the state of the control.

        command: latest valid command; None before the first. age_s: time since this command, seconds. angles: measured
        angles, f64[16], radians. The torques are 0 without a command or with an unknown angle. Raises
        JointTopicStoppedError if the command is older than `stop_after_s`.
        """
        if command is None:
            return np.zeros(JOINT_COUNT)
        if age_s > self._stop_after_s:
            raise JointTopicStoppedError(
                f"{self._topic}: no valid joint command for {age_s:.1f} s: the hand held its position from "
                f"{self._hold_after_s:g} s on and its motors are now off; restart the publisher, then this command"
            )
        if not np.isfinite(angles).all():
            return np.zeros(JOINT_COUNT)
        if age_s <= self._hold_after_s:
            self.state, self._hold_angles = ControlState.FOLLOWING, None
            return self._control.compute_torques(command.position, command.torque)
        if self._hold_angles is None:
            self._hold_angles = angles
            self.state = ControlState.HOLDING
            self._report(f"{self._topic}: no valid joint command for {age_s:.1f} s: the hand holds its position")
        return self._control.compute_torques(self._hold_angles, np.zeros(JOINT_COUNT))

    def make_state_message(self, topic: str, angles: FloatArray, time_ns: int) -> TopicMessage:
        """Make the sensor_msgs/JointState message of measured angles; time_ns: Unix time, nanoseconds."""
        message: dict[str, Any] = {
            "header": make_header(time_ns, ""),
            "name": list(ROS_JOINT_NAMES),
            "position": angles,
            "velocity": self._control.velocities.copy(),
            "effort": self.torques,
        }
        return TopicMessage(topic, "sensor_msgs/JointState", time_ns, message)
