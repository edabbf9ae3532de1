"""A ROS 2 node that publishes the topics of the skin.

.. warning::
    Written for the documented interface of rclpy and tested with a substitute; not yet run with a ROS 2 installation.
"""

import array
import contextlib
import importlib
from collections.abc import Callable
from typing import Any

import numpy as np

from taxel.ros.definitions import PACKAGES, MessageField, fields
from taxel.ros.ros_import import RosError, import_ros2
from taxel.ros.topics import TopicMessage

QUEUE_LENGTH = 100
"""Depth of the history of a topic that is not latched, messages."""


class Ros2Node:
    """ROS 2 node that publishes topics with rclpy; latched topics have the durability transient local.

    Raises RosError if rclpy or a message package is not installed (colcon builds `taxel_msgs`).
    """

    def __init__(self, name: str = "taxel") -> None:
        """Create a ROS 2 node; raise RosError if rclpy or a message package is not installed."""
        self._rclpy = import_ros2()
        self._qos = importlib.import_module("rclpy.qos")
        self._rclpy.init()
        self._node = self._rclpy.create_node(name)
        self._classes: dict[str, Any] = {}
        self._publishers: dict[str, Any] = {}

    @property
    def is_alive(self) -> bool:
        """False after ROS has shut the node down."""
        return bool(self._rclpy.ok())

    def _load_class(self, type_name: str) -> Any:
        """Return the ROS 2 message class of "package/Name". Raises `RosError` if its package is not installed."""
        if type_name not in self._classes:
            package, _, leaf = type_name.partition("/")
            try:
                self._classes[type_name] = getattr(importlib.import_module(f"{package}.msg"), leaf)
            except (ImportError, AttributeError):
                raise RosError(
                    f"ROS 2 has no message {package}/msg/{leaf}; put the folder taxel/ros/{package} of this package "
                    f"into your workspace's src, then: colcon build --packages-select {package}"
                    if package in PACKAGES
                    else f"ROS 2 has no message {package}/msg/{leaf}; install the package {package}"
                ) from None
        return self._classes[type_name]

    def publish(self, message: TopicMessage) -> None:
        """Publish a message, then run the callbacks of received messages. The first message advertises the topic."""
        publisher = self._publishers.get(message.topic)
        if publisher is None:
            durability = self._qos.DurabilityPolicy
            profile = self._qos.QoSProfile(
                depth=1 if message.is_latched else QUEUE_LENGTH,
                durability=durability.TRANSIENT_LOCAL if message.is_latched else durability.VOLATILE,
            )
            publisher = self._node.create_publisher(self._load_class(message.type), message.topic, profile)
            self._publishers[message.topic] = publisher
        publisher.publish(self._make_ros_message(message.type, message.message))
        self._rclpy.spin_once(self._node, timeout_sec=0.0)

    def _make_ros_message(self, type_name: str, values: dict[str, Any]) -> Any:
        """Build a ROS 2 message object of type `type_name` from its fields as a dict."""
        message = self._load_class(type_name)()
        for field in fields(type_name):
            setattr(message, field.name, self._convert_value(field, values[field.name]))
        return message

    def _convert_value(self, field: MessageField, value: Any) -> Any:
        """Convert the value of a message field to the Python type that the library rclpy requires."""
        if "/" in field.type:
            parts = [self._make_ros_message(field.type, each) for each in (value if field.is_array else [value])]
            return parts if field.is_array else parts[0]
        if field.type == "byte" and not field.is_array:
            return bytes([value])  # rclpy represents an octet as bytes of length 1
        if field.is_array and field.type == "uint8":
            return array.array("B", bytes(np.asarray(value, np.uint8)) if not isinstance(value, bytes) else value)
        return np.asarray(value).tolist() if field.is_array else value

    def listen_to_joints(self, topic: str, callback: Callable[[list[str], list[float]], None]) -> None:
        """Call `callback(names, angles)` for each sensor_msgs/JointState message of a topic. Angles in radians."""
        self.listen(
            topic, "sensor_msgs/JointState", lambda message: callback(list(message.name), list(message.position))
        )

    def listen(self, topic: str, type_name: str, callback: Callable[[Any], None]) -> None:
        """Call `callback(message)` for each message of a topic, in `publish` or `wait`. type_name: "package/Name"."""
        self._node.create_subscription(self._load_class(type_name), topic, callback, QUEUE_LENGTH)

    def wait(self, timeout_s: float) -> None:
        """Wait up to `timeout_s` seconds for one callback of a received message, and run this callback."""
        self._rclpy.spin_once(self._node, timeout_sec=timeout_s)

    def close(self) -> None:
        """Shut the ROS 2 node down."""
        with contextlib.suppress(Exception):  # a Ctrl-C may have shut rclpy down already
            self._node.destroy_node()
            self._rclpy.shutdown()
