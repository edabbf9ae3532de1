"""Joint dynamics of the emulated hand during a grasp: motor torques, contact of the emulated skin, free object.

The equations of motion and their integration are in firmware/emulator/dynamics/hand_dynamics.c.
"""

import ctypes
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.campaign.free_object import FreeObject
from taxel.emulated.contact import SkinContact
from taxel.emulated.dynamics import (
    JOINT_VALUES,
    HandStruct,
    load_dynamics_library,
    load_size_limits,
    view_frame,
)
from taxel.grasp.objects import SKIN_FRICTION
from taxel.hand import Hand
from taxel.hand.robot import Robot
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
"""Lever arm that converts a bracket's rotation into a motion of its board when the time step is chosen (chosen)."""


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
        """Create the dynamics of a hand at rest.

        robot: the part of the robot below its wrist. contact: the contact solver of the emulated skin; its contacts are
        cleared. object_index: number of the object in the world file. item: the object on its stand. wrist_pose:
        f64[4, 4], world. angles: initial joint angles f64[j], radians. Raises ValueError for a hand that is too large
        for the C library.
        """
        self._library, self._contact, self._item = load_dynamics_library(), contact, item
        self._tree = _TreeArrays(robot, hand, contact)
        # Columns: lower limit, upper limit, angle, speed, angle at which the spring of the dry friction is unloaded.
        self._joints = np.zeros((len(robot.joint_names), JOINT_VALUES))
        self._joints[:, 0], self._joints[:, 1] = robot.lower, robot.upper
        self._joints[:, 2] = self._joints[:, 4] = angles  # the springs of the dry friction are unloaded
        self._struct = HandStruct(
            joint_inertia_kg_m2=JOINT_INERTIA_KG_M2,
            joint_damping_nm_s=JOINT_DAMPING_NM_S,
            joint_friction_nm=JOINT_FRICTION_NM,
            joint_breakaway_rad=JOINT_BREAKAWAY_RAD,
            joint_stop_nm_per_rad=JOINT_STOP_NM_PER_RAD,
            joint_stop_nm_s_per_rad=JOINT_STOP_NM_S_PER_RAD,
            longest_s=SUBSTEP_S,
            shortest_s=MIN_SUBSTEP_S,
            motion_m=STEP_MOTION_M,
            board_radius_m=BOARD_RADIUS_M,
            object_index=object_index,
            object=ctypes.pointer(item.struct),
            joints=self._joints.ctypes.data,
        )
        self._tree.fill(self._struct)
        view_frame(self._struct.wrist)[:] = view_frame(self._struct.wrist_before)[:] = wrist_pose[:3]
        contact.set_friction(SKIN_FRICTION)

    @property
    def touched_count(self) -> int:
        """Number of boards in contact in the last time step."""
        return int(self._struct.touched_count)

    @property
    def angles(self) -> FloatArray:
        """Joint angles, radians, f64[j]."""
        return self._joints[:, 2].copy()

    @property
    def velocities(self) -> FloatArray:
        """Joint speeds, radians per second, f64[j]."""
        return self._joints[:, 3].copy()

    def object_pose(self) -> FloatArray:
        """Return the pose f64[4, 4] of the object in the world."""
        return self._item.pose

    def bracket_poses(self) -> FloatArray:
        """Return the nominal poses f64[s, 4, 4] of the brackets of the boards, without their mounting offsets."""
        rows = np.empty((self._tree.board_count, 3, 4))
        self._library.taxel_dynamics_brackets(ctypes.byref(self._struct), rows.ctypes.data)
        poses = np.zeros((self._tree.board_count, 4, 4))
        poses[:, :3], poses[:, 3, 3] = rows, 1.0
        return poses

    def hold_wrist(self, pose: FloatArray) -> None:
        """Set the pose of the wrist, f64[4, 4], world. The wrist moves to it at constant speed during the next step."""
        self._struct.wrist_before = self._struct.wrist
        view_frame(self._struct.wrist)[:] = pose[:3]

    def steady_object(self, firmness: float) -> None:
        """Set how firmly the experimenter's hand steadies the object, 0 (not at all) to 1."""
        self._item.steady(firmness)

    def step(self, torque_nm: FloatArray, dt_s: float) -> FloatArray:
        """Integrate the motion of hand and object over `dt_s` seconds; return the joint angles f64[j], radians.

        torque_nm: motor torques f64[j]. The wrist moves from its previous to its present pose at constant speed. Raises
        ValueError if the torques have another shape, or if the contact solver is closed.
        """
        torque = np.ascontiguousarray(torque_nm, dtype=np.float64)
        if torque.shape != (len(self._joints),):
            raise ValueError(f"expected torques of {len(self._joints)} joints, found shape {torque.shape}")
        self._struct.contact = self._contact.get_handle(self._struct.object_index)
        self._library.taxel_dynamics_step(ctypes.byref(self._struct), torque.ctypes.data, dt_s)
        return self.angles


