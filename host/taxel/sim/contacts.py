"""MuJoCo's contact points between hand and object, and the wrench of these points on each board."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
import numpy.typing as npt

from taxel.sim.scene import Scene
from taxel.types import FloatArray, IndexArray


@dataclass(frozen=True, eq=False)
class StepContacts:
    """The c contact points of one time step; fields as in `ContactPoints`."""

    board: npt.NDArray[np.int64]
    position: FloatArray
    normal: FloatArray
    depth: FloatArray
    force: FloatArray


NO_CONTACTS = StepContacts(np.empty(0, np.int64), np.empty((0, 3)), np.empty((0, 3)), np.empty(0), np.empty((0, 3)))


@dataclass(frozen=True, eq=False)
class ContactPoints:
    """Contact points of all samples, in the order of the samples: c points in total.

    Attributes:
        sample: i64[c], index of the sample.
        board: i64[c], index in `hand.boards`; -1: contact with a part of the hand that is not a board.
        position: f64[c, 3], metres, world.
        normal: f64[c, 3], unit vector from the object into the hand, world.
        depth: f64[c], metres, overlap of the rigid shapes.
        force: f64[c, 3], newtons, on the hand, world.
    """

    sample: npt.NDArray[np.int64]
    board: npt.NDArray[np.int64]
    position: FloatArray
    normal: FloatArray
    depth: FloatArray
    force: FloatArray

    @classmethod
    def concatenate(cls, steps: Sequence[StepContacts]) -> ContactPoints:
        """Join the contact points of successive samples; the position of a sample in `steps` becomes its index."""
        return cls(
            np.repeat(np.arange(len(steps)), [len(step.board) for step in steps]),
            np.concatenate([step.board for step in steps]),
            np.concatenate([step.position for step in steps]),
            np.concatenate([step.normal for step in steps]),
            np.concatenate([step.depth for step in steps]),
            np.concatenate([step.force for step in steps]),
        )


def read_contacts(scene: Scene, data: mujoco.MjData) -> StepContacts:
    """Read the active contact points between hand and object after MuJoCo's last step or forward computation."""
    contact = data.contact
    geoms = np.asarray(contact.geom, dtype=np.int64).reshape(-1, 2)
    object_geom = scene.model.geom("object").id
    on_hand = (geoms == object_geom).any(axis=1) & (geoms != scene.model.geom("stand").id).all(axis=1)
    active = np.flatnonzero(on_hand & (contact.efc_address >= 0))
    object_is_first = geoms[active, 0] == object_geom  # MuJoCo's normal points from the first geom to the second
    sign = np.where(object_is_first, 1.0, -1.0)[:, None]
    frame = contact.frame[active].reshape(-1, 3, 3)
    return StepContacts(
        scene.board_of_geom[np.where(object_is_first, geoms[active, 1], geoms[active, 0])],
        contact.pos[active].copy(),
        sign * frame[:, 0],
        -contact.dist[active],
        sign * _compute_forces(scene.model, data, active, frame),
    )


def _compute_forces(model: mujoco.MjModel, data: mujoco.MjData, active: IndexArray, frame: FloatArray) -> FloatArray:
    """Compute the forces on the second geom of the contacts `active` [c], f64[c, 3], newtons, world.

    frame: f64[c, 3, 3], contact frames, axes in rows.
    """
    in_contact_frame, wrench = np.zeros((len(active), 3)), np.zeros(6)
    for row, index in enumerate(active):
        mujoco.mj_contactForce(model, data, int(index), wrench)
        in_contact_frame[row] = wrench[:3]
    return np.asarray(np.einsum("ci,cij->cj", in_contact_frame, frame))


def compute_board_wrenches(contacts: StepContacts, sensor_poses: FloatArray) -> FloatArray:
    """Compute force and moment (N, Nm) on each board about its bracket's origin, f64[s, 6], in the bracket's frame.

    sensor_poses: f64[s, 4, 4], brackets in the world. Contacts of other parts of the hand (board -1) are ignored.
    """
    wrench = np.zeros((len(sensor_poses), 6))
    on_board = contacts.board >= 0
    board, force = contacts.board[on_board], contacts.force[on_board]
    rotation, origin = sensor_poses[board, :3, :3], sensor_poses[board, :3, 3]
    moment = np.cross(contacts.position[on_board] - origin, force)
    for columns, vectors in ((slice(0, 3), force), (slice(3, 6), moment)):
        np.add.at(wrench[:, columns], board, np.einsum("cij,ci->cj", rotation, vectors))
    return wrench
