"""The TF tree of a hand on its robot, the joint states, and the taxel centres as ROS messages."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from taxel.hand import Hand
from taxel.hand.errors import HandGeometryError
from taxel.hand.kinematics import Kinematics, build_kinematics
from taxel.hand.transforms import inverse, to_quaternion
from taxel.hand.urdf import format_urdf
from taxel.types import FloatArray


def make_stamp(time_ns: int) -> dict[str, int]:
    """Convert nanoseconds since the Unix epoch to a ROS time; a negative time becomes 0, as ROS times are unsigned."""
    sec, nanosec = divmod(max(time_ns, 0), 1_000_000_000)
    return {"sec": sec, "nanosec": nanosec}


def make_header(time_ns: int, frame: str) -> dict[str, Any]:
    """Make a std_msgs/Header message; time_ns: Unix time, nanoseconds; frame: name of the coordinate frame."""
    return {"stamp": make_stamp(time_ns), "frame_id": frame}


class FrameTree:
    """Coordinate frames of a hand: the robot's links, and one bracket for each board, named as in the URDF.

    The poses are computed again only when the joint angles have changed.
    """

    def __init__(self, hand: Hand, joints: Callable[[], npt.ArrayLike] | None = None) -> None:
        """Create the tree of coordinate frames of a hand.

        joints: function that returns the j joint angles, radians, in the order of the robot's `joint_names`; None: all
        0. Raises JointCountError for another number of angles.
        """
        self._hand = hand
        self._kinematics = _try_build_kinematics(hand)
        self._names = _make_bracket_names(hand, self._kinematics)
        self._joints = joints
        self._angles: FloatArray = np.zeros(0)
        self._poses: FloatArray = np.zeros((0, 4, 4))
        self._moving: list[dict[str, Any]] = []
        self._taxels: tuple[FloatArray, FloatArray] | None = None
        if self._kinematics is not None:
            self._update()

    @property
    def has_geometry(self) -> bool:
        """Whether the hand description contains the poses of the boards."""
        return self._kinematics is not None

    @property
    def root(self) -> str:
        """Name of the root frame; "" without geometry."""
        return self._kinematics.robot.root if self._kinematics is not None else ""

    @property
    def urdf(self) -> str:
        """The robot and its brackets as URDF text."""
        return format_urdf(self._require_kinematics().robot, self._hand)

    def get_bracket_frame(self, address: int) -> str:
        """Return the name of the coordinate frame of the bracket of the board at `address`."""
        return self._names[address]

    def _require_kinematics(self) -> Kinematics:
        """Return the kinematics of the hand; raise HandGeometryError if the hand description has no geometry."""
        if self._kinematics is None:
            raise HandGeometryError(self._hand.name)
        return self._kinematics

    def _update(self) -> None:
        """Get the joint angles and, if they have changed, compute the link poses and the moving transforms again."""
        kinematics = self._require_kinematics()
        count = len(kinematics.robot.joint_names)
        angles = np.zeros(count) if self._joints is None else np.asarray(self._joints(), dtype=np.float64)
        if not len(self._poses) or not np.array_equal(angles, self._angles):
            self._poses = kinematics.compute_link_poses(angles)
            self._angles = angles.copy()
            self._moving = list(self._make_joint_transforms())
            self._taxels = None

    def _make_joint_transforms(self) -> Iterator[dict[str, Any]]:
        """Yield the transform of each link that follows a moving joint, from the current link poses."""
        robot = self._require_kinematics().robot
        for index, joint in enumerate(robot.joints):
            if joint.axis is not None:  # link 0 is the root, and link k + 1 is the child of joint k
                parent = self._poses[robot.get_link_index(joint.parent)]
                yield _make_transform(joint.parent, joint.child, inverse(parent) @ self._poses[index + 1])

    def make_static_transforms(self, time_ns: int) -> dict[str, Any]:
        """Make a tf2_msgs/TFMessage of the transforms that never change: fixed joints and brackets of boards."""
        robot = self._require_kinematics().robot
        edges = [(joint.parent, joint.child, joint.origin) for joint in robot.joints if joint.axis is None]
        for board in self._hand.boards:
            if board.link_name is not None and board.pose is not None:
                edges.append((board.link_name, self._names[board.address], board.pose))
        return _stamp_transforms([_make_transform(*edge) for edge in edges], time_ns)

    def make_moving_transforms(self, time_ns: int) -> dict[str, Any]:
        """Make a tf2_msgs/TFMessage of the links that follow moving joints, at the current joint angles."""
        self._update()
        return _stamp_transforms(self._moving, time_ns)

    def joint_states(self, time_ns: int) -> dict[str, Any]:
        """Make a sensor_msgs/JointState message of the current joint angles."""
        self._update()
        names = list(self._require_kinematics().robot.joint_names)
        return {
            "header": make_header(time_ns, ""),
            "name": names,
            "position": self._angles,
            "velocity": [],
            "effort": [],
        }

    def compute_taxel_centres_and_normals(self) -> tuple[FloatArray, FloatArray]:
        """Compute centres (metres) and outward unit normals of all taxels at the current joint angles, f64[n, 3] each.

        Both are in the frame of the robot's root link.
        """
        self._update()
        if self._taxels is None:
            kinematics = self._require_kinematics()
            self._taxels = (
                kinematics.compute_taxel_positions(self._angles),
                kinematics.compute_taxel_normals(self._angles),
            )
        return self._taxels


def _make_transform(parent: str, child: str, matrix: FloatArray) -> dict[str, Any]:
    """Make a geometry_msgs/TransformStamped without time stamp from a pose f64[4, 4] of `child` in `parent`.

    Its header is the name of the parent frame alone; `_stamp_transforms` completes the header.
    """
    w, x, y, z = to_quaternion(matrix).tolist()
    translation = dict(zip("xyz", matrix[:3, 3].tolist(), strict=True))
    pose = {"translation": translation, "rotation": {"x": x, "y": y, "z": z, "w": w}}
    return {"header": parent, "child_frame_id": child, "transform": pose}


def _stamp_transforms(transforms: list[dict[str, Any]], time_ns: int) -> dict[str, Any]:
    """Make a tf2_msgs/TFMessage from the transforms of `_make_transform`, whose headers it completes."""
    return {"transforms": [each | {"header": make_header(time_ns, each["header"])} for each in transforms]}


def _try_build_kinematics(hand: Hand) -> Kinematics | None:
    """Build the kinematics of a hand; None if the hand description has no geometry."""
    try:
        return build_kinematics(hand)
    except HandGeometryError:
        return None


def _make_bracket_names(hand: Hand, kinematics: Kinematics | None) -> dict[int, str]:
    """Return the frame name of the bracket of each board, by board address; the URDF uses the same names.

    The name is that of the board, with the suffix "_bracket" if a link of the robot has the same name.
    """
    used = set(kinematics.robot.link_names) if kinematics is not None else set()
    names = {}
    for board in hand.boards:
        name = board.name
        while name in used:
            name += "_bracket"
        used.add(name)
        names[board.address] = name
    return names
