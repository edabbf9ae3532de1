"""A ROS node of the installed ROS version, and joint angles from a ROS topic."""

import threading
from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np

from taxel.ros.ros_import import RosError, find_ros_version
from taxel.ros.topics import TopicMessage
from taxel.types import FloatArray


class Node(Protocol):
    """Common interface of the ROS 1 and ROS 2 nodes."""

    @property
    def is_alive(self) -> bool:
        """False after ROS has shut the node down."""
        ...

    def publish(self, message: TopicMessage) -> None:
        """Publish a message on its topic."""
        ...

    def listen(self, topic: str, type_name: str, callback: Callable[[Any], None]) -> None:
        """Call `callback(message)` for each message of a topic. type_name: "package/Name"."""
        ...

    def wait(self, timeout_s: float) -> None:
        """Wait up to `timeout_s` seconds, during which callbacks of received messages run."""
        ...

    def listen_to_joints(self, topic: str, callback: Callable[[list[str], list[float]], None]) -> None:
        """Call `callback(names, angles)` for each sensor_msgs/JointState message of a topic. Angles in radians."""
        ...

    def close(self) -> None:
        """Shut the node down."""
        ...


def open_node(version: int | None = None, name: str = "taxel") -> Node:
    """Open a node of ROS 1 or 2. Raises RosError.

    version: 1 or 2; None: 2 if rclpy can be imported, else 1.
    """
    from taxel.ros.ros1 import Ros1Node
    from taxel.ros.ros2 import Ros2Node

    if version not in (None, 1, 2):
        raise RosError(f"ROS version: expected 1 or 2, found {version}; correct --ros")
    selected = find_ros_version() if version is None else version
    return Ros2Node(name) if selected == 2 else Ros1Node(name)


class JointListener:
    """The latest joint angles of a topic, radians [j] in the order of `names`; 0 for a joint without a message so far.

    The object is a `JointSource`: calling it returns the angles.
    """

    def __init__(self, node: Node, topic: str, names: Sequence[str]) -> None:
        """Subscribe to a topic of joint states; names: the joints in the order in which the angles are returned."""
        self._index = {name: index for index, name in enumerate(names)}
        self._lock = threading.Lock()
        self._angles = np.zeros(len(names))
        node.listen_to_joints(topic, self._update)

    def _update(self, names: list[str], angles: list[float]) -> None:
        """Store the finite angles of the known joints, radians; called in the thread of the ROS subscription."""
        with self._lock:
            for name, angle in zip(names, angles, strict=False):
                if name in self._index and np.isfinite(angle):
                    self._angles[self._index[name]] = angle

    def __call__(self) -> FloatArray:
        """Return a copy of the latest joint angles, radians."""
        with self._lock:
            return self._angles.copy()
