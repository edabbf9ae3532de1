"""The emulated hand's joints while it grasps: motor torques against the emulated skin's contact and a yielding mount.

Joints and mount move together, M x'' + B x' = torque + contact(x), M and B diagonal. A step is linearly implicit
(Rosenbrock-Euler): with the contact's stiffness K at its beginning, (M / dt + B + dt K) v' = M v / dt + torque +
contact, so that the layer may be as stiff as it likes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.emulated.contact import SkinContact
from taxel.hand import Hand
from taxel.hand.kinematics import Kinematics
from taxel.hand.robot import Robot
from taxel.hand.transforms import cross
from taxel.types import FloatArray

JOINT_INERTIA_KG_M2 = 1.5e-3
JOINT_DAMPING_NM_S = 0.03
JOINT_FRICTION_NM = 0.02
STICKING_RAD_S = 0.004
"""Below this speed friction acts like a stiff damper: a joint that should stick creeps at less."""

SUBSTEP_S = 1.5e-3
"""Another time step than the simulator's."""

OBJECT_MASS_KG = 0.35
OBJECT_INERTIA_KG_M2 = 6e-4
MOUNT_DOF = 6


@dataclass(frozen=True)
class Mount:
    """What holds the object: springs at a point above its origin, critically damped.

    `n_per_m`, `nm_per_rad`: along and about each axis. `height_m`: of that point over the object's origin.
    """

    n_per_m: float
    nm_per_rad: float
    height_m: float


class HandInContact:
    """Joint dynamics (see `taxel.hand.allegro.JointDynamics`) of a hand whose wrist is held and that touches an object.

    robot: the part of the robot below its wrist. wrist_pose: f64[4, 4] in the world. contact, object_index,
    object_pose: the emulated skin, and the object at rest. angles: f64[j], radians, at the start.
    """

    def __init__(
        self,
        hand: Hand,
        robot: Robot,
        contact: SkinContact,
        object_index: int,
        object_pose: FloatArray,
        mount: Mount,
        wrist_pose: FloatArray,
        angles: FloatArray,
    ) -> None:
        self._kinematics = Kinematics(robot, hand)
        self._contact, self._index, self._rest_pose, self._mount = contact, object_index, object_pose, mount
        self._wrist = wrist_pose
        self._joints = len(robot.joint_names)
        self._lower, self._upper = robot.lower, robot.upper
        self._mass, self._damping = self._inertias()
        self._centre = (object_pose @ np.array([0.0, 0.0, mount.height_m, 1.0]))[:3]
        self._spring = np.repeat([mount.n_per_m, mount.nm_per_rad], 3)
        self._offsets = np.stack([contact.bracket_offset(board) for board in range(contact.boards)])
        self._axes = _Axes(robot, hand)
        self._position = np.concatenate([angles, np.zeros(MOUNT_DOF)])
        self._velocity = np.zeros_like(self._position)
        self._diagonal = np.arange(len(self._position))
        self.touched = 0

    def _inertias(self) -> tuple[FloatArray, FloatArray]:
        mount = np.repeat([self._mount.n_per_m, self._mount.nm_per_rad], 3)
        mass = np.repeat([OBJECT_MASS_KG, OBJECT_INERTIA_KG_M2], 3)
        joints = np.ones(self._joints)
        return (
            np.concatenate([JOINT_INERTIA_KG_M2 * joints, mass]),
            np.concatenate([JOINT_DAMPING_NM_S * joints, 2.0 * np.sqrt(mount * mass)]),
        )

    @property
    def angles(self) -> FloatArray:
        """Joint angles, radians, f64[j]."""
        return self._position[: self._joints].copy()

    @property
    def velocities(self) -> FloatArray:
        """Joint speeds, radians a second, f64[j]."""
        return self._velocity[: self._joints].copy()

    def object_pose(self) -> FloatArray:
        """Where the object is believed to be now (its rest pose and how far the mount has given way), f64[4, 4]."""
        return self._object_pose_at(self._position[self._joints :])

    def _object_pose_at(self, yielding: FloatArray) -> FloatArray:
        motion = _small_motion(yielding, self._centre)
        return np.asarray(motion @ self._rest_pose)

    def bracket_poses(self) -> FloatArray:
        """Where the brackets are believed to be, f64[s, 4, 4]."""
        return np.asarray(self._wrist @ self._kinematics.sensor_poses(self._position[: self._joints]))

    def hold_wrist(self, pose: FloatArray) -> None:
        """The arm has taken the wrist to `pose`, f64[4, 4] in the world."""
        self._wrist = pose

    def step(self, torque_nm: FloatArray, dt_s: float) -> FloatArray:
        """Move under motor torques f64[j] for `dt_s` seconds; returns the angles."""
        count = max(1, int(np.ceil(dt_s / SUBSTEP_S - 1e-9))) if self.touched else 1
        for _ in range(count):
            self._substep(torque_nm, dt_s / count)
        return self.angles

    def _substep(self, torque_nm: FloatArray, dt: float) -> None:
        joints = self._joints
        links = self._wrist @ self._kinematics.link_poses(self._position[:joints])
        brackets = links[self._axes.board_links] @ self._axes.bracket_poses
        load = self._contact.load(self._index, self.object_pose(), brackets)
        self.touched = load.touched
        force = np.concatenate([torque_nm, -self._spring * self._position[joints:]])
        stiffness = np.diag(np.concatenate([np.zeros(joints), self._spring]))
        if load.touched:
            own = np.flatnonzero(load.wrench.any(axis=1))
            jacobian = self._jacobian(links, brackets[own] @ self._offsets[own], own)
            flat = jacobian.reshape(-1, joints + MOUNT_DOF)
            force += load.wrench[own].ravel() @ flat
            stiffness += flat.T @ (load.stiffness[own] @ jacobian).reshape(flat.shape)
        damping = self._damping.copy()
        damping[:joints] += JOINT_FRICTION_NM / (np.abs(self._velocity[:joints]) + STICKING_RAD_S)
        system = dt * stiffness
        system[self._diagonal, self._diagonal] += self._mass / dt + damping
        self._move(np.linalg.solve(system, self._mass * self._velocity / dt + force), dt)

    def _move(self, velocity: FloatArray, dt: float) -> None:
        wanted = self._position + dt * velocity
        joints = self._joints
        self._position = wanted.copy()
        self._position[:joints] = np.clip(wanted[:joints], self._lower, self._upper)
        stopped = self._position != wanted
        self._velocity = np.where(stopped, 0.0, velocity)

    def _jacobian(self, links: FloatArray, brackets: FloatArray, own: NDArray[np.intp]) -> FloatArray:
        """Motion of true brackets [k] against the object, in their frames, per joint and mount speed, [k, 6, j + 6]."""
        axes = (links[self._axes.joint_links, :3, :3] @ self._axes.axes[:, :, None])[:, :, 0]
        arms = brackets[:, None, :3, 3] - links[self._axes.joint_links, :3, 3]
        moves = self._axes.carried[own][..., None] * axes
        yielding = self._position[self._joints : self._joints + 3]
        jacobian = np.zeros((len(brackets), 6, self._joints + MOUNT_DOF))
        jacobian[:, :3, : self._joints] = cross(moves, arms).transpose(0, 2, 1)
        jacobian[:, 3:, : self._joints] = moves.transpose(0, 2, 1)
        jacobian[:, :3, self._joints : self._joints + 3] = -np.eye(3)
        jacobian[:, :3, self._joints + 3 :] = _cross_matrices(brackets[:, :3, 3] - self._centre - yielding)
        jacobian[:, 3:, self._joints + 3 :] = -np.eye(3)
        turn = brackets[:, :3, :3].transpose(0, 2, 1)[:, None]
        parts = turn @ jacobian.reshape(len(brackets), 2, 3, -1)
        return np.asarray(parts.reshape(len(brackets), 6, -1))


