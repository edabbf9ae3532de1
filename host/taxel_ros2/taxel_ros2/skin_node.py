"""Lifecycle node of a skin.

- unconfigured: no port is open.
- inactive (after configure): the hand description is checked and the publishers exist; no port is open.
- active (after activate): a thread reads the skin and publishes. After an error of the skin, such as a removed cable,
  the node logs the error in one line and returns to the state inactive, so that a supervisor can activate it again.

Not verified on a ROS 2 installation: tested with a substitute for rclpy.
"""

import threading
from collections.abc import Iterable
from typing import Any

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn
from std_srvs.srv import Trigger

from taxel.errors import TaxelError
from taxel.hand import Hand, load_hand
from taxel.hand.kinematics import build_kinematics
from taxel.proximity import ProximityWatch, open_watch
from taxel.ros.node import JointListener
from taxel.ros.pace import Pace
from taxel.ros.ros2_messages import QUEUE_LENGTH, Ros2Messages, make_qos_profile
from taxel.ros.topics import SkinTopics, TopicMessage, compute_epoch_offset_ns
from taxel.skin import Skin, open_skin
from taxel.stream.frame_stream import has_arrivals
from taxel_ros2.parameters import SkinParameters, declare_parameters, read_parameters

POLL_S = 0.1
"""Longest wait for a frame, seconds: also the longest delay of a transition out of the state active,
except in a gap of a recording."""


