"""Joint dynamics of the emulated hand during a grasp: motor torques, contact of the emulated skin, compliant mount.

Joints and mount are integrated together: M x'' + B x' = torque + contact(x), with diagonal M and B. Each step is
linearly implicit (Rosenbrock-Euler): with the stiffness K of the contact at the start of the step,
(M / dt + B + dt K) v' = M v / dt + torque + contact. The step is stable for any stiffness of the layer.
"""

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
"""Below this speed friction is modelled as a stiff damper; a sticking joint creeps more slowly than this."""

SUBSTEP_S = 1.5e-3
"""Largest time step; different from the simulator's, so that the two solvers stay independent."""

OBJECT_MASS_KG = 0.35
OBJECT_INERTIA_KG_M2 = 6e-4
MOUNT_DOF = 6


@dataclass(frozen=True)
class Mount:
    """Mount of the object: critically damped springs at a point above the object's origin.

    n_per_m, nm_per_rad: stiffness along and about each axis. height_m: height of the point above the object's origin.
    """

    n_per_m: float
    nm_per_rad: float
    height_m: float


class HandInContact:
    """Joint dynamics (see `taxel.hand.allegro.JointDynamics`) of a hand with a fixed wrist in contact with an object.

    robot: the part of the robot below its wrist. contact: the contact solver of the emulated skin. object_index,
    object_pose: number of the object in the world, and its pose f64[4, 4] at rest. wrist_pose: f64[4, 4], world.
    angles: initial joint angles f64[j], radians.
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
        """Create the dynamics of a hand that touches an object on a spring mount, at rest.

        contact: computes the contact load of the skin. object_index: row of the object in the world file. object_pose:
        rest pose of the object f64[4, 4], world. mount: stiffness of the object's support. wrist_pose: f64[4, 4],
        world. angles: initial joint angles f64[j], radians.
        """
        self._kinematics = Kinematics(robot, hand)
        self._contact, self._index, self._rest_pose, self._mount = contact, object_index, object_pose, mount
        self._wrist = wrist_pose
        self._joints = len(robot.joint_names)
        self._lower, self._upper = robot.lower, robot.upper
        self._mass, self._damping = self._inertias()
        self._centre = (object_pose @ np.array([0.0, 0.0, mount.height_m, 1.0]))[:3]
        self._spring = np.repeat([mount.n_per_m, mount.nm_per_rad], 3)
        self._offsets = np.stack([contact.get_bracket_offset(board) for board in range(contact.board_count)])
        self._axes = _Axes(robot, hand)
        self._position = np.concatenate([angles, np.zeros(MOUNT_DOF)])
        self._velocity = np.zeros_like(self._position)
        self._diagonal = np.arange(len(self._position))
        self.touched_count = 0

    def _inertias(self) -> tuple[FloatArray, FloatArray]:
        """Return the diagonal of the mass matrix and of the damping matrix, f64[j + 6] each.

        The first j elements belong to the joints, the last six to the object on its mount, which is critically damped.
        """
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
        """Joint speeds, radians per second, f64[j]."""
        return self._velocity[: self._joints].copy()

    def object_pose(self) -> FloatArray:
        """Pose f64[4, 4] of the object: its rest pose, moved by the deflection of the mount."""
        return self._object_pose_at(self._position[self._joints :])

    def _object_pose_at(self, deflection: FloatArray) -> FloatArray:
        """Compute the pose of the object f64[4, 4] for a deflection of its mount f64[6].

        deflection: translation in metres, then rotation vector in radians.
        """
        motion = _motion_about(deflection, self._centre)
        return np.asarray(motion @ self._rest_pose)

    def bracket_poses(self) -> FloatArray:
        """Return the nominal poses f64[s, 4, 4] of the brackets of the boards, without their mounting offsets."""
        return np.asarray(self._wrist @ self._kinematics.compute_sensor_poses(self._position[: self._joints]))

    def hold_wrist(self, pose: FloatArray) -> None:
        """Set the pose of the wrist, f64[4, 4], in world coordinates."""
        self._wrist = pose

    def step(self, torque_nm: FloatArray, dt_s: float) -> FloatArray:
        """Integrate the motion of hand and object over `dt_s` seconds; return the joint angles f64[j], radians.

        torque_nm: motor torques f64[j].
        """
        count = max(1, int(np.ceil(dt_s / SUBSTEP_S - 1e-9))) if self.touched_count else 1
        for _ in range(count):
            self._substep(torque_nm, dt_s / count)
        return self.angles

    def _substep(self, torque_nm: FloatArray, dt: float) -> None:
        """Integrate the motion over `dt` seconds by one implicit Euler step with the contact forces of the skin.

        The new velocity v solves (mass / dt + damping + dt stiffness) v = mass v_old / dt + force. torque_nm: motor
        torques f64[j]. In contact, `dt` is not longer than `SUBSTEP_S`.
        """
        joints = self._joints
        links = self._wrist @ self._kinematics.compute_link_poses(self._position[:joints])
        brackets = links[self._axes.board_links] @ self._axes.bracket_poses
        load = self._contact.compute_load(self._index, self.object_pose(), brackets)
        self.touched_count = load.touched_board_count
        force = np.concatenate([torque_nm, -self._spring * self._position[joints:]])
        stiffness = np.diag(np.concatenate([np.zeros(joints), self._spring]))
        if load.touched_board_count:
            loaded = np.flatnonzero(load.wrench.any(axis=1))
            jacobian = self._jacobian(links, brackets[loaded] @ self._offsets[loaded], loaded)
            flat = jacobian.reshape(-1, joints + MOUNT_DOF)
            force += load.wrench[loaded].ravel() @ flat
            stiffness += flat.T @ (load.stiffness[loaded] @ jacobian).reshape(flat.shape)
        damping = self._damping.copy()
        damping[:joints] += JOINT_FRICTION_NM / (np.abs(self._velocity[:joints]) + STICKING_RAD_S)
        system = dt * stiffness
        system[self._diagonal, self._diagonal] += self._mass / dt + damping
        self._move(np.linalg.solve(system, self._mass * self._velocity / dt + force), dt)

    def _move(self, velocity: FloatArray, dt: float) -> None:
        """Move joints and mount over `dt` seconds with a velocity f64[j + 6]; a joint at its limit stops."""
        unlimited = self._position + dt * velocity
        joints = self._joints
        self._position = unlimited.copy()
        self._position[:joints] = np.clip(unlimited[:joints], self._lower, self._upper)
        is_at_limit = self._position != unlimited
        self._velocity = np.where(is_at_limit, 0.0, velocity)

    def _jacobian(self, links: FloatArray, brackets: FloatArray, boards: NDArray[np.intp]) -> FloatArray:
        """Compute the Jacobian f64[k, 6, j + 6] of the motion of k brackets relative to the object, in bracket frames.

        Rows: translation, then rotation of a bracket. Columns: speeds of the j joints, then the six speeds of the
        object's mount, which move the object and therefore have a negative sign. links: poses of the robot's links.
        brackets: true poses f64[k, 4, 4]. boards: indices [k] of their boards.
        """
        axes = (links[self._axes.joint_links, :3, :3] @ self._axes.axes[:, :, None])[:, :, 0]
        arms = brackets[:, None, :3, 3] - links[self._axes.joint_links, :3, 3]
        rotations = self._axes.is_carried[boards][..., None] * axes
        deflection = self._position[self._joints : self._joints + 3]
        jacobian = np.zeros((len(brackets), 6, self._joints + MOUNT_DOF))
        jacobian[:, :3, : self._joints] = cross(rotations, arms).transpose(0, 2, 1)
        jacobian[:, 3:, : self._joints] = rotations.transpose(0, 2, 1)
        jacobian[:, :3, self._joints : self._joints + 3] = -np.eye(3)
        jacobian[:, :3, self._joints + 3 :] = _cross_matrices(brackets[:, :3, 3] - self._centre - deflection)
        jacobian[:, 3:, self._joints + 3 :] = -np.eye(3)
        to_bracket = brackets[:, :3, :3].transpose(0, 2, 1)[:, None]
        parts = to_bracket @ jacobian.reshape(len(brackets), 2, 3, -1)
        return np.asarray(parts.reshape(len(brackets), 6, -1))


class _Axes:
    """Joint axes, and for each board the joints that carry the board."""

    def __init__(self, robot: Robot, hand: Hand) -> None:
        """Collect the joint axes, the links of the boards, and which joints carry which board, for the Jacobian."""
        moving = [joint for joint in robot.joints if joint.axis is not None]
        self.axes = np.stack([joint.axis for joint in moving if joint.axis is not None])
        self.joint_links = np.array([robot.get_link_index(joint.child) for joint in moving])
        mountings = [(board.link_name, board.pose) for board in hand.boards]
        self.board_links = np.array([robot.get_link_index(link) for link, _ in mountings if link is not None])
        self.bracket_poses = np.stack([pose for _, pose in mountings if pose is not None])
        parent_of = {joint.child: joint.parent for joint in robot.joints}
        self.is_carried = np.zeros((len(mountings), len(moving)))  # 1 where the joint carries the board, else 0
        for row, (link, _) in enumerate(mountings):
            while link is not None and link in parent_of:
                self.is_carried[row] += [joint.child == link for joint in moving]
                link = parent_of[link]


def _cross_matrices(vectors: FloatArray) -> FloatArray:
    """Return the matrices f64[s, 3, 3] that compute the cross product with vectors f64[s, 3]: [v]x w = v x w."""
    matrices = np.zeros((len(vectors), 3, 3))
    x, y, z = vectors.T
    matrices[:, 0, 1], matrices[:, 0, 2], matrices[:, 1, 2] = -z, y, -x
    matrices -= matrices.transpose(0, 2, 1)
    return matrices


def _motion_about(deflection: FloatArray, centre: FloatArray) -> FloatArray:
    """Compute the transform f64[4, 4] of a deflection f64[6]: translation, metres, then rotation vector, radians.

    The rotation is about the point `centre` f64[3]; the translation is applied after the rotation.
    """
    rx, ry, rz = deflection[3:].tolist()
    angle2 = rx * rx + ry * ry + rz * rz
    angle = angle2**0.5
    # Rodrigues' formula; the limits of its two factors for a vanishing angle are 1 and 1/2.
    s, c = (np.sin(angle) / angle, (1.0 - np.cos(angle)) / angle2) if angle > 1e-8 else (1.0, 0.5)
    skew = np.array([[0.0, -rz, ry], [rz, 0.0, -rx], [-ry, rx, 0.0]])
    motion = np.eye(4)
    motion[:3, :3] += s * skew + c * (skew @ skew)
    motion[:3, 3] = deflection[:3] + centre - motion[:3, :3] @ centre
    return motion
