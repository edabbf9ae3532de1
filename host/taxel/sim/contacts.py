"""MuJoCo's contact points between hand and object, and the wrench that they make on each board."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
import numpy.typing as npt

from taxel.sim.scene import Scene
from taxel.types import FloatArray


@dataclass(frozen=True, eq=False)
class StepContacts:
    """Contact points of one moment, c of them; fields as in `ContactPoints`."""

    board: npt.NDArray[np.int64]
    position: FloatArray
    normal: FloatArray
    depth: FloatArray
    force: FloatArray


NO_CONTACTS = StepContacts(np.empty(0, np.int64), np.empty((0, 3)), np.empty((0, 3)), np.empty(0), np.empty((0, 3)))


@dataclass(frozen=True, eq=False)
class ContactPoints:
    """Contact points of all samples, one after the other, c in all.

    Attributes:
        sample: i64[c], index of the sample.
        board: i64[c], index in `hand.boards`; -1: a part of the hand without a board.
        position: f64[c, 3], metres, world.
        normal: f64[c, 3], unit vector out of the object, into the hand, world.
        depth: f64[c], metres, by which the rigid shapes overlap.
        force: f64[c, 3], newtons, on the hand, world.
    """

    sample: npt.NDArray[np.int64]
    board: npt.NDArray[np.int64]
    position: FloatArray
    normal: FloatArray
    depth: FloatArray
    force: FloatArray

    @classmethod
    def of(cls, steps: Sequence[StepContacts]) -> ContactPoints:
        """Join the contact points of successive samples."""
        return cls(
            np.repeat(np.arange(len(steps)), [len(step.board) for step in steps]),
            np.concatenate([step.board for step in steps]),
            np.concatenate([step.position for step in steps]),
            np.concatenate([step.normal for step in steps]),
            np.concatenate([step.depth for step in steps]),
            np.concatenate([step.force for step in steps]),
        )


def read_contacts(scene: Scene, data: mujoco.MjData) -> StepContacts:
    """The contact points between hand and object that the last step or forward computation found."""
    contact = data.contact
    geoms = np.asarray(contact.geom, dtype=np.int64).reshape(-1, 2)
    item = scene.model.geom("object").id
    used = np.flatnonzero((geoms == item).any(axis=1) & (contact.efc_address >= 0))
    first = geoms[used, 0] == item  # MuJoCo's normal points from the first geom to the second
    sign = np.where(first, 1.0, -1.0)[:, None]
    frame = contact.frame[used].reshape(-1, 3, 3)
    return StepContacts(
        scene.board_of_geom[np.where(first, geoms[used, 1], geoms[used, 0])],
        contact.pos[used].copy(),
        sign * frame[:, 0],
        -contact.dist[used],
        sign * _forces(scene.model, data, used, frame),
    )


def _forces(model: mujoco.MjModel, data: mujoco.MjData, used: npt.NDArray[np.intp], frame: FloatArray) -> FloatArray:
    """World forces on the second geoms, f64[c, 3]."""
    own, wrench = np.zeros((len(used), 3)), np.zeros(6)
    for row, index in enumerate(used):
        mujoco.mj_contactForce(model, data, int(index), wrench)
        own[row] = wrench[:3]
    return np.asarray(np.einsum("ci,cij->cj", own, frame))


def board_wrenches(contacts: StepContacts, sensor_poses: FloatArray) -> FloatArray:
    """Force and moment about each bracket's origin, in its frame, f64[s, 6], from `sensor_poses` f64[s, 4, 4]."""
    wrench = np.zeros((len(sensor_poses), 6))
    on = contacts.board >= 0
    board, force = contacts.board[on], contacts.force[on]
    rotation, origin = sensor_poses[board, :3, :3], sensor_poses[board, :3, 3]
    moment = np.cross(contacts.position[on] - origin, force)
    for part, vectors in ((slice(0, 3), force), (slice(3, 6), moment)):
        np.add.at(wrench[:, part], board, np.einsum("cij,ci->cj", rotation, vectors))
    return wrench