class _Axes:
    """Which joint carries which board, and where its axis is."""

    def __init__(self, robot: Robot, hand: Hand) -> None:
        moving = [joint for joint in robot.joints if joint.axis is not None]
        self.axes = np.stack([joint.axis for joint in moving if joint.axis is not None])
        self.joint_links = np.array([robot.link_index(joint.child) for joint in moving])
        places = [(board.link, board.pose) for board in hand.boards]
        self.board_links = np.array([robot.link_index(link) for link, _ in places if link is not None])
        self.bracket_poses = np.stack([pose for _, pose in places if pose is not None])
        above = {joint.child: joint.parent for joint in robot.joints}
        self.carried = np.zeros((len(places), len(moving)))
        for row, (link, _) in enumerate(places):
            while link is not None and link in above:
                self.carried[row] += [joint.child == link for joint in moving]
                link = above[link]


def _cross_matrices(vectors: FloatArray) -> FloatArray:
    """[v]x of each vector [s, 3], f64[s, 3, 3]: v x w = [v]x w."""
    matrices = np.zeros((len(vectors), 3, 3))
    x, y, z = vectors.T
    matrices[:, 0, 1], matrices[:, 0, 2], matrices[:, 1, 2] = -z, y, -x
    matrices -= matrices.transpose(0, 2, 1)
    return matrices


def _small_motion(yielding: FloatArray, centre: FloatArray) -> FloatArray:
    """Turn by the last three of `yielding` (rotation vector) about `centre`, then move by the first three, [4, 4]."""
    rx, ry, rz = yielding[3:].tolist()
    angle2 = rx * rx + ry * ry + rz * rz
    angle = angle2**0.5
    # Rodrigues' formula; its two factors go to 1 and 1/2 with the angle.
    s, c = (np.sin(angle) / angle, (1.0 - np.cos(angle)) / angle2) if angle > 1e-8 else (1.0, 0.5)
    skew = np.array([[0.0, -rz, ry], [rz, 0.0, -rx], [-ry, rx, 0.0]])
    motion = np.eye(4)
    motion[:3, :3] += s * skew + c * (skew @ skew)
    motion[:3, 3] = yielding[:3] + centre - motion[:3, :3] @ centre
    return motion
