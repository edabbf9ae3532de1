"""One step of the bodies with the soft layer between hand and object, stable however stiff the layer is.

MuJoCo gives inertia, springs, bias forces and kinematics. The step is linearly implicit in the layer's stiffness K and
in that of the mount: (M / h + D + h K) v' = M v / h + forces, then the position moves on with v'.
"""

from __future__ import annotations

import copy
from typing import Final

import mujoco
import numpy as np

from taxel.hand.transforms import FloatArray, cross, inverse, rotate
from taxel.sim.scene import JOINT_FRICTION_NM, Scene
from taxel.sim.soft_contact import SoftContact, SoftLoad

SOFT_STEP_S: Final = 0.004
"""Not the emulated hand's step, and not that of rigid contact."""

STICKING_RAD_S: Final = 0.003
"""Below this speed a joint's friction acts as a stiff damper."""


class SoftPush:
    """Moves a scene whose hand and object meet through `soft` only."""

    def __init__(self, scene: Scene, soft: SoftContact) -> None:
        self._soft = soft
        self._model = model = copy.copy(scene.model)
        item = model.geom("object").id
        model.geom_contype[item] = model.geom_conaffinity[item] = 0  # the layer bears, not the solids
        model.opt.timestep = SOFT_STEP_S
        self._damping = model.dof_damping.copy()
        model.dof_damping[:] = 0.0  # it is in the implicit part: MuJoCo's passive forces are the springs' alone
        self._item = model.body("object").id
        self._boards, self._places = scene.board_bodies, scene.board_poses
        kinds = model.jnt_type
        self._hinges = np.flatnonzero(kinds == mujoco.mjtJoint.mjJNT_HINGE)
        self._slides = np.flatnonzero(kinds == mujoco.mjtJoint.mjJNT_SLIDE)
        self._ball = int(np.flatnonzero(kinds == mujoco.mjtJoint.mjJNT_BALL)[0])
        self._hinge_dofs, self._slide_dofs = model.jnt_dofadr[self._hinges], model.jnt_dofadr[self._slides]
        self._ball_dofs = model.jnt_dofadr[self._ball] + np.arange(3)
        self._spring = np.zeros(model.nv)
        self._spring[self._slide_dofs] = model.jnt_stiffness[self._slides]
        self._spring[self._ball_dofs] = model.jnt_stiffness[self._ball]
        self._carried = np.array(
            [[_is_below(model, int(board), int(model.jnt_bodyid[j])) for j in self._hinges] for board in self._boards],
            dtype=np.float64,
        )

    def step(self, data: mujoco.MjData) -> None:
        """Move on by `SOFT_STEP_S` under `data.qfrc_applied`."""
        model, h = self._model, SOFT_STEP_S
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        poses = self._sensor_poses(data)
        load = self._soft.load(poses, self._object_pose(data))
        inertia = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, inertia)
        force = data.qfrc_applied + data.qfrc_passive - data.qfrc_bias
        damping = self._damping.copy()
        damping[self._hinge_dofs] += JOINT_FRICTION_NM / (np.abs(data.qvel[self._hinge_dofs]) + STICKING_RAD_S)
        system = inertia / h
        if len(load.square):
            jacobian = self._jacobian(data, load, poses)
            force = force - load.force @ jacobian
            system += h * (jacobian * load.rate[:, None]).T @ jacobian
        system[np.diag_indices_from(system)] += damping + h * self._spring
        data.qvel[:] = np.linalg.solve(system, inertia @ data.qvel / h + force)
        mujoco.mj_integratePos(model, data.qpos, data.qvel, h)
        self._stop(data)
        data.time += h
        mujoco.mj_kinematics(model, data)

    def feel(self, data: mujoco.MjData) -> tuple[FloatArray, FloatArray]:
        """Wrench on each board in its bracket's frame f64[s, 6], and force on every taxel f64[n]."""
        poses, pose = self._sensor_poses(data), self._object_pose(data)
        load = self._soft.load(poses, pose)
        back = inverse(poses)
        parts = [rotate(back, load.wrench[:, None, part])[:, 0] for part in (slice(0, 3), slice(3, 6))]
        return np.hstack(parts), self._soft.taxel_forces(poses, pose)

    def _stop(self, data: mujoco.MjData) -> None:
        """A joint stays in its range, and loses its speed at the end of it."""
        address = self._model.jnt_qposadr[self._hinges]
        low, high = self._model.jnt_range[self._hinges].T
        wanted = data.qpos[address]
        data.qpos[address] = np.clip(wanted, low, high)
        data.qvel[self._hinge_dofs[data.qpos[address] != wanted]] = 0.0

    def _sensor_poses(self, data: mujoco.MjData) -> FloatArray:
        poses = np.zeros((len(self._boards), 4, 4))
        poses[:, :3, :3] = data.xmat[self._boards].reshape(-1, 3, 3)
        poses[:, :3, 3], poses[:, 3, 3] = data.xpos[self._boards], 1.0
        return poses @ self._places

    def _object_pose(self, data: mujoco.MjData) -> FloatArray:
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = data.xmat[self._item].reshape(3, 3), data.xpos[self._item]
        return pose

    def _jacobian(self, data: mujoco.MjData, load: SoftLoad, poses: FloatArray) -> FloatArray:
        """How fast each bearing piece sinks in with each degree of freedom, f64[m, dofs]."""
        board = self._soft.sheet.board_index[load.square]
        normal, moment = load.line[:, :3], load.line[:, 3:]
        point = poses[board, :3, 3]  # the moment's point: that of a line about any other follows from the shift
        jacobian = np.zeros((len(board), self._model.nv))
        axes, anchors = data.xaxis[self._hinges], data.xanchor[self._hinges]
        # (moment + (point - anchor) x normal) . axis, without arrays of three indices
        twist = moment @ axes.T + cross(point, normal) @ axes.T - normal @ np.cross(axes, anchors).T
        jacobian[:, self._hinge_dofs] = self._carried[board] * twist
        jacobian[:, self._slide_dofs] = -normal @ data.xaxis[self._slides].T
        about = moment + cross(point - data.xanchor[self._ball], normal)
        jacobian[:, self._ball_dofs] = -about @ data.xmat[self._item].reshape(3, 3)
        return jacobian


def _is_below(model: mujoco.MjModel, body: int, ancestor: int) -> bool:
    while body > 0:
        if body == ancestor:
            return True
        body = int(model.body_parentid[body])
    return False
