"""A ROS node of the installed ROS version, and joint angles from a ROS topic."""

import threading
import time
from collections.abc import Callable, Sequence
from typing import Any, Protocol, Self

import numpy as np

from taxel.hand.joint_history import MAX_SAMPLES, JointHistory
from taxel.hand.joint_names import ROBOT_JOINT_NAMES, ROS_JOINT_NAMES
from taxel.ros.ros_import import RosError, find_ros_version
from taxel.ros.topics import TopicMessage
from taxel.types import FloatArray

_ROBOT_NAMES = dict(zip(ROS_JOINT_NAMES, ROBOT_JOINT_NAMES, strict=True))


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


class SpinningNode:
    """A node whose callbacks run in a separate thread during a `with` block, at whose end the node is closed."""

    def __init__(self, node: Node) -> None:
        """Wrap an open node. The thread that runs the node's callbacks starts at the beginning of the `with` block."""
        self._node = node
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def listen_to_joints(self, topic: str, callback: Callable[[list[str], list[float]], None]) -> None:
        """Call `callback(names, angles)` in the thread for each sensor_msgs/JointState message. Angles in radians."""
        self._node.listen_to_joints(topic, callback)

    def listen(self, topic: str, type_name: str, callback: Callable[[Any], None]) -> None:
        """Call `callback(message)` in the thread for each message of a topic. type_name: "package/Name"."""
        self._node.listen(topic, type_name, callback)

    def _run(self) -> None:
        """Run the callbacks until the context ends or ROS shuts down."""
        while not self._stop.is_set() and self._node.is_alive:
            self._node.wait(0.05)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *error: object) -> None:
        """Stop the thread and close the node."""
        self._stop.set()
        self._thread.join()
        self._node.close()


class JointListener:
    """Source of the latest joint angles of a topic. The object is a `JointSource`: calling it returns the angles."""

    def __init__(
        self, node: Node | SpinningNode, topic: str, names: Sequence[str], base: FloatArray | None = None
    ) -> None:
        """Subscribe to a topic of joint states.

        names: the joints in the order in which the angles are returned. The topic may name the hand's joints as the
        manufacturer's driver does (joint_0.0 ...). base: angles of the joints before their first message, radians;
        None: all 0.
        """
        self._index = {name: index for index, name in enumerate(names)}
        self._lock = threading.Lock()
        self._angles = np.zeros(len(names)) if base is None else np.array(base, dtype=np.float64)
        self.history: JointHistory | None = None
        node.listen_to_joints(topic, self._update)

    def record(self, name: str) -> JointHistory:
        """Begin to record the angles, and return the history to which every message from now on is added.

        The times of the history are on the clock of `time.monotonic`. name: name of the source, for messages to the
        user.
        """
        self.history = JointHistory(tuple(self._index), name, MAX_SAMPLES)
        self.history.is_live = True
        return self.history

    def _update(self, names: list[str], angles: list[float]) -> None:
        """Store the finite angles of the known joints, radians, and add them to the history that is recorded.

        Called in the thread of the ROS subscription. Other joints are ignored.
        """
        is_known = False
        with self._lock:
            for name, angle in zip(names, angles, strict=False):
                name = _ROBOT_NAMES.get(name, name)
                if name in self._index and np.isfinite(angle):
                    self._angles[self._index[name]] = angle
                    is_known = True
        if is_known and self.history is not None:
            self.history.add(time.monotonic(), self._angles)

    def __call__(self) -> FloatArray:
        """Return a copy of the latest joint angles, radians."""
        with self._lock:
            return self._angles.copy()
