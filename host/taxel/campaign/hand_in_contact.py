"""Joint dynamics of the emulated hand during a grasp: motor torques, contact of the emulated skin, free object.

Joints and object are integrated together: M x'' + B x' = torque + contact(x), with diagonal M and B of the joints. Each
step is linearly implicit (Rosenbrock-Euler): with the stiffness K of all contacts at the start of the step,
(M / dt + B + dt K) v' = M v / dt + torque + contact. The step is stable for any stiffness of the layer.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.campaign.free_object import FreeObject
from taxel.emulated.contact import ContactLoad, SkinContact
from taxel.grasp.objects import SKIN_FRICTION
from taxel.hand import Hand
from taxel.hand.kinematics import Kinematics
from taxel.hand.robot import Robot
from taxel.hand.transforms import cross
from taxel.types import FloatArray

JOINT_INERTIA_KG_M2: Final = 1.5e-3
JOINT_DAMPING_NM_S: Final = 0.03
JOINT_FRICTION_NM: Final = 0.02
JOINT_BREAKAWAY_RAD: Final = 0.0015
"""Rotation over which the dry friction of a joint builds up as a spring: a loaded joint comes to rest (chosen)."""
JOINT_STOP_NM_PER_RAD: Final = 250.0
"""Stiffness of the stop at each end of a joint's range (chosen: 0.7 Nm move it by 3 mrad)."""
JOINT_STOP_NM_S_PER_RAD: Final = 1.0

SUBSTEP_S: Final = 3e-3
"""Largest time step in contact; different from the simulator's, so that the two solvers stay independent."""
STEP_MOTION_M: Final = 0.2e-3
"""Largest motion of a board relative to an object that it may touch in one time step (chosen: a tenth of the layer)."""
MIN_SUBSTEP_S: Final = 0.3e-3
BOARD_RADIUS_M: Final = 0.03
"""Distance from a bracket's origin within which its rotation counts in the choice of the time step (chosen)."""
OBJECT_DOF: Final = 6


