"""A ROS 2 node that publishes the topics of the skin.

.. warning::
    Written for the documented interface of rclpy and tested with a substitute; not yet run with a ROS 2 installation.
"""

import contextlib
from collections.abc import Callable
from typing import Any

from taxel.ros.ros2_messages import QUEUE_LENGTH, Ros2Messages, make_qos_profile
from taxel.ros.ros_import import import_ros2
from taxel.ros.topics import TopicMessage


class Ros2Node:
    """ROS 2 node that publishes topics with rclpy; latched topics have the durability transient local.

    Raises RosError if rclpy or a message package is not installed (colcon builds `taxel_msgs`).
    """

    def __init__(self, name: str = "taxel") -> None:
        """Create a ROS 2 node; raise RosError if rclpy or a message package is not installed."""
        self._rclpy = import_ros2()
        self._rclpy.init()
        self._node = self._rclpy.create_node(name)
        self._messages = Ros2Messages()
        self._publishers: dict[str, Any] = {}

    @property
    def is_alive(self) -> bool:
        """False after ROS has shut the node down."""
        return bool(self._rclpy.ok())

    def publish(self, message: TopicMessage) -> None:
        """Publish a message, then run the callbacks of received messages. The first message advertises the topic."""
        publisher = self._publishers.get(message.topic)
        if publisher is None:
            profile = make_qos_profile(message.is_latched)
            publisher = self._node.create_publisher(self._messages.load_class(message.type), message.topic, profile)
            self._publishers[message.topic] = publisher
        publisher.publish(self._messages.convert(message))
        self._rclpy.spin_once(self._node, timeout_sec=0.0)

    def listen_to_joints(self, topic: str, callback: Callable[[list[str], list[float]], None]) -> None:
        """Call `callback(names, angles)` for each sensor_msgs/JointState message of a topic. Angles in radians."""
        self.listen(
            topic, "sensor_msgs/JointState", lambda message: callback(list(message.name), list(message.position))
        )

    def listen(self, topic: str, type_name: str, callback: Callable[[Any], None]) -> None:
        """Call `callback(message)` for each message of a topic; type_name: "package/Name".

        The callback runs only while `publish` or `wait` is called, in the caller's thread.
        """
        self._node.create_subscription(self._messages.load_class(type_name), topic, callback, QUEUE_LENGTH)

    def wait(self, timeout_s: float) -> None:
        """Wait up to `timeout_s` seconds for one callback of a received message, and run this callback."""
        self._rclpy.spin_once(self._node, timeout_sec=timeout_s)

    def close(self) -> None:
        """Shut the ROS 2 node down."""
        with contextlib.suppress(Exception):  # Ctrl-C may have shut rclpy down already
            self._node.destroy_node()
            self._rclpy.shutdown()
