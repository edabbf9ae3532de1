"""One time step of the bodies with the soft layer between hand and object, stable for any stiffness of the layer.

MuJoCo computes inertia M, bias forces and kinematics. The step of length h is linearly implicit in the stiffness K of
layer and stand and in the damping D: (M / h + D + h K) v' = M v / h + forces. The positions are then integrated with
the new velocity v'.

This Python implementation is the reference of the tests; grasps use the C implementation (`taxel.sim.native_push`).
"""

import copy
from typing import Final

import mujoco
import numpy as np

from taxel.hand.transforms import cross, inverse, rotate
from taxel.sim.scene import JOINT_FRICTION_NM, Scene
from taxel.sim.soft_contact import LayerContact
from taxel.sim.stand_contact import StandContact
from taxel.sim.steadying import Steadying
from taxel.types import BoolArray, FloatArray

SOFT_STEP_S: Final = 0.004
"""Time step with the soft layer, seconds (chosen). It differs from the time steps of the emulated hand and of rigid
contact, so that no agreement between them is due to equal steps.
"""

MOTION_PER_STEP_M: Final = 0.15e-3
"""Largest motion of a board relative to the object in one step near a contact, metres (chosen: a tenth of the layer). A
longer step is divided, because the force law of the layer rises steeply with the compression.
"""
MAX_SUBSTEPS: Final = 20
LIMIT_NM_PER_RAD: Final = 300.0
LIMIT_NM_S_PER_RAD: Final = 1.0
"""Stiffness and damping of a joint beyond its range (chosen: 0.7 Nm move it by 2 mrad)."""
BOARD_RADIUS_M: Final = 0.03
"""Distance from a bracket's origin at which a board's rotation is converted to a motion, to choose the step
(chosen).
"""

PRESLIDING_RAD: Final = 0.002
"""Rotation at which a joint at rest begins to slide against its dry friction, radians (chosen): below, the friction is
a spring, so that a loaded joint comes to rest.
"""