class HandInContact:
    """Joint dynamics (see `taxel.hand.allegro.JointDynamics`) of a hand with a prescribed wrist and a free object.

    robot: the part of the robot below its wrist. contact: the contact solver of the emulated skin. object_index: number
    of the object in the world. item: the object on its stand. wrist_pose: f64[4, 4], world. angles: initial joint
    angles f64[j], radians.
    """

    def __init__(
        self,
        hand: Hand,
        robot: Robot,
        contact: SkinContact,
        object_index: int,
        item: FreeObject,
        wrist_pose: FloatArray,
        angles: FloatArray,
    ) -> None:
        """Create the dynamics of a hand at rest; arguments as for the class. Earlier contacts are forgotten."""
        self._kinematics = Kinematics(robot, hand)
        self._contact, self._index, self._item = contact, object_index, item
        self._wrist, self._wrist_before = wrist_pose, wrist_pose
        self._joints = len(robot.joint_names)
        self._lower, self._upper = robot.lower, robot.upper
        self._offsets = np.stack([contact.get_bracket_offset(board) for board in range(contact.board_count)])
        self._axes = _Axes(robot, hand)
        self._angles = np.asarray(angles, dtype=np.float64).copy()
        self._rest_angles = self._angles.copy()  # where the springs of the dry friction are unloaded
        self._velocity = np.zeros(self._joints + OBJECT_DOF)
        self.touched_count = 0
        contact.set_friction(SKIN_FRICTION)

    @property
    def angles(self) -> FloatArray:
        """Joint angles, radians, f64[j]."""
        return self._angles.copy()

    @property
    def velocities(self) -> FloatArray:
        """Joint speeds, radians per second, f64[j]."""
        return self._velocity[: self._joints].copy()

    def object_pose(self) -> FloatArray:
        """Pose f64[4, 4] of the object in the world."""
        return self._item.pose.copy()

    def bracket_poses(self) -> FloatArray:
        """Return the nominal poses f64[s, 4, 4] of the brackets of the boards, without their mounting offsets."""
        return np.asarray(self._wrist @ self._kinematics.compute_sensor_poses(self._angles))

    def hold_wrist(self, pose: FloatArray) -> None:
        """Set the pose of the wrist, f64[4, 4], in world coordinates; it moves there during the next step."""
        self._wrist_before, self._wrist = self._wrist, pose

    def steady_object(self, firmness: float) -> None:
        """Set how firmly the experimenter steadies the object, 0 to 1."""
        self._item.steady(firmness)

    def step(self, torque_nm: FloatArray, dt_s: float) -> FloatArray:
        """Integrate the motion of hand and object over `dt_s` seconds; return the joint angles f64[j], radians.

        torque_nm: motor torques f64[j]. The wrist moves from its previous to its present pose at constant speed.
        """
        end, elapsed = self._wrist, 0.0
        shift = (end[:3, 3] - self._wrist_before[:3, 3]) / dt_s
        while elapsed < dt_s - 1e-9:
            self._wrist = end.copy()
            self._wrist[:3, 3] -= shift * (dt_s - elapsed)
            elapsed += self._substep(torque_nm, dt_s - elapsed, shift)
        self._wrist = self._wrist_before = end
        return self.angles

    def _substep(self, torque_nm: FloatArray, longest: float, wrist_speed: FloatArray) -> float:
        """Integrate over one implicit Euler step with the contact forces of the skin; return its duration, seconds.

        The new velocity v solves (mass / dt + damping + dt stiffness) v = mass v_old / dt + force. torque_nm: motor
        torques f64[j]. longest: longest duration. wrist_speed: f64[3], m/s, world.
        """
        joints = self._joints
        links = self._wrist @ self._kinematics.compute_link_poses(self._angles)
        brackets = links[self._axes.board_links] @ self._axes.bracket_poses
        load = self._contact.compute_load(self._index, self._item.pose, brackets, advance=True)
        self.touched_count = load.touched_board_count
        true = brackets @ self._offsets
        jacobian = self._jacobian(links, true)
        dt = self._choose_duration(load, jacobian, true, longest, wrist_speed)
        weight, support = self._item.compute_support()
        steadying, rate, damping = self._item.compute_steadying()
        friction, friction_rate = self._resist_joints()
        force = np.concatenate([torque_nm + friction, weight + steadying])
        mass, system = np.zeros((2, joints + OBJECT_DOF, joints + OBJECT_DOF))
        mass[:joints, :joints] = JOINT_INERTIA_KG_M2 * np.eye(joints)
        mass[joints:, joints:] = self._item.compute_mass_matrix()
        system[:joints, :joints] = np.diag(JOINT_DAMPING_NM_S + dt * friction_rate)
        system[joints:, joints:] = dt * support + np.diag(dt * rate + damping)
        loaded = np.flatnonzero(load.wrench.any(axis=1))
        if len(loaded):
            flat = jacobian[loaded].reshape(-1, joints + OBJECT_DOF)
            force += load.wrench[loaded].ravel() @ flat
            system += dt * flat.T @ (load.stiffness[loaded] @ jacobian[loaded]).reshape(flat.shape)
            self._add_wrist_motion(load, true, loaded, flat, dt * wrist_speed, force)
        system += mass / dt
        self._velocity = np.linalg.solve(system, mass @ self._velocity / dt + force)
        self._angles += dt * self._velocity[:joints]
        self._item.move(self._velocity[joints:], dt)
        return dt

    def _add_wrist_motion(
        self,
        load: ContactLoad,
        true: FloatArray,
        loaded: NDArray[np.intp],
        flat: FloatArray,
        shift: FloatArray,
        force: FloatArray,
    ) -> None:
        """Add the change of the contact forces by the motion of the wrist in this time step to `force`, in place.

        true: actual poses of the brackets. loaded: boards in contact. flat: their Jacobian. shift: f64[3], metres.
        """
        motion = np.zeros((len(loaded), 6))
        motion[:, :3] = np.einsum("sji,j->si", true[loaded, :3, :3], shift)
        force -= np.einsum("sij,sj->si", load.stiffness[loaded], motion).ravel() @ flat

    def _choose_duration(
        self, load: ContactLoad, jacobian: FloatArray, true: FloatArray, longest: float, wrist_speed: FloatArray
    ) -> float:
        """Choose the duration of the next time step, so that no board near the object moves too far.

        load: of the contact. jacobian, true: of all brackets. longest: remaining time, seconds.
        """
        motion = jacobian @ self._velocity
        separates = np.einsum("si,si->s", load.wrench, motion) > 0.0
        motion[:, :3] += np.einsum("sji,j->si", true[:, :3, :3], wrist_speed)
        speed = np.linalg.norm(motion[:, :3], axis=1) + BOARD_RADIUS_M * np.linalg.norm(motion[:, 3:], axis=1)
        is_near = load.clearance_m < speed * SUBSTEP_S + STEP_MOTION_M
        speed = speed[is_near & ~separates].max(initial=0.0)
        limit = min(SUBSTEP_S if self.touched_count else longest, STEP_MOTION_M / max(speed, 1e-9))
        return float(longest / np.ceil(longest / max(limit, MIN_SUBSTEP_S) - 1e-9))

    def _resist_joints(self) -> tuple[FloatArray, FloatArray]:
        """Torque f64[j] of dry friction and of the stops of the joints, and its stiffness f64[j], Nm and Nm/rad."""
        rate = JOINT_FRICTION_NM / JOINT_BREAKAWAY_RAD
        bend = (self._angles - self._rest_angles).clip(-JOINT_BREAKAWAY_RAD, JOINT_BREAKAWAY_RAD)
        self._rest_angles = self._angles - bend
        speed = self._velocity[: self._joints]
        slides = (np.abs(bend) >= JOINT_BREAKAWAY_RAD) & (bend * speed > 0.0)
        beyond = self._angles - self._angles.clip(self._lower, self._upper)
        stop = np.where(beyond != 0.0, JOINT_STOP_NM_PER_RAD, 0.0)
        torque = -rate * bend - stop * beyond - np.where(beyond * speed > 0.0, JOINT_STOP_NM_S_PER_RAD * speed, 0.0)
        return torque, np.where(slides, 0.0, rate) + stop

    def _jacobian(self, links: FloatArray, brackets: FloatArray) -> FloatArray:
        """Compute the Jacobian f64[s, 6, j + 6] of the motion of the brackets relative to the object, bracket frames.

        Rows: translation, then rotation of a bracket. Columns: speeds of the j joints, then the velocity and the
        angular velocity of the object, which have a negative sign. links: poses of the robot's links. brackets: true
        poses f64[s, 4, 4].
        """
        axes = (links[self._axes.joint_links, :3, :3] @ self._axes.axes[:, :, None])[:, :, 0]
        arms = brackets[:, None, :3, 3] - links[self._axes.joint_links, :3, 3]
        rotations = self._axes.is_carried[..., None] * axes
        jacobian = np.zeros((len(brackets), 6, self._joints + OBJECT_DOF))
        jacobian[:, :3, : self._joints] = cross(rotations, arms).transpose(0, 2, 1)
        jacobian[:, 3:, : self._joints] = rotations.transpose(0, 2, 1)
        jacobian[:, :3, self._joints : self._joints + 3] = -np.eye(3)
        jacobian[:, :3, self._joints + 3 :] = _cross_matrices(brackets[:, :3, 3] - self._item.centre)
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
