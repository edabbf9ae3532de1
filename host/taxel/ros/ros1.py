"""The skin as a node of ROS 1."""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import Any

from taxel.ros.definitions import fields, ros1_schema
from taxel.ros.find import RosError, import_ros1
from taxel.ros.topics import TopicMessage

QUEUE = 100


class Ros1Node:
    """Publishes topics through rospy. One in a process, as rospy has it.

    Message classes are made from the definitions, so that no package must be built; a subscriber that has none builds
    `taxel_msgs`. Raises RosError without rospy, or where no master answers.
    """

    def __init__(self, name: str = "taxel") -> None:
        self._rospy = import_ros1()
        import genpy.dynamic  # type: ignore[import-not-found, unused-ignore]  # comes with rospy
        import rosgraph  # type: ignore[import-not-found, unused-ignore]

        self._generate = genpy.dynamic.generate_dynamic
        self._time = genpy.Time
        master = os.environ.get("ROS_MASTER_URI", "http://localhost:11311")
        if not rosgraph.is_master_online():
            raise RosError(f"no ROS master answers at {master}; start one (roscore), or set ROS_MASTER_URI")
        self._rospy.init_node(name, disable_signals=True)
        self._classes: dict[str, dict[str, Any]] = {}
        self._publishers: dict[str, Any] = {}

    @property
    def is_alive(self) -> bool:
        """Whether the node is to go on."""
        return not self._rospy.is_shutdown()

    def _classes_of(self, type_name: str) -> dict[str, Any]:
        if type_name not in self._classes:
            self._classes[type_name] = self._generate(type_name, ros1_schema(type_name))
        return self._classes[type_name]

    def publish(self, message: TopicMessage) -> None:
        """Send a message; the topic is advertised with the first one."""
        classes = self._classes_of(message.type)
        publisher = self._publishers.get(message.topic)
        if publisher is None:
            publisher = self._rospy.Publisher(
                message.topic, classes[message.type], queue_size=QUEUE, latch=message.is_latched
            )
            self._publishers[message.topic] = publisher
        publisher.publish(self._filled(classes, message.type, message.message))

    def _filled(self, classes: dict[str, Any], type_name: str, values: dict[str, Any]) -> Any:
        if type_name == "builtin_interfaces/Time":
            return self._time(values["sec"], values["nanosec"])
        made = classes[type_name]()
        for field in fields(type_name):
            value = values[field.name]
            if "/" in field.type:
                one = [self._filled(classes, field.type, each) for each in (value if field.is_array else [value])]
                value = one if field.is_array else one[0]
            setattr(made, field.name, value)
        return made

    def listen_to_joints(self, topic: str, take: Callable[[list[str], list[float]], None]) -> None:
        """Call `take(names, angles)` with each sensor_msgs/JointState of a topic."""
        kind = self._classes_of("sensor_msgs/JointState")["sensor_msgs/JointState"]
        self._rospy.Subscriber(topic, kind, lambda message: take(list(message.name), list(message.position)))

    def close(self) -> None:
        """Leave the graph."""
        self._rospy.signal_shutdown("done")
