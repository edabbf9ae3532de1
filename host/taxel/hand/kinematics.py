"""Forward kinematics: from joint angles to the poses of links, brackets and taxels, vectorised over time."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taxel.errors import TaxelError
from taxel.hand.description import Hand
from taxel.hand.errors import HandGeometryError
from taxel.hand.robot import Robot, load_robot
from taxel.hand.sheet import Sheet


class JointCountError(TaxelError, ValueError):
    """Joint angles for another number of joints than the robot has."""

    def __init__(self, robot: str, expected: int, found: int) -> None:
        super().__init__(robot, expected, found)

    def __str__(self) -> str:
        robot, expected, found = self.args
        return f"robot {robot!r}: expected {expected} joint angles on the last axis, found {found}"


class Kinematics:
    """Where everything is, given the joint angles.

    `robot`: the arm and hand. `hand`: the skin on it, or None where only links are wanted. Joint angles are radians
    [..., j] in the order of `robot.joint_names`. Raises `HandGeometryError` if the skin's description gives no
    positions, `UnknownLinkError` if it names a link that the robot lacks.
    """

    def __init__(self, robot: Robot, hand: Hand | None = None) -> None:
        self.robot = robot
        self.hand = hand
        self._parents = [robot.get_link_index(joint.parent) for joint in robot.joints]
        self._board_links: list[int] = []
        if hand is not None:
            self._board_links = [self._link_of(hand, link) for link in (board.link for board in hand.boards)]

    def _link_of(self, hand: Hand, link: str | None) -> int:
        if link is None:
            raise HandGeometryError(hand.name)
        return self.robot.get_link_index(link)

    @cached_property
    def _bracket_poses(self) -> NDArray[np.float64]:
        hand = self._require_hand()
        return np.stack([board.pose for board in hand.boards if board.pose is not None])

    def _require_hand(self) -> Hand:
        if self.hand is None:
            raise ValueError("these kinematics were made without a hand; give one")
        return self.hand

    def compute_link_poses(self, joint_position: ArrayLike) -> NDArray[np.float64]:
        """Pose of every link in the world (the robot's root), f64[..., links, 4, 4], in the order of `robot.links`.

        Raises `JointCountError` if `joint_position` [..., j] has another number of joints.
        """
        angles = np.asarray(joint_position, dtype=np.float64)
        joints = len(self.robot.joint_names)
        if angles.ndim == 0 or angles.shape[-1] != joints:
            raise JointCountError(self.robot.name, joints, angles.shape[-1] if angles.ndim else 0)
        poses = np.empty((*angles.shape[:-1], len(self.robot.links), 4, 4))
        poses[..., 0, :, :] = np.eye(4)
        steps = np.broadcast_to(self._origins, (*angles.shape[:-1], *self._origins.shape)).copy()
        steps[..., self._moving, :, :] = self._origins[self._moving] @ _turns(self._axes, angles)
        for children, parents in self._levels:
            poses[..., children, :, :] = poses[..., parents, :, :] @ steps[..., children - 1, :, :]
        return poses

    @cached_property
    def _origins(self) -> NDArray[np.float64]:
        return np.stack([joint.origin for joint in self.robot.joints])

    @cached_property
    def _moving(self) -> NDArray[np.intp]:
        return np.flatnonzero([joint.axis is not None for joint in self.robot.joints])

    @cached_property
    def _axes(self) -> NDArray[np.float64]:
        axes = [joint.axis for joint in self.robot.joints if joint.axis is not None]
        return np.stack(axes) if axes else np.empty((0, 3))

    @cached_property
    def _levels(self) -> list[tuple[NDArray[np.intp], NDArray[np.intp]]]:
        """Links by their depth in the tree, and their parents: those of one depth do not depend on each other."""
        depth = {self.robot.root: 0}
        for joint in self.robot.joints:
            depth[joint.child] = depth[joint.parent] + 1
        level = np.array([depth[joint.child] for joint in self.robot.joints])
        rows = [np.flatnonzero(level == each) for each in range(1, int(level.max()) + 1)]
        return [(row + 1, np.array(self._parents)[row]) for row in rows]

    def compute_sensor_poses(self, joint_position: ArrayLike) -> NDArray[np.float64]:
        """Pose of every bracket in the world, f64[..., s, 4, 4], in the order of `hand.boards`."""
        self._require_hand()
        poses = self.compute_link_poses(joint_position)[..., self._board_links, :, :] @ self._bracket_poses
        return np.asarray(poses)

    def compute_taxel_positions(self, joint_position: ArrayLike) -> NDArray[np.float64]:
        """Centre of every taxel in the world, metres, f64[..., n, 3]."""
        return compute_taxel_positions(self._require_hand(), self.compute_sensor_poses(joint_position))

    def compute_taxel_normals(self, joint_position: ArrayLike) -> NDArray[np.float64]:
        """Outward normal of every taxel in the world, f64[..., n, 3]."""
        return compute_taxel_normals(self._require_hand(), self.compute_sensor_poses(joint_position))


def build_kinematics(hand: Hand) -> Kinematics:
    """The kinematics of a hand on the robot that its description names."""
    if hand.robot is None:
        raise HandGeometryError(hand.name)
    return Kinematics(load_robot(hand.robot), hand)


def compute_taxel_positions(hand: Hand | Sheet, sensor_poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Taxel centres in the world, f64[..., n, 3], from the poses of the brackets f64[..., s, 4, 4]."""
    rotations, origins = sensor_poses[..., :3, :3], sensor_poses[..., :3, 3]
    turned = np.einsum("...nij,nj->...ni", rotations[..., hand.board_index, :, :], hand.position)
    return np.asarray(turned + origins[..., hand.board_index, :])


def compute_taxel_normals(hand: Hand | Sheet, sensor_poses: NDArray[np.float64]) -> NDArray[np.float64]:
    """Outward taxel normals in the world, f64[..., n, 3], from the poses of the brackets f64[..., s, 4, 4]."""
    rotations = sensor_poses[..., hand.board_index, :3, :3]
    return np.asarray(np.einsum("...nij,nj->...ni", rotations, hand.normal))


def _turns(axes: NDArray[np.float64], angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotations about unit axes [k, 3] by angles [..., k] as poses f64[..., k, 4, 4] (Rodrigues' formula)."""
    cross = np.zeros((len(axes), 3, 3))
    x, y, z = axes.T
    cross[:, 0, 1], cross[:, 0, 2], cross[:, 1, 2] = -z, y, -x
    cross -= cross.transpose(0, 2, 1)
    sine, cosine = np.sin(angles)[..., None, None], np.cos(angles)[..., None, None]
    turn = np.zeros((*angles.shape, 4, 4))
    turn[..., :3, :3] = np.eye(3) + sine * cross + (1.0 - cosine) * (cross @ cross)
    turn[..., 3, 3] = 1.0
    return turn
