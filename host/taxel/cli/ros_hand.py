"""`taxel ros-hand`."""

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Annotated

import numpy as np
import typer

from taxel.cli.options import HandOption, Seconds
from taxel.errors import TaxelError
from taxel.hand import load_hand
from taxel.hand.control_loop import ControlLoop
from taxel.hand.joint_names import ROBOT_JOINT_NAMES
from taxel.hand.kinematics import build_kinematics
from taxel.ros.control_times import HOLD_AFTER_S, STOP_AFTER_S
from taxel.ros.node import Node, open_node

if TYPE_CHECKING:  # python-can is optional
    from taxel.hand.allegro import AllegroHand
    from taxel.ros.hand_control import HandControl
    from taxel.ros.joint_command import JointLimits

VIRTUAL_HAND = "can:emulated"


def ros_hand(
    can_url: Annotated[
        str, typer.Argument(help=f"CAN channel: can:socketcan:can0, can:pcan:..., or {VIRTUAL_HAND} (virtual hand).")
    ],
    prefix: Annotated[str, typer.Option(help="Prefix of the topics joint_cmd and joint_states.")] = "allegroHand_0",
    hold_after_s: Annotated[
        float, typer.Option(min=0.01, help="Hold the position after this time without a command, seconds.")
    ] = HOLD_AFTER_S,
    stop_after_s: Annotated[
        float, typer.Option(min=0.02, help="Switch the motors off after this time without a command, seconds.")
    ] = STOP_AFTER_S,
    original_rule: Annotated[
        bool,
        typer.Option("--original-rule", help="Positions for joints 0, 4, 8, 12, 13 only, efforts for the others."),
    ] = False,
    hand: HandOption = None,
    version: Annotated[
        int | None,
        typer.Option("--ros-version", min=1, max=2, help="ROS 1 or 2. Default: 2 if rclpy is installed, else 1."),
    ] = None,
    seconds: Seconds = None,
) -> None:
    """Control the Allegro hand from ROS: joint commands in, measured joint angles out.

    Reads PREFIX/joint_cmd (sensor_msgs/JointState: positions in radians, or efforts as shares of full PWM) and
    publishes PREFIX/joint_states. If the commands stop, the hand holds its position, and then its motors are switched
    off with one error line.

    Example: taxel ros-hand can:emulated --seconds 1
    """
    if hold_after_s >= stop_after_s:
        raise TaxelError("--hold-after-s: expected less than --stop-after-s; the hand holds its position in between")
    from taxel.ros.hand_control import HandControl  # needs python-can, which is optional

    limits = read_limits(hand)
    node = open_node(version)
    try:
        with open_hand(can_url) as driver:
            topic = f"{prefix}/joint_cmd"
            control = HandControl(
                driver, time.monotonic, topic, report_line, limits=limits, has_original_rule=original_rule,
                hold_after_s=hold_after_s, stop_after_s=stop_after_s,
            )  # fmt: skip
            run_control(control, node, prefix, seconds)
    finally:
        node.close()


def report_line(text: str) -> None:
    """Print a line to standard error."""
    print(text, file=sys.stderr, flush=True)


def read_limits(hand: str | None) -> "JointLimits":
    """Return the joint limits of the Allegro hand, from the robot description of a hand; None: the original hand.

    Raises TaxelError for a robot that lacks a joint of the Allegro hand.
    """
    from taxel.ros.joint_command import JointLimits

    robot = build_kinematics(load_hand(hand or "original")).robot
    names = list(robot.joint_names)
    missing = [name for name in ROBOT_JOINT_NAMES if name not in names]
    if missing:
        raise TaxelError(f"robot '{robot.name}' has no joint {missing[0]}; use the description of an Allegro hand")
    order = [names.index(name) for name in ROBOT_JOINT_NAMES]
    return JointLimits(robot.lower[order], robot.upper[order])


def run_control(control: "HandControl", node: Node, prefix: str, seconds: float | None) -> None:
    """Follow joint commands and publish the measured angles until Ctrl-C, for `seconds`, or until ROS ends.

    prefix: prefix of the topics. At the end, the numbers of followed and rejected commands are printed.
    """
    node.listen(
        f"{prefix}/joint_cmd",
        "sensor_msgs/JointState",
        lambda message: control.take(list(message.name), list(message.position), list(message.effort)),
    )
    loop = ControlLoop()
    end_s = float("inf") if seconds is None else time.monotonic() + seconds
    try:
        while node.is_alive and time.monotonic() < end_s:
            loop.wait()
            angles = control.tick()
            if np.isfinite(angles).all():
                node.publish(control.make_state_message(f"{prefix}/joint_states", angles, time.time_ns()))
            else:
                node.wait(0.0)
    except KeyboardInterrupt:
        pass
    finally:
        print(f"{control.commands} commands followed, {control.rejected} rejected")


@contextmanager
def open_hand(url: str) -> Iterator["AllegroHand"]:
    """Context manager: the driver of the hand on a CAN channel, or of a virtual hand for the URL `VIRTUAL_HAND`.

    The motors of the hand are switched on inside the block.
    """
    from taxel.hand.allegro import AllegroHand, open_bus
    from taxel.hand.allegro.emulated_bus import EmulatedBus

    bus = EmulatedBus(time.monotonic) if url == VIRTUAL_HAND else open_bus(url)
    try:
        with AllegroHand(bus, clock=time.monotonic) as driver:
            yield driver
    finally:
        bus.shutdown()
