"""One time step of the bodies with the soft layer between hand and object, stable for any stiffness of the layer.

MuJoCo computes inertia M, spring forces, bias forces and kinematics. The step of length h is linearly implicit in the
stiffness K of layer and mount and in the damping D: (M / h + D + h K) v' = M v / h + forces. The positions are then
integrated with the new velocity v'.
"""

import copy
from typing import Final

import mujoco
import numpy as np

from taxel.hand.transforms import cross, inverse, rotate
from taxel.sim.scene import JOINT_FRICTION_NM, Scene
from taxel.sim.soft_contact import LayerContact
from taxel.types import FloatArray

SOFT_STEP_S: Final = 0.004
"""Time step with the soft layer, seconds (chosen). It differs from the time steps of the emulated hand and of rigid
contact, so that no agreement between them is due to equal steps.
"""

STICKING_RAD_S: Final = 0.003
"""Joint speed below which dry friction acts as a stiff damper, rad/s (chosen). A smaller value lets joints creep less
and makes the friction force change more abruptly.
"""


class SoftPush:
    """Time integration of a MuJoCo scene in which hand and object touch only through the soft layer `contact`.

    step_s: time step, seconds.
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
        model.dof_damping[:] = 0.0  # damping is implicit in `step`: MuJoCo's passive forces contain the springs alone
        self._object_body = model.body("object").id
        self._boards, self._board_poses = scene.board_bodies, scene.board_poses
        hinges = np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE)
        self._hinge_dofs, self._hinge_angles = model.jnt_dofadr[hinges], model.jnt_qposadr[hinges]
        self._min_angles, self._max_angles = model.jnt_range[hinges].T.copy()
        self._spring = np.where(np.isin(model.dof_jntid, hinges), 0.0, model.jnt_stiffness[model.dof_jntid])
        self._roots = model.body_rootid[model.dof_bodyid]
        moves_board = np.stack([_find_moving_dofs(model, int(body)) for body in self._boards])
        self._dof_sign = moves_board - _find_moving_dofs(model, self._object_body)  # for motion relative to the object
        self._inertia = np.zeros((model.nv, model.nv))

    def step(self, data: mujoco.MjData) -> None:
        """Advance the MuJoCo scene by one time step of `step_s` under the joint torques `data.qfrc_applied`.

        Afterwards only qpos, qvel and time in `data` are current.
        """
        model, h, inertia = self._model, self.step_s, self._inertia
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        poses = self._read_sensor_poses(data)
        load = self._contact.compute_load(poses, self._read_object_pose(data))
        mujoco.mj_fullM(model, data, inertia)
        velocity = data.qvel
        force = data.qfrc_applied + data.qfrc_passive - data.qfrc_bias + inertia @ velocity / h
        damping = self._damping + h * self._spring
        damping[self._hinge_dofs] += JOINT_FRICTION_NM / (np.abs(velocity[self._hinge_dofs]) + STICKING_RAD_S)
        system = inertia / h
        system.flat[:: model.nv + 1] += damping
        if load.wrench.any():
            jacobian = self._compute_jacobian(data, poses)
            stacked = jacobian.reshape(-1, model.nv)
            force += load.wrench.ravel() @ stacked
            system += h * stacked.T @ (load.stiffness @ jacobian).reshape(-1, model.nv)
        velocity[:] = np.linalg.solve(system, force)
        mujoco.mj_integratePos(model, data.qpos, velocity, h)
        self._limit_joints(data)
        data.time += h

    def compute_loads(self, data: mujoco.MjData) -> tuple[FloatArray, FloatArray]:
        """Compute the wrench on each board, f64[s, 6] (N, Nm; bracket frame), and the force on taxels, f64[n] (N)."""
        poses, object_pose = self._read_sensor_poses(data), self._read_object_pose(data)
        wrench = self._contact.compute_load(poses, object_pose).wrench
        to_bracket = inverse(poses)
        force, moment = (rotate(to_bracket, wrench[:, None, part])[:, 0] for part in (slice(0, 3), slice(3, 6)))
        return np.hstack([force, moment]), self._contact.compute_taxel_forces(poses, object_pose)

    def _limit_joints(self, data: mujoco.MjData) -> None:
        """Clip the joint angles to their ranges; a joint at the end of its range has no velocity."""
        angles = data.qpos[self._hinge_angles]
        out_of_range = (angles < self._min_angles) | (angles > self._max_angles)
        if out_of_range.any():
            data.qpos[self._hinge_angles] = np.clip(angles, self._min_angles, self._max_angles)
            data.qvel[self._hinge_dofs[out_of_range]] = 0.0

    def _read_sensor_poses(self, data: mujoco.MjData) -> FloatArray:
        """Poses of the brackets in the world, f64[s, 4, 4]."""
        poses = np.zeros((len(self._boards), 4, 4))
        poses[:, :3, :3] = data.xmat[self._boards].reshape(-1, 3, 3)
        poses[:, :3, 3], poses[:, 3, 3] = data.xpos[self._boards], 1.0
        return poses @ self._board_poses

    def _read_object_pose(self, data: mujoco.MjData) -> FloatArray:
        """Pose of the object in the world, f64[4, 4]."""
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = data.xmat[self._object_body].reshape(3, 3), data.xpos[self._object_body]
        return pose

    def _compute_jacobian(self, data: mujoco.MjData, poses: FloatArray) -> FloatArray:
        """Jacobian of the motion of each bracket relative to the object, f64[s, 6, dofs], world.

        Velocity, then angular velocity, per unit velocity of each joint coordinate. The velocity is relative to the
        object's point at the bracket's origin.
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