class SoftPush:
    """Time integration of a MuJoCo scene in which hand and object touch only through the soft layer `contact`.

    The object stands on its stand (`place_stand`). step_s: time step, seconds.
    """

    def __init__(self, scene: Scene, contact: LayerContact, step_s: float = SOFT_STEP_S) -> None:
        """Prepare the time integration of a MuJoCo scene whose only contact is that of the soft dielectric layer.

        contact: computes forces of the layer on the boards. step_s: time step. The scene's model is copied, and
        contact, constraints and damping of MuJoCo are disabled in the copy, because `step` computes them.
        """
        self._contact, self.step_s = contact, step_s
        self._model = model = copy.copy(scene.model)
        # The layer replaces MuJoCo's contact; joint friction and joint ranges are part of `step`.
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT | mujoco.mjtDisableBit.mjDSBL_CONTACT
        model.opt.timestep = step_s
        self._damping = model.dof_damping.copy()
        model.dof_damping[:] = 0.0  # damping is implicit in `step`
        self._object_body = model.body("object").id
        first = model.body_dofadr[self._object_body]
        self._object_dofs = slice(
            first, first + 6
        )  # velocity of its origin in the world, angular velocity in its frame
        self._shape, self._stand = scene.grasp_object.shape, StandContact(scene.grasp_object.shape, np.eye(4))
        self._boards, self._board_poses = scene.board_bodies, scene.board_poses
        hinges = np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE)
        self._hinge_dofs, self._hinge_angles = model.jnt_dofadr[hinges], model.jnt_qposadr[hinges]
        self._min_angles, self._max_angles = model.jnt_range[hinges].T.copy()
        self._roots = model.body_rootid[model.dof_bodyid]
        moves_board = np.stack([_find_moving_dofs(model, int(body)) for body in self._boards])
        self._dof_sign = moves_board - _find_moving_dofs(model, self._object_body)  # for motion relative to the object
        self._inertia = np.zeros((model.nv, model.nv))
        self.steadying = Steadying(scene)
        self._last_wrench = np.zeros((len(self._boards), 6))
        self._stuck_angles: FloatArray | None = None  # angles at which the dry friction of the hinges vanishes

    def place_stand(self, pose: FloatArray) -> None:
        """Set the pose f64[4, 4] of the stand in the world, on whose plane z = 0 the object stands."""
        self._stand = StandContact(self._shape, pose)

    def set_firmness(self, firmness: float) -> None:
        """Set how firmly the experimenter holds the object, 0 to 1. A hold begins at the present pose of the object."""
        self.steadying.set_firmness(firmness)

    def step(self, data: mujoco.MjData) -> None:
        """Advance the MuJoCo scene by one time step of `step_s` under the joint torques `data.qfrc_applied`.

        The step is divided if boards near the object move fast. Afterwards only qpos, qvel and time in `data` are
        current.
        """
        remaining = 1.0
        while remaining > 1e-9:  # fraction of the time step; a smaller one is a rounding error of the subtractions
            mujoco.mj_fwdPosition(self._model, data)
            mujoco.mj_fwdVelocity(self._model, data)
            share = min(self._choose_step(data), remaining)
            self._substep(data, share * self.step_s)
            remaining -= share

    def _choose_step(self, data: mujoco.MjData) -> float:
        """Choose the length of the next substep as a fraction of `step_s`, at least 1 / `MAX_SUBSTEPS`.

        Above this minimum, no board near the object moves farther than `MOTION_PER_STEP_M`, except a board that moves
        away from the object.
        """
        velocity = self._compute_jacobian(data, self._read_sensor_poses(data)) @ data.qvel
        speed = np.linalg.norm(velocity[:, :3], axis=1) + BOARD_RADIUS_M * np.linalg.norm(velocity[:, 3:], axis=1)
        is_near = self._contact.get_clearances() < speed * self.step_s + MOTION_PER_STEP_M
        speed = speed[is_near & ~self._separates(velocity)].max(initial=0.0)
        return float(1.0 / np.clip(np.ceil(speed * self.step_s / MOTION_PER_STEP_M), 1, MAX_SUBSTEPS))

    def _separates(self, velocity: FloatArray) -> BoolArray:
        """Return whether each board moves away from the object, bool[s]: the power of the load on it is positive.

        velocity: f64[s, 6], velocity and angular velocity relative to the object, world.
        """
        return np.asarray((self._last_wrench * velocity).sum(axis=1) > 0.0)

    def _substep(self, data: mujoco.MjData, h: float) -> None:
        """Advance the scene by h seconds; poses and velocities in `data` must be current (`mj_fwdVelocity`).

        The new velocity v' solves (M / h + D + h K) v' = M v / h + forces, with the inertia M, the damping D and the
        stiffness K of layer, stand and joint springs.
        """
        model, inertia = self._model, self._inertia
        poses = self._read_sensor_poses(data)
        object_pose = self._read_object_pose(data)
        load = self._contact.compute_load(poses, object_pose, advance=True)
        self._last_wrench = load.wrench
        mujoco.mj_fullM(model, data, inertia)
        velocity = data.qvel
        force = data.qfrc_applied + data.qfrc_passive - data.qfrc_bias + inertia @ velocity / h
        damping = self._damping.copy()
        self._add_joint_friction(data, h, force, damping)
        self._add_joint_limits(data, h, force, damping)
        system = inertia / h
        system.flat[:: model.nv + 1] += damping
        if load.wrench.any():
            jacobian = self._compute_jacobian(data, poses)
            stacked = jacobian.reshape(-1, model.nv)
            force += load.wrench.ravel() @ stacked
            system += h * stacked.T @ (load.stiffness @ jacobian).reshape(-1, model.nv)
        self._add_stand(object_pose, h, force, system)
        self._add_steadying(data, h, force, system)
        velocity[:] = np.linalg.solve(system, force)
        mujoco.mj_integratePos(model, data.qpos, velocity, h)
        data.time += h

    def _add_joint_friction(self, data: mujoco.MjData, h: float, force: FloatArray, damping: FloatArray) -> None:
        """Add the dry friction of the hinges to the equations of a step of h seconds, in place.

        The friction of a hinge is a spring to the angle at which the hinge came to rest, limited to `JOINT_FRICTION_NM`
        (Dahl 1968, with an elastic-plastic spring). force: f64[dofs], right-hand side. damping: f64[dofs], added to the
        diagonal of the matrix.
        """
        angles = data.qpos[self._hinge_angles]
        if self._stuck_angles is None:
            self._stuck_angles = angles.copy()
        deflection = np.clip(angles - self._stuck_angles, -PRESLIDING_RAD, PRESLIDING_RAD)
        self._stuck_angles = angles - deflection
        stiffness = JOINT_FRICTION_NM / PRESLIDING_RAD
        force[self._hinge_dofs] -= stiffness * deflection
        is_sliding = (np.abs(deflection) >= PRESLIDING_RAD) & (deflection * data.qvel[self._hinge_dofs] > 0.0)
        damping[self._hinge_dofs] += np.where(is_sliding, 0.0, h * stiffness)

    def _add_joint_limits(self, data: mujoco.MjData, h: float, force: FloatArray, damping: FloatArray) -> None:
        """Add stiff springs at the ends of the joints' ranges to the equations of a step of h seconds, in place.

        The springs are implicit like the contact, so that a finger at its limit bears the forces on its boards. force:
        f64[dofs], right-hand side. damping: f64[dofs], added to the diagonal of the matrix.
        """
        angles = data.qpos[self._hinge_angles]
        excess = angles - np.clip(angles, self._min_angles, self._max_angles)
        force[self._hinge_dofs] -= LIMIT_NM_PER_RAD * excess
        damping[self._hinge_dofs] += np.where(excess != 0.0, h * LIMIT_NM_PER_RAD + LIMIT_NM_S_PER_RAD, 0.0)

    def _add_stand(self, object_pose: FloatArray, h: float, force: FloatArray, system: FloatArray) -> None:
        """Add the contact of the object with its stand to the equations of a step of h seconds, in place.

        force: f64[dofs]. system: f64[dofs, dofs], multiplies the new velocity.
        """
        load = self._stand.compute_load(object_pose, advance=True)
        jacobian = np.eye(6)
        jacobian[3:, 3:] = object_pose[:3, :3]
        force[self._object_dofs] += load.wrench @ jacobian
        system[self._object_dofs, self._object_dofs] += h * jacobian.T @ load.stiffness @ jacobian

    def _add_steadying(self, data: mujoco.MjData, h: float, force: FloatArray, system: FloatArray) -> None:
        """Add the experimenter's hand, which steadies the object, to the equations of a step of h seconds, in place.

        force: f64[dofs]. system: f64[dofs, dofs], multiplies the new velocity. No change at a firmness of 0.
        """
        if self.steadying.firmness == 0.0:
            return
        load, stiffness, damping = self.steadying.compute_load(data)
        force[self._object_dofs] += load
        system[self._object_dofs, self._object_dofs] += h * stiffness + damping

    def compute_loads(self, data: mujoco.MjData) -> tuple[FloatArray, FloatArray]:
        """Compute the wrench on each board, f64[s, 6] (N, Nm; bracket frame), and the force on taxels, f64[n] (N)."""
        poses, object_pose = self._read_sensor_poses(data), self._read_object_pose(data)
        wrench = self._contact.compute_load(poses, object_pose).wrench
        to_bracket = inverse(poses)
        force, moment = (rotate(to_bracket, wrench[:, None, part])[:, 0] for part in (slice(0, 3), slice(3, 6)))
        return np.hstack([force, moment]), self._contact.compute_taxel_forces(poses, object_pose)

    def _read_sensor_poses(self, data: mujoco.MjData) -> FloatArray:
        """Return the poses of the brackets in the world, f64[s, 4, 4]."""
        poses = np.zeros((len(self._boards), 4, 4))
        poses[:, :3, :3] = data.xmat[self._boards].reshape(-1, 3, 3)
        poses[:, :3, 3], poses[:, 3, 3] = data.xpos[self._boards], 1.0
        return poses @ self._board_poses

    def _read_object_pose(self, data: mujoco.MjData) -> FloatArray:
        """Return the pose of the object in the world, f64[4, 4]."""
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = data.xmat[self._object_body].reshape(3, 3), data.xpos[self._object_body]
        return pose

    def _compute_jacobian(self, data: mujoco.MjData, poses: FloatArray) -> FloatArray:
        """Compute the Jacobian of the motion of each bracket relative to the object, f64[s, 6, dofs], world.

        It contains velocity and angular velocity per unit velocity of each degree of freedom. The velocity is that of
        the bracket's origin relative to the point of the object at the same place.
        """
        rotation_axis, centre = data.cdof[:, :3], data.subtree_com[self._roots]  # cdof refers to the tree's centre
        jacobian = np.empty((len(poses), 6, len(rotation_axis)))
        arm = poses[:, None, :3, 3] - centre
        jacobian[:, :3] = (data.cdof[:, 3:] + cross(rotation_axis, arm)).transpose(0, 2, 1)
        jacobian[:, 3:] = rotation_axis.T
        jacobian *= self._dof_sign[:, None]
        return jacobian


def _find_moving_dofs(model: mujoco.MjModel, body: int) -> FloatArray:
    """Return the degrees of freedom that move a body of the model, f64[dofs]: 1 for those that do, else 0.

    These are the degrees of freedom of the body and of its ancestors.
    """
    ancestors = [body]
    while ancestors[-1] > 0:
        ancestors.append(int(model.body_parentid[ancestors[-1]]))
    return np.isin(model.dof_bodyid, ancestors).astype(np.float64)
