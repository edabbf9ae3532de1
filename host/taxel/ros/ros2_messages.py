"""ROS 2 messages from the messages of a skin, for the node of `taxel ros` and for the ROS 2 package `taxel_ros2`."""

import array
import importlib
from typing import Any

import numpy as np

from taxel.ros.definitions import PACKAGES, MessageField, fields
from taxel.ros.ros_import import RosError
from taxel.ros.topics import TopicMessage

QUEUE_LENGTH = 100
"""Depth of the history of a topic that is not latched, messages."""


class Ros2Messages:
    """Converter of messages into objects of the installed ROS 2 message packages."""

    def __init__(self) -> None:
        """Create a converter; a message class is imported when its first message is converted."""
        self._classes: dict[str, Any] = {}

    def load_class(self, type_name: str) -> Any:
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

    def convert(self, message: TopicMessage) -> Any:
        """Build the ROS 2 message object of a message. Raises `RosError` if its message package is not installed."""
        return self._make(message.type, message.message)

    def _make(self, type_name: str, values: dict[str, Any]) -> Any:
        """Build a ROS 2 message object of type `type_name` from its fields as a dict."""
        message = self.load_class(type_name)()
        for field in fields(type_name):
            setattr(message, field.name, self._convert_value(field, values[field.name]))
        return message

    def _convert_value(self, field: MessageField, value: Any) -> Any:
        """Convert the value of a message field to the Python type that the library rclpy requires."""
        if "/" in field.type:
            parts = [self._make(field.type, each) for each in (value if field.is_array else [value])]
            return parts if field.is_array else parts[0]
        if field.type == "byte" and not field.is_array:
            return bytes([value])  # rclpy represents an octet as bytes of length 1
        if field.is_array and field.type == "uint8":
            return array.array("B", bytes(np.asarray(value, np.uint8)) if not isinstance(value, bytes) else value)
        return np.asarray(value).tolist() if field.is_array else value


def make_qos_profile(is_latched: bool) -> Any:
    """Make the quality of service of a topic: volatile, or transient local with one message for a latched topic.

    Raises ImportError if rclpy is not installed.
    """
    qos = importlib.import_module("rclpy.qos")
    durability = qos.DurabilityPolicy
    return qos.QoSProfile(
        depth=1 if is_latched else QUEUE_LENGTH,
        durability=durability.TRANSIENT_LOCAL if is_latched else durability.VOLATILE,
    )
