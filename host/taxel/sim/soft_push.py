"""One step of the bodies with the soft layer between hand and object, stable however stiff the layer is.

MuJoCo gives inertia, springs, bias forces and kinematics. The step is linearly implicit in the layer's stiffness K and
in that of the mount: (M / h + D + h K) v' = M v / h + forces, then the position moves on with v'.
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
"""Not the emulated hand's step, and not that of rigid contact."""

STICKING_RAD_S: Final = 0.003
"""Below this speed a joint's friction acts as a stiff damper."""


class SoftPush:
    """Moves a scene whose hand and object meet through `soft` only, by `step_s` seconds at a time."""

    def __init__(self, scene: Scene, soft: LayerContact, step_s: float = SOFT_STEP_S) -> None:
        self._soft, self.step_s = soft, step_s
        self._model = model = copy.copy(scene.model)
        # The layer bears, not the solids; friction and the joints' ranges are in the step itself.
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT | mujoco.mjtDisableBit.mjDSBL_CONTACT
        model.opt.timestep = step_s
        self._damping = model.dof_damping.copy()
        model.dof_damping[:] = 0.0  # it is in the implicit part: MuJoCo's passive forces are the springs' alone
        self._item = model.body("object").id
        self._boards, self._places = scene.board_bodies, scene.board_poses
        hinges = np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_HINGE)
        self._hinge_dofs, self._hinge_angles = model.jnt_dofadr[hinges], model.jnt_qposadr[hinges]
        self._low, self._high = model.jnt_range[hinges].T.copy()
        self._spring = np.where(np.isin(model.dof_jntid, hinges), 0.0, model.jnt_stiffness[model.dof_jntid])
        self._roots = model.body_rootid[model.dof_bodyid]
        carried = np.stack([_carried(model, int(body)) for body in self._boards])
        self._carried = carried - _carried(model, self._item)  # of the relative motion
        self._inertia = np.zeros((model.nv, model.nv))

    def step(self, data: mujoco.MjData) -> None:
        """Move on by `step_s` under `data.qfrc_applied`; only qpos and qvel are those of the new moment."""
        model, h, inertia = self._model, self.step_s, self._inertia
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        poses = self._sensor_poses(data)
        load = self._soft.load(poses, self._object_pose(data))
        mujoco.mj_fullM(model, data, inertia)
        velocity = data.qvel
        force = data.qfrc_applied + data.qfrc_passive - data.qfrc_bias + inertia @ velocity / h
        damping = self._damping + h * self._spring
        damping[self._hinge_dofs] += JOINT_FRICTION_NM / (np.abs(velocity[self._hinge_dofs]) + STICKING_RAD_S)
        system = inertia / h
        system.flat[:: model.nv + 1] += damping
        if load.wrench.any():
            motion = self._motion(data, poses)
            flat = motion.reshape(-1, model.nv)
            force += load.wrench.ravel() @ flat
            system += h * flat.T @ (load.stiffness @ motion).reshape(-1, model.nv)
        velocity[:] = np.linalg.solve(system, force)
        mujoco.mj_integratePos(model, data.qpos, velocity, h)
        self._stop(data)
        data.time += h

    def feel(self, data: mujoco.MjData) -> tuple[FloatArray, FloatArray]:
        """Wrench on each board in its bracket's frame f64[s, 6], and force on every taxel f64[n]."""
        poses, pose = self._sensor_poses(data), self._object_pose(data)
        load = self._soft.load(poses, pose)
        back = inverse(poses)
        parts = [rotate(back, load.wrench[:, None, part])[:, 0] for part in (slice(0, 3), slice(3, 6))]
        return np.hstack(parts), self._soft.taxel_forces(poses, pose)

    def _stop(self, data: mujoco.MjData) -> None:
        """A joint stays in its range, and loses its speed at the end of it."""
        wanted = data.qpos[self._hinge_angles]
        stopped = (wanted < self._low) | (wanted > self._high)
        if stopped.any():
            data.qpos[self._hinge_angles] = np.clip(wanted, self._low, self._high)
            data.qvel[self._hinge_dofs[stopped]] = 0.0

    def _sensor_poses(self, data: mujoco.MjData) -> FloatArray:
        poses = np.zeros((len(self._boards), 4, 4))
        poses[:, :3, :3] = data.xmat[self._boards].reshape(-1, 3, 3)
        poses[:, :3, 3], poses[:, 3, 3] = data.xpos[self._boards], 1.0
        return poses @ self._places

    def _object_pose(self, data: mujoco.MjData) -> FloatArray:
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = data.xmat[self._item].reshape(3, 3), data.xpos[self._item]
        return pose

    def _motion(self, data: mujoco.MjData, poses: FloatArray) -> FloatArray:
        """How fast each bracket's origin moves, and the bracket turns, against the object with each degree of freedom.

        f64[s, 6, dofs], in the world. Where the object moves, it is that of the point at the bracket's origin.
        """
        turn, about = data.cdof[:, :3], data.subtree_com[self._roots]  # MuJoCo's are about the whole tree's centre
        motion = np.empty((len(poses), 6, len(turn)))
        arm = poses[:, None, :3, 3] - about
        motion[:, :3] = (data.cdof[:, 3:] + cross(turn, arm)).transpose(0, 2, 1)
        motion[:, 3:] = turn.T
        motion *= self._carried[:, None]
        return motion


def _carried(model: mujoco.MjModel, body: int) -> FloatArray:
    """Which degrees of freedom move a body, f64[dofs]: 1 for its own and those above it, else 0."""
    above = [body]
    while above[-1] > 0:
        above.append(int(model.body_parentid[above[-1]]))
    return np.isin(model.dof_bodyid, above).astype(np.float64)
