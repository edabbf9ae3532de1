"""`taxel ros`."""

from typing import Annotated

import typer

from taxel.cli.joint_sources import choose_url_joints
from taxel.cli.options import HandOption, JointAngles, JointFile, JointTopic, ProximityFile, Seconds, Url
from taxel.hand.joint_history import JointHistory
from taxel.hand.kinematics import build_kinematics
from taxel.proximity import ProximityWatch, open_watch
from taxel.ros.node import JointListener, Node, open_node
from taxel.ros.original_topics import OriginalTopics
from taxel.ros.pace import Pace
from taxel.ros.topics import SkinTopics, compute_epoch_offset_ns
from taxel.skin import Skin, open_skin
from taxel.skin.recorder import make_joint_source
from taxel.stream.frame_stream import has_arrivals
from taxel.types import FloatArray


def ros(
    url: Url,
    hand: HandOption = None,
    joints: JointAngles = None,
    joint_topic: JointTopic = None,
    joint_file: JointFile = None,
    version: Annotated[
        int | None,
        typer.Option("--ros-version", min=1, max=2, help="ROS 1 or 2. Default: 2 if rclpy is installed, else 1."),
    ] = None,
    seconds: Seconds = None,
    proximity: ProximityFile = None,
    original_topics: Annotated[
        bool,
        typer.Option(
            "--original-topics",
            help="Publish only sensor_8_readings ... (TactileData), the topics of the original ROS stack.",
        ),
    ] = False,
) -> None:
    """Publish a skin as ROS topics.

    Topics: one for each sensor, the TF tree, joint states, activations, contact cloud and diagnostics. The first 100
    poll cycles are the baseline, during which nothing may touch the skin. With --proximity, the topics
    /taxel/BOARD/proximity contain distance, speed and kind of a target before contact. Needs rospy (ROS 1) or rclpy
    (ROS 2). With --original-topics: one topic sensor_ADDRESS_readings for each board, as the original ROS stack
    publishes it.

    Example: taxel ros "emulator:" --seconds 1
    """
    node = open_node(version)
    try:
        with open_skin(url, hand) as skin:
            angles = choose_url_joints(url, skin, joints, joint_file)
            watch = None if proximity is None else open_watch(proximity, skin.hand)
            publish_skin(skin, node, angles, joint_topic, seconds, Pace(None), original_topics, watch)
    finally:
        node.close()


def publish_skin(
    skin: Skin,
    node: Node | None,
    angles: FloatArray | JointHistory | None,
    joint_topic: str | None,
    seconds: float | None,
    pace: Pace,
    has_original_topics: bool = False,
    proximity: ProximityWatch | None = None,
) -> None:
    """Publish all frames of a skin as ROS topics until its end or until `seconds` have passed.

    node: ROS node; None: a new node, which is closed at the end. angles: f64[j], joint angles in radians, or measured
    angles over time. joint_topic: topic with the joint angles, used instead of `angles`. pace: delays the frames of a
    recording. has_original_topics: publish only the topics of the original ROS stack. proximity: estimators of targets
    before contact. The times of a recording are shifted such that its first frame has the present time. With
    `joint_topic`, joint states are not published, since another node publishes them.
    """
    publisher = open_node() if node is None else node
    try:
        joints = make_joint_source(angles)
        if joint_topic is not None:
            joints = JointListener(publisher, joint_topic, build_kinematics(skin.hand).robot.joint_names)
        first_s: float | None = None
        topics: SkinTopics | OriginalTopics | None = None
        count = 0
        for frame in skin:
            pace.wait(frame.time_s)
            if topics is None:
                first_s = frame.time_s
                is_live = skin.link.is_real_time and has_arrivals(skin.link)
                offset_ns = compute_epoch_offset_ns(frame.time_s, is_live)
                topics = (
                    OriginalTopics(skin.hand, offset_ns)
                    if has_original_topics
                    else SkinTopics(skin.hand, skin.hub, offset_ns, joints, proximity=proximity)
                )
            for message in topics.take(frame):
                if joint_topic is None or message.topic != "/joint_states":
                    publisher.publish(message)
            count += 1
            if not publisher.is_alive or (
                seconds is not None and first_s is not None and frame.time_s - first_s >= seconds
            ):
                break
        for message in topics.finish() if topics is not None else ():
            if joint_topic is None or message.topic != "/joint_states":
                publisher.publish(message)
        print(f"{count} frames published")
    except KeyboardInterrupt:
        pass
    finally:
        if node is None:
            publisher.close()
