"""The time step of hand and object in C (`native/push.h`), called through ctypes: `SoftPush` in less time."""

import ctypes
from typing import Final

import mujoco
import numpy as np

from taxel.grasp.objects import (
    STAND_FRICTION,
    STEADYING_N_PER_M,
    STEADYING_N_S_PER_M,
    STEADYING_NM_PER_RAD,
    STEADYING_NM_S_PER_RAD,
)
from taxel.sim.native_contact import NativeContact
from taxel.sim.scene import JOINT_FRICTION_NM, Scene
from taxel.sim.sim_library import ReferencedArrays, check_structure, load_sim_library
from taxel.sim.soft_push import (
    BOARD_RADIUS_M,
    LIMIT_NM_PER_RAD,
    LIMIT_NM_S_PER_RAD,
    MAX_SUBSTEPS,
    MOTION_PER_STEP_M,
    PRESLIDING_RAD,
    SOFT_STEP_S,
    SoftPush,
)
from taxel.types import FloatArray


class _Stand(ctypes.Structure):
    """C structure `struct sim_stand` of native/stand.h."""

    _fields_ = [
        ("corners", ctypes.c_size_t),
        ("corner", ctypes.c_void_p),
        ("stiffness_n_per_m", ctypes.c_double),
        ("friction", ctypes.c_double),
        ("up", ctypes.c_double * 3),
        ("origin", ctypes.c_double * 3),
        ("anchor", ctypes.c_void_p),
        ("has_anchor", ctypes.c_void_p),
    ]


class _Steadying(ctypes.Structure):
    """C structure `struct sim_steadying` of native/steadying.h."""

    _fields_ = [
        ("firmness", ctypes.c_double),
        ("centre", ctypes.c_double * 3),
        ("stiffness", ctypes.c_double * 2),
        ("damping", ctypes.c_double * 2),
        ("has_rest", ctypes.c_int),
        ("rest", ctypes.c_double * 7),
    ]


_BODY_ARRAYS: Final = {
    "rotation": "xmat",
    "position": "xpos",
    "centre": "subtree_com",
    "motion": "cdof",
    "angle": "qpos",
    "applied": "qfrc_applied",
    "passive": "qfrc_passive",
    "bias": "qfrc_bias",
    "velocity": "qvel",
}
"""Fields of the C structure `struct sim_bodies` with the arrays of MuJoCo's data to which they point."""


class _Bodies(ctypes.Structure):
    """C structure `struct sim_bodies` of native/push.h."""

    _fields_ = [*((name, ctypes.c_void_p) for name in _BODY_ARRAYS), ("inertia", ctypes.c_void_p)]


class _Hinges(ctypes.Structure):
    """C structure `struct sim_hinges` of native/push.h."""

    _fields_ = [
        ("count", ctypes.c_size_t),
        *((name, ctypes.c_void_p) for name in ("dof", "address", "min_angle", "max_angle")),
        *(
            (name, ctypes.c_double)
            for name in ("friction_nm", "presliding_rad", "limit_nm_per_rad", "limit_nm_s_per_rad")
        ),
        ("stuck_angle", ctypes.c_void_p),
    ]


class _Push(ctypes.Structure):
    """C structure `struct sim_push` of native/push.h."""

    _fields_ = [
        ("boards", ctypes.c_size_t),
        ("dofs", ctypes.c_size_t),
        *((name, ctypes.c_void_p) for name in ("board_body", "board_pose", "dof_sign", "dof_root", "damping")),
        *((name, ctypes.c_size_t) for name in ("object_body", "object_dof", "object_address")),
        *((name, ctypes.c_double) for name in ("step_s", "board_radius_m", "motion_per_step_m", "max_substeps")),
        ("hinges", _Hinges),
        ("stand", _Stand),
        ("steadying", _Steadying),
        ("bodies", _Bodies),
        *((name, ctypes.c_void_p) for name in ("last_wrench", "poses", "jacobian", "stiffness", "system", "force")),
    ]


