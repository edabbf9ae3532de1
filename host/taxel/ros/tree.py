"""The TF tree of a hand on its robot, its joint states, and where its taxels are."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from taxel.hand import Hand
from taxel.hand.errors import HandGeometryError
from taxel.hand.kinematics import Kinematics, kinematics_of
from taxel.hand.transforms import inverse, to_quaternion
from taxel.hand.urdf import urdf_text
from taxel.types import FloatArray


def stamp_of(time_ns: int) -> dict[str, int]:
    """Nanoseconds as a ROS time; before the epoch there is none, so 0 stands for it."""
    sec, nanosec = divmod(max(time_ns, 0), 1_000_000_000)
    return {"sec": sec, "nanosec": nanosec}


def header(time_ns: int, frame: str) -> dict[str, Any]:
    """A std_msgs/Header."""
    return {"stamp": stamp_of(time_ns), "frame_id": frame}


def _transform(parent: str, child: str, matrix: FloatArray) -> dict[str, Any]:
    """A geometry_msgs/TransformStamped without its header but for the frame."""
    w, x, y, z = to_quaternion(matrix).tolist()
    translation = dict(zip("xyz", matrix[:3, 3].tolist(), strict=True))
    pose = {"translation": translation, "rotation": {"x": x, "y": y, "z": z, "w": w}}
    return {"header": parent, "child_frame_id": child, "transform": pose}


def _stamped(transforms: list[dict[str, Any]], time_ns: int) -> dict[str, Any]:
    return {"transforms": [each | {"header": header(time_ns, each["header"])} for each in transforms]}


class FrameTree:
    """Frames of a hand: links from parent to child, and a bracket for each board, named as in the URDF.

    `joints`: gives the joint angles, radians [j] in the order of the robot's `joint_names`; None: all 0. Poses are
    worked out anew only when the angles have changed. Raises `JointCountError` for another number of angles.
    """

    def __init__(self, hand: Hand, joints: Callable[[], npt.ArrayLike] | None = None) -> None:
        self._hand = hand
        self._kinematics = _kinematics(hand)
        self._names = _bracket_names(hand, self._kinematics)
        self._joints = joints
        self._angles: FloatArray = np.zeros(0)
        self._poses: FloatArray = np.zeros((0, 4, 4))
        self._moving: list[dict[str, Any]] = []
        self._taxels: tuple[FloatArray, FloatArray] | None = None
        if self._kinematics is not None:
            self._update()

    @property
    def is_known(self) -> bool:
        """Whether the description says where the boards are."""
        return self._kinematics is not None

    @property
    def root(self) -> str:
        """The frame that all others hang on; "" where there is no tree."""
        return self._kinematics.robot.root if self._kinematics is not None else ""

    @property
    def urdf(self) -> str:
        """The robot and its brackets as URDF."""
        return urdf_text(self._require().robot, self._hand)

    def bracket(self, address: int) -> str:
        """The frame of a board's bracket."""
        return self._names[address]

    def _require(self) -> Kinematics:
        if self._kinematics is None:
            raise HandGeometryError(self._hand.name)
        return self._kinematics

    def _update(self) -> None:
        kinematics = self._require()
        count = len(kinematics.robot.joint_names)
        angles = np.zeros(count) if self._joints is None else np.asarray(self._joints(), dtype=np.float64)
        if not len(self._poses) or not np.array_equal(angles, self._angles):
            self._poses = kinematics.link_poses(angles)
            self._angles = angles.copy()
            self._moving = list(self._steps())
            self._taxels = None

    def _steps(self) -> Iterator[dict[str, Any]]:
        robot = self._require().robot
        for index, joint in enumerate(robot.joints):
            if joint.axis is not None:
                parent = self._poses[robot.link_index(joint.parent)]
                yield _transform(joint.parent, joint.child, inverse(parent) @ self._poses[index + 1])

    def static(self, time_ns: int) -> dict[str, Any]:
        """A tf2_msgs/TFMessage of all that never moves: fixed joints and brackets."""
        robot = self._require().robot
        found = [(j.parent, j.child, j.origin) for j in robot.joints if j.axis is None]
        for board in self._hand.boards:
            if board.link is not None and board.pose is not None:
                found.append((board.link, self._names[board.address], board.pose))
        return _stamped([_transform(*each) for each in found], time_ns)

    def moving(self, time_ns: int) -> dict[str, Any]:
        """A tf2_msgs/TFMessage of the links that joints move, as they are now."""
        self._update()
        return _stamped(self._moving, time_ns)

    def joint_states(self, time_ns: int) -> dict[str, Any]:
        """A sensor_msgs/JointState."""
        self._update()
        names = list(self._require().robot.joint_names)
        return {"header": header(time_ns, ""), "name": names, "position": self._angles, "velocity": [], "effort": []}

    def taxels(self) -> tuple[FloatArray, FloatArray]:
        """Centres (metres) and outward normals of all taxels in the root frame, f64[n, 3] each."""
        self._update()
        if self._taxels is None:
            kinematics = self._require()
            self._taxels = kinematics.taxel_positions(self._angles), kinematics.taxel_normals(self._angles)
        return self._taxels


def _kinematics(hand: Hand) -> Kinematics | None:
    try:
        return kinematics_of(hand)
    except HandGeometryError:
        return None


def _bracket_names(hand: Hand, kinematics: Kinematics | None) -> dict[int, str]:
    """As `Kinematics.publish` and the URDF name them: a board with the name of a link becomes NAME_bracket."""
    taken = set(kinematics.robot.links) if kinematics is not None else set()
    names = {}
    for board in hand.boards:
        name = board.name
        while name in taken:
            name += "_bracket"
        taken.add(name)
        names[board.address] = name
    return names
