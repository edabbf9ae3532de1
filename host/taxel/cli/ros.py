"""`taxel ros`."""

import time
from typing import Annotated

import numpy as np
import numpy.typing as npt
import typer

from taxel.cli.joints import HELP, joint_angles
from taxel.hand.kinematics import kinematics_of
from taxel.recorder import joint_source
from taxel.ros.node import JointListener, Node, open_node
from taxel.ros.pace import Pace
from taxel.ros.topics import NS_PER_S, SkinTopics
from taxel.skin import Skin, open_skin
from taxel.stream.frame_stream import has_arrivals


def ros(
    url: Annotated[str, typer.Argument(help="serial:///dev/ttyUSB0, emulator:, file:skin.mcap ...")],
    hand: Annotated[str | None, typer.Option(help="Packaged hand or description file.")] = None,
    joints: Annotated[str, typer.Option(help=HELP)] = "",
    joint_topic: Annotated[
        str, typer.Option(help="Take the angles from this topic (sensor_msgs/JointState) instead; none: do not.")
    ] = "",
    version: Annotated[
        int | None, typer.Option("--ros", min=1, max=2, help="1 or 2; none: 2 if rclpy is there, else 1.")
    ] = None,
    seconds: Annotated[float, typer.Option(help="Stop after so many seconds of frames; 0: at Ctrl-C.")] = 0.0,
) -> None:
    """Publish a skin in ROS: a topic a sensor, the TF tree, joint states, activations, contact cloud, diagnostics.

    The first 100 cycles are the baseline: nothing may touch the skin. Needs ROS 1 (rospy) or ROS 2 (rclpy).

    Example: taxel ros "emulator:" --seconds 2
    """
    node = open_node(version)
    try:
        with open_skin(url, hand) as skin:
            publish_skin(skin, node, joint_angles(joints), joint_topic or None, seconds, Pace(None))
    finally:
        node.close()


def publish_skin(
    skin: Skin,
    node: Node | None,
    angles: npt.NDArray[np.float64] | None,
    joint_topic: str | None,
    seconds: float,
    pace: Pace,
) -> None:
    """Publish all frames of a skin; `node` None: open one. A recording's times are moved to now."""
    own = open_node() if node is None else node
    try:
        joints = joint_source(angles)
        if joint_topic is not None:
            joints = JointListener(own, joint_topic, kinematics_of(skin.hand).robot.joint_names)
        first_s: float | None = None
        topics: SkinTopics | None = None
        count = 0
        for frame in skin:
            pace.wait(frame.time_s)
            if topics is None:
                first_s = frame.time_s
                is_live = skin.link.is_real_time and has_arrivals(skin.link)
                now_ns = time.monotonic_ns() if is_live else round(frame.time_s * NS_PER_S)
                topics = SkinTopics(skin.hand, skin.hub, time.time_ns() - now_ns, joints)
            for message in topics.take(frame):
                if joint_topic is None or message.topic != "/joint_states":
                    own.publish(message)
            count += 1
            if not own.is_alive or (seconds and first_s is not None and frame.time_s - first_s >= seconds):
                break
        for message in topics.finish() if topics is not None else ():
            own.publish(message)
        print(f"{count} frames published")
    except KeyboardInterrupt:
        pass
    finally:
        if node is None:
            own.close()
