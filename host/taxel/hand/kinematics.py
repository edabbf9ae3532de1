"""Forward kinematics: poses of links, brackets and taxels from joint angles, vectorised over time."""

from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel.errors import TaxelError
from taxel.hand.description import Hand
from taxel.hand.errors import HandGeometryError
from taxel.hand.robot import Robot, load_robot
from taxel.hand.sheet import Sheet


class JointCountError(TaxelError, ValueError):
    """The number of joint angles differs from the number of joints of the robot."""

    def __init__(self, robot: str, expected: int, found: int) -> None:
        """Create the error for a wrong number of joint angles; robot: its name; expected, found: the numbers."""
        super().__init__(robot, expected, found)

    def _format_message(self) -> str:
        robot, expected, found = self.args
        return f"robot {robot!r}: expected {expected} joint angles on the last axis, found {found}"


class Kinematics:
    """Forward kinematics of a robot and the skin on it.

    `robot`: arm and hand. `hand`: the skin; None if only link poses are needed. Joint angles are radians [..., j] in
    the order of `robot.joint_names`. Raises `HandGeometryError` if the hand description contains no bracket poses, and
    `UnknownLinkError` if it names a link that the robot does not have.
    """

    def __init__(self, robot: Robot, hand: Hand | None = None) -> None:
        """Prepare the forward kinematics of a robot, and of the sensor boards on it if a hand description is given.

        Raises HandGeometryError if the hand description contains no bracket poses, and UnknownLinkError if it names a
        link that the robot does not have.
        """
        self.robot = robot
        self.hand = hand
        self._parents = [robot.get_link_index(joint.parent) for joint in robot.joints]
        self._board_links: list[int] = []
        if hand is not None:
            self._board_links = [self._get_link_index(hand, board.link_name) for board in hand.boards]

    def _get_link_index(self, hand: Hand, link_name: str | None) -> int:
        """Return the index of a link of the robot.

        Raises HandGeometryError if `link_name` is None (a board without a link), UnknownLinkError for another link.
        """
        if link_name is None:
            raise HandGeometryError(hand.name)
        return self.robot.get_link_index(link_name)

    @cached_property
    def _bracket_poses(self) -> NDArray[np.float64]:
        """Pose of the bracket of each board on its link, f64[s, 4, 4]."""
        hand = self._require_hand()
        return np.stack([board.pose for board in hand.boards if board.pose is not None])

    def _require_hand(self) -> Hand:
        """Return the hand description given to the constructor; raise ValueError if there was none."""
        if self.hand is None:
            raise ValueError("kinematics: expected a hand, found None; pass a hand to Kinematics()")
        return self.hand

    def compute_link_poses(self, joint_position: ArrayLike) -> NDArray[np.float64]:
        """Compute the world pose of every link, f64[..., links, 4, 4], in the order of `robot.link_names`.

        The world frame is the robot's root. Raises `JointCountError` for another number of joint angles [..., j].
        """
        angles = np.asarray(joint_position, dtype=np.float64)
        joints = len(self.robot.joint_names)
        if angles.ndim == 0 or angles.shape[-1] != joints:
            raise JointCountError(self.robot.name, joints, angles.shape[-1] if angles.ndim else 0)
        poses = np.empty((*angles.shape[:-1], len(self.robot.link_names), 4, 4))
        poses[..., 0, :, :] = np.eye(4)
        joint_poses = np.broadcast_to(self._origins, (*angles.shape[:-1], *self._origins.shape)).copy()
        joint_poses[..., self._revolute, :, :] = self._origins[self._revolute] @ _compute_rotations(self._axes, angles)
        # Link k + 1 is the child link of joint k; link 0 is the root.
        for children, parents in self._levels:
            poses[..., children, :, :] = poses[..., parents, :, :] @ joint_poses[..., children - 1, :, :]
        return poses

    @cached_property
    def _origins(self) -> NDArray[np.float64]:
        """Pose of each joint in the frame of its parent link at joint angle 0, f64[joints, 4, 4]."""
        return np.stack([joint.origin for joint in self.robot.joints])

    @cached_property
    def _revolute(self) -> NDArray[np.intp]:
        """Indices of the revolute joints among all joints, int[j]."""
        return np.flatnonzero([joint.axis is not None for joint in self.robot.joints])

    @cached_property
    def _axes(self) -> NDArray[np.float64]:
        """Unit axis of each revolute joint, f64[j, 3]."""
        axes = [joint.axis for joint in self.robot.joints if joint.axis is not None]
        return np.stack(axes) if axes else np.empty((0, 3))

    @cached_property
    def _levels(self) -> list[tuple[NDArray[np.intp], NDArray[np.intp]]]:
        """For each depth of the kinematic tree: indices of the links at this depth, and indices of their parent links.

        The poses of links of the same depth are independent and can be computed together.
        """
        depth = {self.robot.root: 0}
        for joint in self.robot.joints:
            depth[joint.child] = depth[joint.parent] + 1
        level = np.array([depth[joint.child] for joint in self.robot.joints])
        rows = [np.flatnonzero(level == number) for number in range(1, int(level.max()) + 1)]
        return [(row + 1, np.array(self._parents)[row]) for row in rows]

    def compute_sensor_poses(self, joint_position: ArrayLike) -> NDArray[np.float64]:
        """Compute the world pose of every board's bracket, f64[..., s, 4, 4], in the order of `hand.boards`.

        joint_position: f64[..., j], radians, in the order of the robot's joints.
        """
        self._require_hand()
        poses = self.compute_link_poses(joint_position)[..., self._board_links, :, :] @ self._bracket_poses
        return np.asarray(poses)

    def compute_taxel_positions(self, joint_position: ArrayLike) -> NDArray[np.float64]:
        """Compute the taxel centres in the world, metres, f64[..., n, 3]."""
        return compute_taxel_positions(self._require_hand(), self.compute_sensor_poses(joint_position))

    def compute_taxel_normals(self, joint_position: ArrayLike) -> NDArray[np.float64]:
        """Compute the outward taxel normals in the world, f64[..., n, 3]."""
        return compute_taxel_normals(self._require_hand(), self.compute_sensor_poses(joint_position))