class SkinNode(LifecycleNode):
    """Node that publishes the topics of one skin (`taxel.ros.topics`) while it is active.

    The service `~/restart_baseline` measures the baseline again; nothing may touch the skin meanwhile.
    """

    def __init__(self, name: str = "taxel_skin") -> None:
        """Create the node in the state unconfigured."""
        super().__init__(name)
        declare_parameters(self)
        self._messages = Ros2Messages()
        self._topic_publishers: dict[str, Any] = {}
        self._values: SkinParameters | None = None
        self._hand: Hand | None = None
        self._service: Any = None
        self._subscription: Any = None
        self._timer: Any = None
        self._joints: JointListener | None = None
        self._thread: threading.Thread | None = None
        self._stop = threading.Event()
        self._has_baseline_request = threading.Event()

    def on_configure(self, state: Any) -> TransitionCallbackReturn:
        """Read the parameters and check the hand description.

        Returns FAILURE, with one line in the log, if the hand description is invalid.
        """
        try:
            self._values = read_parameters(self)
            self._hand = load_hand(self._values.hand) if self._values.hand else None
        except TaxelError as error:
            self.get_logger().error(str(error))
            return TransitionCallbackReturn.FAILURE
        self._service = self.create_service(Trigger, "~/restart_baseline", self._restart_baseline)
        return TransitionCallbackReturn.SUCCESS

    def on_activate(self, state: Any) -> TransitionCallbackReturn:
        """Open the skin and start publishing; FAILURE with one line in the log if the skin cannot be opened.

        FAILURE also for an invalid calibration of proximity, or for a joint topic with a hand without geometry.
        """
        assert self._values is not None
        self._stop.clear()
        try:
            skin = open_skin(self._values.url, self._hand)
        except TaxelError as error:
            self.get_logger().error(str(error))
            return TransitionCallbackReturn.FAILURE
        try:
            watch = open_watch(self._values.proximity_file, skin.hand) if self._values.proximity_file else None
            if self._values.joint_topic and self._joints is None:
                names = build_kinematics(skin.hand).robot.joint_names
                self._joints = JointListener(self, self._values.joint_topic, names)
        except TaxelError as error:
            skin.close()
            self.get_logger().error(str(error))
            return TransitionCallbackReturn.FAILURE
        self._timer = self.create_timer(POLL_S, self._check_thread)
        self._thread = threading.Thread(target=self._read, args=(skin, watch), daemon=True)
        self._thread.start()
        return super().on_activate(state)

    def on_deactivate(self, state: Any) -> TransitionCallbackReturn:
        """Stop publishing, and close the skin."""
        self._finish_reading()
        return super().on_deactivate(state)

    def on_cleanup(self, state: Any) -> TransitionCallbackReturn:
        """Remove publishers, service and subscription."""
        for publisher in self._topic_publishers.values():
            self.destroy_publisher(publisher)
        self._topic_publishers.clear()
        if self._service is not None:
            self.destroy_service(self._service)
            self._service = None
        if self._subscription is not None:
            self.destroy_subscription(self._subscription)
            self._subscription = self._joints = None
        return TransitionCallbackReturn.SUCCESS

    def on_shutdown(self, state: Any) -> TransitionCallbackReturn:
        """Close the skin, from any state."""
        self._finish_reading()
        return self.on_cleanup(state)

    def on_error(self, state: Any) -> TransitionCallbackReturn:
        """Close the skin and return to the state unconfigured."""
        return self.on_shutdown(state)

    def listen_to_joints(self, topic: str, callback: Any) -> None:
        """Call `callback(names, angles)` for each sensor_msgs/JointState message of a topic. Angles in radians."""

        def pass_joints(message: Any) -> None:
            """Call the callback with the names and angles of a message."""
            callback(list(message.name), list(message.position))

        message_class = self._messages.load_class("sensor_msgs/JointState")
        self._subscription = self.create_subscription(message_class, topic, pass_joints, QUEUE_LENGTH)

    def _read(self, skin: Skin, watch: ProximityWatch | None) -> None:
        """Read the skin and publish its topics until the node leaves the state active or the skin ends.

        Runs in a separate thread, and closes the skin at the end. An error of the skin is one line in the log.
        """
        topics: SkinTopics | None = None
        pace = Pace(1.0 if skin.link.is_recorded else None)
        try:
            with skin:
                while not self._stop.is_set():
                    for frame in skin.poll(POLL_S):
                        pace.wait(frame.time_s)
                        if topics is None or self._has_baseline_request.is_set():
                            self._has_baseline_request.clear()
                            topics = self._make_topics(skin, watch, frame.time_s)
                        self._publish(topics.take(frame))
        except EOFError:
            self._publish(topics.finish() if topics is not None else ())
            self.get_logger().info("end of the recording")
        except TaxelError as error:
            self.get_logger().error(str(error))

    def _make_topics(self, skin: Skin, watch: ProximityWatch | None, first_s: float) -> SkinTopics:
        """Make a converter from the skin's frames to ROS messages, which measures a new baseline.

        first_s: time of the next frame, seconds. In a recording, this frame gets the present time as its time stamp.
        """
        assert self._values is not None
        is_live = skin.link.is_real_time and has_arrivals(skin.link)
        offset_ns = compute_epoch_offset_ns(first_s, is_live)
        counts = self._values.baseline_frames, self._values.threshold_counts
        return SkinTopics(skin.hand, skin.hub, offset_ns, self._joints, *counts, proximity=watch)

    def _publish(self, messages: Iterable[TopicMessage]) -> None:
        """Publish messages; joint states are not published if another node sends them (parameter joint_topic)."""
        assert self._values is not None
        for message in messages:
            if not (self._values.joint_topic and message.topic == "/joint_states"):
                self._get_publisher(message).publish(self._messages.convert(message))

    def _get_publisher(self, message: TopicMessage) -> Any:
        """Return the publisher of the message's topic, which the first message of the topic creates."""
        if message.topic not in self._topic_publishers:
            self._topic_publishers[message.topic] = self.create_publisher(
                self._messages.load_class(message.type), message.topic, make_qos_profile(message.is_latched)
            )
        return self._topic_publishers[message.topic]

    def _check_thread(self) -> None:
        """Return to the state inactive if the skin has ended; called by a timer in the node's executor."""
        if self._thread is not None and not self._thread.is_alive() and not self._stop.is_set():
            self.trigger_deactivate()

    def _finish_reading(self) -> None:
        """Stop the thread that reads the skin, and wait until it has closed the skin."""
        self._stop.set()
        if self._timer is not None:
            self.destroy_timer(self._timer)
            self._timer = None
        if self._thread is not None:
            self._thread.join()
            self._thread = None

    def _restart_baseline(self, request: Any, response: Any) -> Any:
        """Answer the service `~/restart_baseline`: measure the baseline again from the next frame on.

        The response states success; False with a message if the node is not active.
        """
        response.success = self._thread is not None and self._thread.is_alive()
        response.message = "nothing may touch the skin" if response.success else "the node is not active"
        if response.success:
            self._has_baseline_request.set()
        return response


def main() -> None:
    """Run the node until ROS shuts down."""
    rclpy.init()
    node = SkinNode()
    try:
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.on_shutdown(None)
        node.destroy_node()
        rclpy.try_shutdown()
