"""Reference of the dynamics of the emulated hand in NumPy: the equations of firmware/emulator/dynamics, one by one.

Joints and object are integrated together: M x'' + B x' = torque + contact(x), with diagonal M and B of the joints. Each
step is linearly implicit (Rosenbrock-Euler): with the stiffness K of all contacts at the start of the step,
(M / dt + B + dt K) v' = M v / dt + torque + contact.
"""

import numpy as np
from numpy.typing import NDArray

from taxel.campaign.free_object import MESH_RESOLUTION
from taxel.campaign.hand_in_contact import (
    BOARD_RADIUS_M,
    JOINT_BREAKAWAY_RAD,
    JOINT_DAMPING_NM_S,
    JOINT_FRICTION_NM,
    JOINT_INERTIA_KG_M2,
    JOINT_STOP_NM_PER_RAD,
    JOINT_STOP_NM_S_PER_RAD,
    MIN_SUBSTEP_S,
    STEP_MOTION_M,
    SUBSTEP_S,
)
from taxel.emulated.contact import ContactLoad, SkinContact
from taxel.emulated.dynamics import OBJECT_DOF
from taxel.grasp.objects import (
    GRAVITY_M_PER_S2,
    SKIN_FRICTION,
    STAND_FRICTION,
    STAND_N_PER_M,
    STEADYING_N_PER_M,
    STEADYING_N_S_PER_M,
    STEADYING_NM_PER_RAD,
    STEADYING_NM_S_PER_RAD,
    compute_mass_properties,
)
from taxel.grasp.shapes import Shape
from taxel.hand import Hand
from taxel.hand.kinematics import Kinematics
from taxel.hand.robot import Robot
from taxel.hand.transforms import cross, from_rotation_vector, to_rotation_vector
from taxel.types import FloatArray


