"""A ROS 1 node that publishes the topics of the skin."""

import os
import shutil
import time
from collections.abc import Callable
from typing import Any

from taxel.ros.definitions import fields, make_ros1_schema
from taxel.ros.ros_import import RosError, import_ros1
from taxel.ros.topics import TopicMessage

QUEUE_LENGTH = 100
"""Messages that rospy keeps for a slow subscriber of a topic."""


class Ros1Node:
    """ROS 1 node that publishes topics with rospy. rospy permits one node in a process.

    The message classes are generated from the definitions, so that no ROS package has to be built on the publishing
    side. A subscriber that needs the classes builds `taxel_msgs`. Raises RosError if rospy is not installed or no ROS
    master answers.
    """

    def __init__(self, name: str = "taxel") -> None:
        """Create a ROS 1 node; raise RosError if rospy is not installed or no ROS master answers."""
        self._rospy = import_ros1()
        import genpy.dynamic  # type: ignore[import-not-found, unused-ignore]  # installed with rospy
        import rosgraph  # type: ignore[import-not-found, unused-ignore]

        self._generate = genpy.dynamic.generate_dynamic
        self._time = genpy.Time
        master = os.environ.get("ROS_MASTER_URI", "http://localhost:11311")
        if not rosgraph.is_master_online():
            remedy = "start one (roscore)"
            if shutil.which("roscore") is None:
                remedy = "ROS has no roscore here: install ROS (on Debian: apt-get install ros-core) and start roscore"
            raise RosError(f"no ROS master answers at {master}; {remedy}, or set ROS_MASTER_URI")
        self._rospy.init_node(name, disable_signals=True)
        self._classes: dict[str, dict[str, Any]] = {}
        self._publishers: dict[str, Any] = {}

    @property
    def is_alive(self) -> bool:
        """False after ROS has shut the node down."""
        return not self._rospy.is_shutdown()

    def _load_classes(self, type_name: str) -> dict[str, Any]:
        """Return the ROS 1 message classes of a type and of all types of its fields, by type."""
        if type_name not in self._classes:
            self._classes[type_name] = self._generate(type_name, make_ros1_schema(type_name))
        return self._classes[type_name]

    def publish(self, message: TopicMessage) -> None:
        """Publish a message with rospy. The first message of a topic advertises the topic."""
        classes = self._load_classes(message.type)
        publisher = self._publishers.get(message.topic)
        if publisher is None:
            publisher = self._rospy.Publisher(
                message.topic, classes[message.type], queue_size=QUEUE_LENGTH, latch=message.is_latched
            )
            self._publishers[message.topic] = publisher
        publisher.publish(self._make_ros_message(classes, message.type, message.message))

    def _make_ros_message(self, classes: dict[str, Any], type_name: str, values: dict[str, Any]) -> Any:
        """Build a ROS 1 message object of type `type_name` from its fields as a dict.

        classes: message classes by type.
        """
        if type_name == "builtin_interfaces/Time":
            return self._time(values["sec"], values["nanosec"])
        message = classes[type_name]()
        for field in fields(type_name):
            value = values[field.name]
            if "/" in field.type:
                is_array = field.is_array
                parts = [self._make_ros_message(classes, field.type, each) for each in (value if is_array else [value])]
                value = parts if is_array else parts[0]
            setattr(message, field.name, value)
        return message

    def listen_to_joints(self, topic: str, callback: Callable[[list[str], list[float]], None]) -> None:
        """Call `callback(names, angles)` for each sensor_msgs/JointState message of a topic. Angles in radians."""
        self.listen(
            topic, "sensor_msgs/JointState", lambda message: callback(list(message.name), list(message.position))
        )

    def listen(self, topic: str, type_name: str, callback: Callable[[Any], None]) -> None:
        """Call `callback(message)` for each message of a topic, in a thread of rospy. type_name: "package/Name"."""
        self._rospy.Subscriber(topic, self._load_classes(type_name)[type_name], callback)

    def wait(self, timeout_s: float) -> None:
        """Wait `timeout_s` seconds. rospy runs the callbacks in its own threads."""
        time.sleep(timeout_s)

    def close(self) -> None:
        """Shut the ROS 1 node down."""
        self._rospy.signal_shutdown("done")