def build_kinematics(hand: Hand) -> Kinematics:
    """Build the kinematics of a hand on the robot named in its description.

    Raises HandGeometryError if the description names no robot.
    """
    if hand.robot is None:
        raise HandGeometryError(hand.name)
    return Kinematics(load_robot(hand.robot), hand)


def compute_taxel_positions(hand: Hand | Sheet, sensor_poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Compute the taxel centres in the world, f64[..., n, 3], from bracket poses f64[..., s, 4, 4]."""
    rotations, origins = sensor_poses[..., :3, :3], sensor_poses[..., :3, 3]
    rotated = np.einsum("...nij,nj->...ni", rotations[..., hand.board_index, :, :], hand.position)
    return np.asarray(rotated + origins[..., hand.board_index, :])


def compute_taxel_normals(hand: Hand | Sheet, sensor_poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Compute the outward taxel normals in the world, f64[..., n, 3], from bracket poses f64[..., s, 4, 4]."""
    rotations = sensor_poses[..., hand.board_index, :3, :3]
    return np.asarray(np.einsum("...nij,nj->...ni", rotations, hand.normal))


def _compute_rotations(axes: NDArray[np.float64], angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Compute rotations about unit axes [k, 3] by angles [..., k], f64[..., k, 4, 4] (Rodrigues' formula)."""
    cross = np.zeros((len(axes), 3, 3))
    x, y, z = axes.T
    cross[:, 0, 1], cross[:, 0, 2], cross[:, 1, 2] = -z, y, -x
    cross -= cross.transpose(0, 2, 1)
    sine, cosine = np.sin(angles)[..., None, None], np.cos(angles)[..., None, None]
    rotations = np.zeros((*angles.shape, 4, 4))
    rotations[..., :3, :3] = np.eye(3) + sine * cross + (1.0 - cosine) * (cross @ cross)
    rotations[..., 3, 3] = 1.0
    return rotations