class ReferenceObject:
    """Pose, inertia and support of a free object. Coordinates: motion of the centre of mass and rotation, world.

    The object touches the stand with its vertices. Each vertex is a spring normal to the plane of the stand. It sticks
    to the plane, and slides where the force along the plane exceeds the friction coefficient times the normal force.

    Attributes:
        pose: f64[4, 4], object frame in the world.
    """

    def __init__(self, shape: Shape, pose: FloatArray) -> None:
        """Place an object at rest on its stand, whose surface is the plane z = 0 of the object's first pose."""
        self.pose = pose.copy()
        mass = compute_mass_properties(shape)
        self._mass_kg, self._centre, self._inertia = mass.mass_kg, mass.centre_m, mass.inertia_kg_m2
        self._vertices = np.unique(shape.mesh(MESH_RESOLUTION)[0].round(9), axis=0)
        self._up, self._level = pose[:3, 2].copy(), float(pose[:3, 2] @ pose[:3, 3])
        bottom = self._vertices[:, 2] < self._vertices[:, 2].min() + 1e-6
        self._rate = STAND_N_PER_M / bottom.sum()
        self._stuck = np.full_like(self._vertices, np.nan)
        self._steadied_pose, self._steadying = pose.copy(), 1.0

    def steady(self, firmness: float) -> None:
        """Set how firmly the experimenter's hand steadies the object, 0 (not at all) to 1.

        If the value rises from 0, the experimenter holds the object at its present pose from now on.
        """
        if self._steadying == 0.0 and firmness > 0.0:
            self._steadied_pose = self.pose.copy()
        self._steadying = firmness

    def compute_steadying(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Compute the load of the experimenter's hand on the object, and its stiffness and its damping, each f64[6].

        The load is a force in N and a moment in Nm about the centre of mass; stiffness and damping are per coordinate.
        """
        firmness = self._steadying
        motion = np.zeros(6)
        if firmness == 0.0:
            return motion, motion, motion
        motion[:3] = self.pose[:3, 3] - self._steadied_pose[:3, 3]
        motion[3:] = to_rotation_vector(self.pose @ np.linalg.inv(self._steadied_pose))
        arm = self.pose[:3, 3] - self.centre
        motion[:3] -= np.cross(motion[3:], arm)  # of the centre of mass
        stiffness = firmness * np.repeat([STEADYING_N_PER_M, STEADYING_NM_PER_RAD], 3)
        return -stiffness * motion, stiffness, firmness * np.repeat([STEADYING_N_S_PER_M, STEADYING_NM_S_PER_RAD], 3)

    @property
    def centre(self) -> FloatArray:
        """Centre of mass in the world, f64[3], metres."""
        return np.asarray(self.pose[:3, :3] @ self._centre + self.pose[:3, 3])

    def compute_mass_matrix(self) -> FloatArray:
        """Compute the mass matrix f64[6, 6] for the velocity of the centre of mass and the angular velocity, world."""
        matrix = np.diag(np.repeat([self._mass_kg, 0.0], 3))
        matrix[3:, 3:] = self.pose[:3, :3] @ self._inertia @ self.pose[:3, :3].T
        return matrix

    def compute_support(self) -> tuple[FloatArray, FloatArray]:
        """Compute the load of weight and stand on the object, f64[6], and the stand's stiffness f64[6, 6].

        The load is a force in N and a moment in Nm about the centre of mass. The call also moves the points at which
        sliding vertices stick to the stand, so call it once per time step.
        """
        load, stiffness = np.zeros(6), np.zeros((6, 6))
        load[2] = -self._mass_kg * GRAVITY_M_PER_S2
        points = self._vertices @ self.pose[:3, :3].T + self.pose[:3, 3]
        depth = self._level - points @ self._up
        is_touching = depth > 0.0
        self._stuck[~is_touching] = np.nan
        if not is_touching.any():
            return load, stiffness
        points, depth = points[is_touching], depth[is_touching]
        stuck = np.where(np.isnan(self._stuck[is_touching]), points, self._stuck[is_touching])
        slip = points - stuck
        slip -= (slip @ self._up)[:, None] * self._up
        distance = np.linalg.norm(slip, axis=1)
        share = np.minimum(1.0, STAND_FRICTION * depth / np.maximum(distance, 1e-12))
        self._stuck[is_touching] = points - share[:, None] * slip
        across = np.outer(self._up, self._up)
        springs = across + share[:, None, None] * (np.eye(3) - across)
        direction = slip / np.maximum(distance, 1e-12)[:, None]
        springs -= np.where(share < 1.0, share, 0.0)[:, None, None] * direction[:, :, None] * direction[:, None, :]
        arms = points - self.centre
        motion = np.zeros((len(points), 6, 3))
        motion[:, :3] = np.eye(3)
        x, y, z = arms.T
        motion[:, 3, 1], motion[:, 3, 2], motion[:, 4, 2] = -z, y, -x
        motion[:, 4, 0], motion[:, 5, 0], motion[:, 5, 1] = z, -y, x
        force = self._rate * (depth[:, None] * self._up - share[:, None] * slip)
        load += np.einsum("kij,kj->i", motion, force)
        stiffness += self._rate * np.einsum("kij,kjl,kml->im", motion, springs, motion)
        return load, stiffness

    def move(self, velocity: FloatArray, dt: float) -> None:
        """Move the object for `dt` seconds. velocity: f64[6], of the centre of mass (m/s), and angular (rad/s)."""
        centre = self.centre + dt * velocity[:3]
        rotation = from_rotation_vector(dt * velocity[3:])[:3, :3] @ self.pose[:3, :3]
        self.pose[:3, :3], self.pose[:3, 3] = rotation, centre - rotation @ self._centre


class ReferenceHand:
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
        item: ReferenceObject,
        wrist_pose: FloatArray,
        angles: FloatArray,
    ) -> None:
        """Create the dynamics of a hand at rest; arguments as for the class. Clears the contact solver's contacts."""
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
        """Return the pose f64[4, 4] of the object in the world."""
        return self._item.pose.copy()

    def bracket_poses(self) -> FloatArray:
        """Return the nominal poses f64[s, 4, 4] of the brackets of the boards, without their mounting offsets."""
        return np.asarray(self._wrist @ self._kinematics.compute_sensor_poses(self._angles))

    def hold_wrist(self, pose: FloatArray) -> None:
        """Set the pose of the wrist, f64[4, 4], world. The wrist moves to it at constant speed during the next step."""
        self._wrist_before, self._wrist = self._wrist, pose

    def steady_object(self, firmness: float) -> None:
        """Set how firmly the experimenter's hand steadies the object, 0 (not at all) to 1."""
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
        torques f64[j]. longest: longest permitted duration, seconds. wrist_speed: f64[3], m/s, world.
        """
        joints = self._joints
        links = self._wrist @ self._kinematics.compute_link_poses(self._angles)
        brackets = links[self._axes.board_links] @ self._axes.bracket_poses
        load = self._contact.compute_load(self._index, self._item.pose, brackets, advance=True)
        self.touched_count = load.touched_board_count
        true = brackets @ self._offsets
        jacobian = self._compute_jacobian(links, true)
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
        """Add to `force`, in place, the change of the contact forces that the wrist's motion in this step causes.

        true: actual poses f64[s, 4, 4] of the brackets. loaded: indices of the boards in contact. flat: rows of the
        Jacobian for these boards. shift: motion of the wrist f64[3], metres.
        """
        motion = np.zeros((len(loaded), 6))
        motion[:, :3] = np.einsum("sji,j->si", true[loaded, :3, :3], shift)
        force -= np.einsum("sij,sj->si", load.stiffness[loaded], motion).ravel() @ flat

    def _choose_duration(
        self, load: ContactLoad, jacobian: FloatArray, true: FloatArray, longest: float, wrist_speed: FloatArray
    ) -> float:
        """Choose the duration of the next time step, seconds, so that no board near the object moves too far.

        load: load of the contact. jacobian, true: Jacobian and actual poses of all brackets. longest: remaining time,
        seconds. wrist_speed: f64[3], m/s, world.
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
        """Compute the torque f64[j] of dry friction and joint stops, Nm, and its stiffness f64[j], Nm/rad.

        The call also moves the rest angles of the friction springs, so call it once per time step.
        """
        rate = JOINT_FRICTION_NM / JOINT_BREAKAWAY_RAD
        bend = (self._angles - self._rest_angles).clip(-JOINT_BREAKAWAY_RAD, JOINT_BREAKAWAY_RAD)
        self._rest_angles = self._angles - bend
        speed = self._velocity[: self._joints]
        slides = (np.abs(bend) >= JOINT_BREAKAWAY_RAD) & (bend * speed > 0.0)
        beyond = self._angles - self._angles.clip(self._lower, self._upper)
        stop = np.where(beyond != 0.0, JOINT_STOP_NM_PER_RAD, 0.0)
        torque = -rate * bend - stop * beyond - np.where(beyond * speed > 0.0, JOINT_STOP_NM_S_PER_RAD * speed, 0.0)
        return torque, np.where(slides, 0.0, rate) + stop

    def _compute_jacobian(self, links: FloatArray, brackets: FloatArray) -> FloatArray:
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
