"""A node of whichever ROS there is, and joint angles from its graph."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np
import numpy.typing as npt

from taxel.ros.find import RosError, ros_version
from taxel.ros.topics import TopicMessage


class Node(Protocol):
    """What both kinds of ROS node can do."""

    @property
    def is_alive(self) -> bool:
        """Whether the node is to go on."""
        ...

    def publish(self, message: TopicMessage) -> None:
        """Send a message."""
        ...

    def listen_to_joints(self, topic: str, take: Callable[[list[str], list[float]], None]) -> None:
        """Call `take(names, angles)` with each sensor_msgs/JointState of a topic."""
        ...

    def close(self) -> None:
        """Leave the graph."""
        ...


def open_node(version: int | None = None, name: str = "taxel") -> Node:
    """A node of ROS 1 or 2; None: 2 where rclpy can be imported, else 1. Raises RosError of one line."""
    from taxel.ros.ros1 import Ros1Node
    from taxel.ros.ros2 import Ros2Node

    if version not in (None, 1, 2):
        raise RosError(f"expected ROS 1 or 2, found {version}")
    chosen = ros_version() if version is None else version
    return Ros2Node(name) if chosen == 2 else Ros1Node(name)


class JointListener:
    """The latest joint angles of a topic, radians [j] in the order of `names`; 0 until a joint has been heard of."""

    def __init__(self, node: Node, topic: str, names: Sequence[str]) -> None:
        self._index = {name: index for index, name in enumerate(names)}
        self._lock = threading.Lock()
        self._angles = np.zeros(len(names))
        node.listen_to_joints(topic, self._take)

    def _take(self, names: list[str], angles: list[float]) -> None:
        with self._lock:
            for name, angle in zip(names, angles, strict=False):
                if name in self._index and np.isfinite(angle):
                    self._angles[self._index[name]] = angle

    def __call__(self) -> npt.NDArray[np.float64]:
        """The angles as they are now."""
        with self._lock:
            return self._angles.copy()