class _TreeArrays:
    """Links, joints and boards of a hand in the memory layout of the C library."""

    def __init__(self, robot: Robot, hand: Hand, contact: SkinContact) -> None:
        """Collect parents, joints and poses of the links, and the boards with their brackets, in arrays for C.

        Raises ValueError for a hand that is too large for the C library, or whose boards differ in number from those of
        the contact solver.
        """
        self.board_count = contact.board_count
        self.link_count, self.joint_count = len(robot.link_names), len(robot.joint_names)
        counts = self.link_count, self.joint_count, self.board_count
        if any(count > limit for count, limit in zip(counts, load_size_limits(), strict=True)):
            raise ValueError(
                f"hand {hand.name}: expected at most {load_size_limits()} links, joints and boards, found {counts}"
            )
        is_revolute = [joint.axis is not None for joint in robot.joints]
        numbers = np.where(is_revolute, np.cumsum(is_revolute) - 1, -1)
        # The first link is the root, which has no joint; -1: no revolute joint moves the link relative to its parent.
        self._parent = _to_indices([0, *(robot.get_link_index(joint.parent) for joint in robot.joints)])
        self._joint = _to_indices([-1, *numbers.tolist()])
        self._origin = _to_frames(np.stack([np.eye(4), *(joint.origin for joint in robot.joints)]))
        self._axis = np.stack([joint.axis for joint in robot.joints if joint.axis is not None])
        links = [board.link_name for board in hand.boards if board.link_name is not None]
        poses = [board.pose for board in hand.boards if board.pose is not None]
        if len(links) != self.board_count or len(poses) != self.board_count:
            raise ValueError(f"hand {hand.name}: expected {self.board_count} boards with a link and a pose")
        self._board_link = _to_indices([robot.get_link_index(link) for link in links])
        self._bracket = _to_frames(np.stack(poses))
        self._mounting = _to_frames(np.stack([contact.get_bracket_offset(i) for i in range(self.board_count)]))

    def fill(self, struct: HandStruct) -> None:
        """Write the numbers of links, joints and boards, and the addresses of the arrays, into a structure."""
        tree = struct.tree
        tree.link_count, tree.joint_count, tree.board_count = self.link_count, self.joint_count, self.board_count
        tree.parent, tree.joint = self._parent.ctypes.data, self._joint.ctypes.data
        tree.origin, tree.axis = self._origin.ctypes.data, self._axis.ctypes.data
        tree.board_link, tree.bracket = self._board_link.ctypes.data, self._bracket.ctypes.data
        tree.mounting = self._mounting.ctypes.data


def _to_indices(values: list[int]) -> NDArray[np.int32]:
    """Return indices as i32[n]."""
    return np.array(values, dtype=np.int32)


def _to_frames(poses: FloatArray) -> FloatArray:
    """Return the first three rows f64[n, 3, 4] of transforms f64[n, 4, 4], contiguous in memory."""
    return np.ascontiguousarray(poses[:, :3], dtype=np.float64)