class NativePush(SoftPush):
    """`SoftPush` whose steps are computed in C. Raises `SimLibraryError` if the compiled library is missing."""

    def __init__(self, scene: Scene, contact: NativeContact, step_s: float = SOFT_STEP_S) -> None:
        """Prepare the time integration of a MuJoCo scene. contact: forces of the layer. step_s: time step, seconds."""
        super().__init__(scene, contact, step_s)
        library = load_sim_library()
        check_structure(library, "sim_push", _Push)
        self._call = library.sim_push_step
        self._layer_address = contact.address
        self._arrays = ReferencedArrays()
        self._data: mujoco.MjData | None = None
        self._native = self._describe_push()
        self._address = ctypes.addressof(self._native)

    def _describe_push(self) -> _Push:
        """Return the C structure with the scene's constants and memory for its state, but without MuJoCo's arrays."""
        model, boards = self._model, len(self._boards)
        dofs = model.nv
        return _Push(
            boards=boards,
            dofs=dofs,
            board_body=self._arrays.add(self._boards, np.uintp),
            board_pose=self._arrays.add(self._board_poses),
            dof_sign=self._arrays.add(self._dof_sign),
            dof_root=self._arrays.add(self._roots, np.uintp),
            damping=self._arrays.add(self._damping),
            object_body=self._object_body,
            object_dof=self._object_dofs.start,
            object_address=int(model.jnt_qposadr[model.body_jntadr[self._object_body]]),
            step_s=self.step_s,
            board_radius_m=BOARD_RADIUS_M,
            motion_per_step_m=MOTION_PER_STEP_M,
            max_substeps=MAX_SUBSTEPS,
            hinges=self._describe_hinges(),
            stand=self._describe_stand(),
            steadying=_Steadying(
                centre=tuple(model.body_ipos[self._object_body]),
                stiffness=(STEADYING_N_PER_M, STEADYING_NM_PER_RAD),
                damping=(STEADYING_N_S_PER_M, STEADYING_NM_S_PER_RAD),
            ),
            last_wrench=self._arrays.add(np.zeros((boards, 6))),
            poses=self._arrays.add(np.zeros((boards, 4, 4))),
            jacobian=self._arrays.add(np.zeros((boards, 6, dofs))),
            stiffness=self._arrays.add(np.zeros((boards, 6, 6))),
            system=self._arrays.add(np.zeros((dofs, dofs))),
            force=self._arrays.add(np.zeros(dofs)),
        )

    def _describe_hinges(self) -> _Hinges:
        """Return the C structure of the hinges; `_point_to` sets the angles at which their dry friction vanishes."""
        self._native_stuck_angles = np.zeros(len(self._hinge_dofs))
        return _Hinges(
            count=len(self._hinge_dofs),
            dof=self._arrays.add(self._hinge_dofs, np.uintp),
            address=self._arrays.add(self._hinge_angles, np.uintp),
            min_angle=self._arrays.add(self._min_angles),
            max_angle=self._arrays.add(self._max_angles),
            friction_nm=JOINT_FRICTION_NM,
            presliding_rad=PRESLIDING_RAD,
            limit_nm_per_rad=LIMIT_NM_PER_RAD,
            limit_nm_s_per_rad=LIMIT_NM_S_PER_RAD,
            stuck_angle=self._native_stuck_angles.ctypes.data,
        )

    def _describe_stand(self) -> _Stand:
        """Return the C structure of the stand; no corner of the object touches the stand yet."""
        stand = self._stand
        return _Stand(
            corners=len(stand.corners),
            corner=self._arrays.add(stand.corners),
            stiffness_n_per_m=stand.stiffness_n_per_m,
            friction=STAND_FRICTION,
            up=tuple(stand.up),
            origin=tuple(stand.origin),
            anchor=self._arrays.add(np.zeros_like(stand.corners)),
            has_anchor=self._arrays.add(np.zeros(len(stand.corners)), np.uint8),
        )

    def place_stand(self, pose: FloatArray) -> None:
        """Set the pose f64[4, 4] of the stand in the world, on whose plane z = 0 the object stands."""
        super().place_stand(pose)
        self._native.stand = self._describe_stand()

    def set_firmness(self, firmness: float) -> None:
        """Set how firmly the experimenter holds the object, 0 to 1; see `SoftPush.set_firmness`."""
        super().set_firmness(firmness)
        steadying = self._native.steadying
        if steadying.firmness == 0.0:  # a new hold begins at the pose of the object in the next step
            steadying.has_rest = 0
        steadying.firmness = firmness

    def step(self, data: mujoco.MjData) -> None:
        """Advance the MuJoCo scene by one time step of `step_s`; see `SoftPush.step`.

        Raises ValueError if the equations of motion have no solution, which a scene without mass would cause.
        """
        if data is not self._data:
            self._point_to(data)
        model, inertia = self._model, self._inertia
        remaining = 1.0
        while remaining > 1e-9:  # fraction of the time step; a smaller one is a rounding error of the subtractions
            mujoco.mj_fwdPosition(model, data)
            mujoco.mj_fwdVelocity(model, data)
            mujoco.mj_fullM(model, data, inertia)
            part = self._call(self._address, self._layer_address, remaining)
            if part == 0.0:
                raise ValueError("equations of motion: expected a positive mass of every body, found a singular matrix")
            mujoco.mj_integratePos(model, data.qpos, data.qvel, part * self.step_s)
            data.time += part * self.step_s
            remaining -= part

    def _point_to(self, data: mujoco.MjData) -> None:
        """Set the pointers of the C structure to the arrays of `data`, whose addresses MuJoCo does not change.

        The dry friction of the hinges then begins at the present angles.
        """
        bodies = self._native.bodies
        for name, array in _BODY_ARRAYS.items():
            setattr(bodies, name, getattr(data, array).ctypes.data)
        bodies.inertia = self._inertia.ctypes.data
        self._native_stuck_angles[:] = data.qpos[self._hinge_angles]
        self._data = data
