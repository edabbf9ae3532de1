"""The skin as a node of ROS 2.

.. warning::
    Written against the documented interface of rclpy and tested with a stand-in; not yet run in a ROS 2.
"""

from __future__ import annotations

import array
import contextlib
import importlib
from collections.abc import Callable
from typing import Any

import numpy as np

from taxel.ros.definitions import MessageField, fields
from taxel.ros.find import RosError, import_ros2
from taxel.ros.topics import TopicMessage

QUEUE = 100


class Ros2Node:
    """Publishes topics through rclpy; latched ones with transient local durability.

    Raises RosError without rclpy, or without a message package (`taxel_msgs` is built by colcon).
    """

    def __init__(self, name: str = "taxel") -> None:
        self._rclpy = import_ros2()
        self._qos = importlib.import_module("rclpy.qos")
        self._rclpy.init()
        self._node = self._rclpy.create_node(name)
        self._classes: dict[str, Any] = {}
        self._publishers: dict[str, Any] = {}

    @property
    def is_alive(self) -> bool:
        """Whether the node is to go on."""
        return bool(self._rclpy.ok())

    def _class_of(self, type_name: str) -> Any:
        if type_name not in self._classes:
            package, _, leaf = type_name.partition("/")
            try:
                self._classes[type_name] = getattr(importlib.import_module(f"{package}.msg"), leaf)
            except (ImportError, AttributeError):
                raise RosError(
                    f"ROS 2 has no message {package}/msg/{leaf}; put the folder taxel/ros/taxel_msgs of this package "
                    "into your workspace's src, then: colcon build --packages-select taxel_msgs"
                    if package == "taxel_msgs"
                    else f"ROS 2 has no message {package}/msg/{leaf}; install the package {package}"
                ) from None
        return self._classes[type_name]

    def publish(self, message: TopicMessage) -> None:
        """Send a message; the topic is advertised with the first one. Serves what has arrived meanwhile."""
        publisher = self._publishers.get(message.topic)
        if publisher is None:
            durability = self._qos.DurabilityPolicy
            profile = self._qos.QoSProfile(
                depth=1 if message.is_latched else QUEUE,
                durability=durability.TRANSIENT_LOCAL if message.is_latched else durability.VOLATILE,
            )
            publisher = self._node.create_publisher(self._class_of(message.type), message.topic, profile)
            self._publishers[message.topic] = publisher
        publisher.publish(self._filled(message.type, message.message))
        self._rclpy.spin_once(self._node, timeout_sec=0.0)

    def _filled(self, type_name: str, values: dict[str, Any]) -> Any:
        made = self._class_of(type_name)()
        for field in fields(type_name):
            setattr(made, field.name, self._value(field, values[field.name]))
        return made

    def _value(self, field: MessageField, value: Any) -> Any:
        if "/" in field.type:
            one = [self._filled(field.type, each) for each in (value if field.is_array else [value])]
            return one if field.is_array else one[0]
        if field.type == "byte" and not field.is_array:
            return bytes([value])  # rclpy has octets as bytes of length 1
        if field.is_array and field.type == "uint8":
            return array.array("B", bytes(np.asarray(value, np.uint8)) if not isinstance(value, bytes) else value)
        return np.asarray(value).tolist() if field.is_array else value

    def listen_to_joints(self, topic: str, take: Callable[[list[str], list[float]], None]) -> None:
        """Call `take(names, angles)` with each sensor_msgs/JointState of a topic."""
        kind = self._class_of("sensor_msgs/JointState")
        self._node.create_subscription(
            kind, topic, lambda message: take(list(message.name), list(message.position)), QUEUE
        )

    def close(self) -> None:
        """Leave the graph."""
        with contextlib.suppress(Exception):  # a Ctrl-C may have ended rclpy already
            self._node.destroy_node()
            self._rclpy.shutdown()
