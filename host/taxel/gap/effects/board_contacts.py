"""Contacts of single boards in a simulation: where each loaded board touches the object.

The poses of the boards are estimated from the simulated separations (`contact_poses.py`), for each simulated contact
(grasp or indentation).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.gap.effects.contact_poses import SurfaceSamples, estimate_poses
from taxel.gap.effects.ray_mesh import RayMesh
from taxel.gap.fitting.state import State
from taxel.hand.transforms import inverse
from taxel.types import FloatArray

MIN_NET_FORCE_N: Final = 0.05
"""Smallest net force in hold of a board in contact, newtons (chosen): a smaller force changes no count noticeably."""

MISSED_DEPTH_M: Final = -1.0
"""Depth of a piece whose ray misses the object, metres."""

NO_SEPARATION_M: Final = 0.049
"""Separation from which a taxel has no stated separation: grasp files state 0.05 m if the normal misses the object."""


@dataclass(frozen=True, eq=False)
class BoardContact:
    """Contact of one board in one simulated contact during hold.

    row: index of the simulated contact, a row of `State.condition`. condition: index of its condition. board: index of
    the board. taxels: [m] (m taxels of the board), indices of the taxels of the board. force: f64[m], newtons. points:
    f64[m, 9, 3], centres of the pieces, metres, bracket frame. normals: f64[m, 3], bracket frame. object_from_board:
    f64[4, 4], pose of the board in the object frame.
    """

    row: int
    condition: int
    board: int
    taxels: NDArray[np.intp]
    force: FloatArray
    points: FloatArray
    normals: FloatArray
    object_from_board: FloatArray

    @cached_property
    def board_from_object(self) -> FloatArray:
        """Pose of the object in the bracket frame, f64[4, 4]."""
        return np.asarray(np.linalg.inv(self.object_from_board))


def list_contacts(state: State, force: FloatArray) -> list[BoardContact]:
    """Return the contacts of loaded boards with the nominal poses of their conditions.

    force: f64[Q, n] (Q simulated contacts, n taxels), mean force in hold, newtons.
    """
    pair = state.pair
    contacts = []
    for row, condition in enumerate(state.condition.tolist()):
        for board, layout in enumerate(pair.boards):
            taxels = layout.taxels
            if force[row, taxels].sum() < MIN_NET_FORCE_N:
                continue
            pose = inverse(pair.object_poses[condition]) @ pair.sensor_poses[condition, board]
            normals = pair.taxels.normal[taxels]
            contacts.append(
                BoardContact(row, condition, board, taxels, force[row, taxels], layout.piece_centres, normals, pose)
            )
    return contacts


def locate_contacts(
    state: State, meshes: Mapping[str, RayMesh], contacts: Sequence[BoardContact], separation: FloatArray
) -> list[BoardContact]:
    """Return the contacts with poses that are estimated from the stated separations (distances between taxel and object
    that the simulator states).

    separation: f64[Q, n] (Q simulated contacts, n taxels), mean separation in hold, metres.
    """
    stated = [separation[contact.row, contact.taxels] for contact in contacts]
    is_stated = [values < NO_SEPARATION_M for values in stated]
    # A probe is a contact with one point, the centre, for each taxel with a stated separation.
    probes = [
        replace(contact, points=contact.points[stated_rows].mean(axis=1, keepdims=True), normals=normals)
        for contact, stated_rows in zip(contacts, is_stated, strict=True)
        for normals in [contact.normals[stated_rows]]
    ]
    samples = SurfaceSamples(
        np.repeat(np.arange(len(contacts)), [np.count_nonzero(rows) for rows in is_stated]),
        -np.concatenate([values[rows] for values, rows in zip(stated, is_stated, strict=True)] or [np.empty(0)]),
        np.array([contact.points.mean(axis=(0, 1)) for contact in contacts]).reshape(-1, 3),
    )

    def compute_depths(poses: FloatArray) -> FloatArray:
        """Return the depths of all centres of taxels with a stated separation, metres; NaN for a ray that misses."""
        depth = np.concatenate([one[:, 0] for one in compute_piece_depths(state, meshes, probes, list(poses))])
        return np.where(depth == MISSED_DEPTH_M, np.nan, depth)

    grasp = np.unique([contact.row for contact in contacts], return_inverse=True)[1]
    nominal = np.array([contact.object_from_board for contact in contacts]).reshape(-1, 4, 4)
    poses = estimate_poses(nominal, grasp, samples, compute_depths)
    return [replace(contact, object_from_board=pose) for contact, pose in zip(contacts, poses, strict=True)]


def compute_piece_depths(
    state: State, meshes: Mapping[str, RayMesh], contacts: Sequence[BoardContact], poses: Sequence[FloatArray]
) -> list[FloatArray]:
    """Return the depths of the pieces of contacts in their objects, f64[m, 9] (m taxels of the board, 9 pieces of each)
    each, metres.

    meshes: meshes of the objects by name. poses: f64[4, 4] each, pose of the board in the object frame for each
    contact. A depth is negative outside the object, and `MISSED_DEPTH_M` if the ray along the taxel's
    normal misses the object.
    """
    points = [contact.points @ pose[:3, :3].T + pose[:3, 3] for contact, pose in zip(contacts, poses, strict=True)]
    rays = [contact.normals @ pose[:3, :3].T for contact, pose in zip(contacts, poses, strict=True)]
    names = [state.pair.conditions[contact.condition][0] for contact in contacts]
    result: dict[int, FloatArray] = {}
    for name in dict.fromkeys(names):
        numbers = [number for number, other in enumerate(names) if other == name]
        separation = meshes[name].compute_separation(
            *(np.concatenate([vectors[number] for number in numbers]) for vectors in (points, rays))
        )
        depth = np.where(np.isfinite(separation), -separation, MISSED_DEPTH_M)
        ends = np.cumsum([len(rays[number]) for number in numbers])[:-1]
        result.update(zip(numbers, np.split(depth, ends), strict=True))
    return [result[number] for number in range(len(contacts))]
