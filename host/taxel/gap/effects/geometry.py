"""Contacts that are computed again for a displaced object, a displaced bracket, or a softer layer.

Depths follow from rays along the normals of the taxels to the meshes of the objects. Forces follow from the law of the
layer at the net force of each board. Each taxel is divided into 9 pieces (`PIECES_PER_SIDE` squared). The pressure on a
piece is stated in newtons: the force of a taxel whose whole area has the pressure of the piece. The poses of the boards
are estimated from the simulated separations (`contact_poses.py`), for each simulated contact (grasp or indentation).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.gap.data.boards import PIECES_PER_SIDE
from taxel.gap.effects.contact_poses import SurfaceSamples, estimate_poses
from taxel.gap.effects.held_object import MIN_FORCE_SHARE, Push, compute_load_shifts, find_coupled_pushes
from taxel.gap.effects.layer_law import ForceDepthLaw, estimate_taxel_law, fit_piece_law, solve_board_pressures
from taxel.gap.effects.ray_mesh import RayMesh
from taxel.gap.fitting.state import Signal, State
from taxel.hand.transforms import inverse
from taxel.recording.grasp_format import Phase
from taxel.types import FloatArray

LEVELS: Final = np.array([0.2, 0.5, 1.0, 1.25])
"""L levels at which a contact is computed again, as shares of the net force of the board in hold.

Chosen; the changes between two levels are interpolated linearly.
"""

NO_SCALING: Final[Mapping[int, float]] = MappingProxyType({})
"""No contact has a changed stiffness."""

NO_HOLDING: Final[Mapping[int, float]] = MappingProxyType({})
"""No object has a mount that opposes a displacement."""

NO_MOTION: Final = np.eye(4)
"""Motion of a board that is not displaced."""

MIN_NET_FORCE_N: Final = 0.05
"""Smallest net force in hold of a board in contact, newtons (chosen): a smaller force changes no count noticeably."""

MISSED_DEPTH_M: Final = -1.0
"""Depth of a piece whose ray misses the object, metres."""

NO_SEPARATION_M: Final = 0.049
"""Separation from which a taxel has no stated separation: grasp files state 0.05 m if the normal misses the object."""

MAX_CACHE_BYTES: Final = 100_000_000
"""Size of the cache of computed changes in `ContactGeometry`, bytes. Chosen; a full cache is cleared."""


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


@dataclass(frozen=True, eq=False)
class ContactGeometry:
    """Contacts of the simulation, with all data from which displaced contacts are computed.

    contacts: one for every loaded board in each simulated contact. meshes: meshes of the objects by name. law: force
    over depth of whole taxels. piece_law: pressure over depth of pieces. depths: for each contact, depths of the pieces
    without displacement, f64[m, 9] (m taxels of the board, 9 pieces of each), metres. undisplaced_pressures: for each
    contact, pressures on these pieces, f64[m, 9], newtons.
    """

    contacts: tuple[BoardContact, ...]
    meshes: dict[str, RayMesh]
    law: ForceDepthLaw
    piece_law: ForceDepthLaw
    depths: tuple[FloatArray, ...]
    undisplaced_pressures: tuple[FloatArray, ...]
    _cache: dict[tuple[int, bytes], FloatArray] = field(default_factory=dict)
    _undisplaced_forces: dict[int, FloatArray] = field(default_factory=dict)

    @cached_property
    def piece_shares(self) -> dict[tuple[int, int], FloatArray]:
        """Share of the force of each taxel on each of its pieces, f64[m, 9] (m taxels of the board, 9 pieces of each),
        by simulated contact and board.

        The shares of a taxel are equal if the meshes load none of its pieces.
        """
        shares = {}
        for contact, pressure in zip(self.contacts, self.undisplaced_pressures, strict=True):
            total = pressure.sum(axis=1, keepdims=True)
            even = np.full_like(pressure, 1.0 / PIECES_PER_SIDE**2)
            shares[contact.row, contact.board] = np.divide(pressure, total, out=even, where=total > 0.0)
        return shares

    @cached_property
    def coupled_pushes(self) -> list[list[Push]]:
        """For each simulated contact in which several boards carry an object together, the pushes (forces on the
        object) of all boards, see `find_coupled_pushes`.
        """
        pushes_by_row: dict[int, list[Push]] = {}
        for number, contact in enumerate(self.contacts):
            rotation, force = contact.object_from_board[:3, :3], float(contact.force.sum())
            direction = contact.force @ contact.normals
            centre = contact.force @ contact.points.mean(axis=1) / force
            place = rotation @ centre + contact.object_from_board[:3, 3]
            pushes_by_row.setdefault(contact.row, []).append(
                Push(number, force, rotation @ direction / np.linalg.norm(direction), place)
            )
        return find_coupled_pushes(pushes_by_row)

    def compute_displacement_changes(
        self, state: State, motions: Mapping[int, FloatArray], holding_stiffness: Mapping[int, float] = NO_HOLDING
    ) -> dict[int, FloatArray]:
        """Return the changes of the taxel forces of displaced contacts, f64[2, L, m] (m taxels of the board) by index
        of the contact.

        The two rows are the kept share and the gained force at L levels of the net force, see `apply_change`. motions:
        f64[4, 4], displacement of the board in the object frame, by index of the contact. holding_stiffness: stiffness
        of the object's mount, newtons per metre, by index of the contact.

        Each board is shifted towards the object until it carries its net force, which is kept or changes as
        `held_object.py` describes. Results are cached, because a fit changes one block or one effect at a time.
        """
        extra_forces: dict[int, float] = {}
        for pushes in self.coupled_pushes:
            stiffness = [holding_stiffness.get(push.number, 0.0) for push in pushes]
            if any(stiffness):
                extra_forces |= compute_load_shifts(
                    pushes, [motions.get(push.number, NO_MOTION) for push in pushes], stiffness
                )

        def compute_depths(numbers: Sequence[int]) -> list[FloatArray]:
            """Return the depths f64[m, 9] (m taxels of the board, 9 pieces of each), metres, of the pieces of displaced
            contacts, by index of the contact.
            """
            contacts = [self.contacts[number] for number in numbers]
            poses = [motions[number] @ self.contacts[number].object_from_board for number in numbers]
            return compute_piece_depths(state, self.meshes, contacts, poses)

        keys = {
            number: motion.tobytes() + np.float64(extra_forces.get(number, 0.0)).tobytes()
            for number, motion in motions.items()
        }
        return self._find_changes(keys, compute_depths, extra_forces=extra_forces)

    def compute_stiffness_changes(self, scales: Mapping[int, float]) -> dict[int, FloatArray]:
        """Return the changes of the taxel forces of contacts with another stiffness, f64[2, L, m] (m taxels of the
        board) by index of the contact.

        The two rows are the kept share and the gained force at L levels of the net force, see `apply_change`. scales:
        factor on the pressure at the same depth, by index of the contact. The net force of each board is kept: the
        object sinks deeper into a softer layer and loads more pieces.
        """
        keys = {number: np.float64(scale).tobytes() for number, scale in scales.items()}
        return self._find_changes(keys, lambda numbers: [self.depths[number] for number in numbers], scales)

    def _find_changes(
        self,
        keys: Mapping[int, bytes],
        compute_depths: Callable[[Sequence[int]], list[FloatArray]],
        scales: Mapping[int, float] = NO_SCALING,
        extra_forces: Mapping[int, float] = NO_HOLDING,
    ) -> dict[int, FloatArray]:
        """Return the changes of contacts, f64[2, L, m] (L levels, m taxels of the board) by index of the contact, from
        the cache or newly computed.

        New changes are added to the cache. keys: keys of the cache by index of the contact. compute_depths: returns the
        depths of the pieces, f64[m, 9] each, for a sequence of contact indices. scales: factors on the stiffness.
        extra_forces: increases of the net forces, newtons.
        """
        result = {number: self._cache[number, key] for number, key in keys.items() if (number, key) in self._cache}
        new = [number for number in keys if number not in result]
        if new:
            self._add_undisplaced_forces(new)
            forces = self._solve_forces(new, compute_depths(new), scales, extra_forces)
            for number, force in zip(new, forces, strict=True):
                change = _compute_change(self._undisplaced_forces[number], force)
                result[number] = self._add_to_cache((number, keys[number]), change)
        return result

    def _add_undisplaced_forces(self, numbers: Sequence[int]) -> None:
        """Compute and store the forces without displacement of contacts for which they are not yet stored.

        numbers: indices of the contacts.
        """
        new = [number for number in numbers if number not in self._undisplaced_forces]
        if new:
            forces = self._solve_forces(new, [self.depths[number] for number in new])
            self._undisplaced_forces.update(zip(new, forces, strict=True))

    def _solve_forces(
        self,
        numbers: Sequence[int],
        depths: Sequence[FloatArray],
        scales: Mapping[int, float] = NO_SCALING,
        extra_forces: Mapping[int, float] = NO_HOLDING,
    ) -> list[FloatArray]:
        """Return the forces of the taxels of contacts at all levels, f64[L, m] (L levels, m taxels of the board) each,
        newtons.

        numbers: indices of the contacts. depths: depths of the pieces of these contacts, f64[m, 9] each, metres.
        scales: factors on the stiffness, by index of the contact (1 if absent). extra_forces: increases of the net
        forces, newtons, by index of the contact (0 if absent).
        """
        scale = np.array([scales.get(number, 1.0) for number in numbers])
        hold_force = np.array([self.contacts[number].force.sum() for number in numbers])
        extra = np.array([extra_forces.get(number, 0.0) for number in numbers])
        # A displaced object is held aside from the first touch on, at which a board carries hardly any force: the full
        # extra force applies at every level, and a lower limit keeps the net force positive.
        net = np.maximum(LEVELS * hold_force[:, None] + extra[:, None], MIN_FORCE_SHARE * LEVELS * hold_force[:, None])
        pressures = solve_board_pressures(self.piece_law, depths, net / scale[:, None])
        return [factor * pressure.mean(axis=2) for factor, pressure in zip(scale, pressures, strict=True)]

    def _add_to_cache(self, key: tuple[int, bytes], change: FloatArray) -> FloatArray:
        """Store a change in the cache, which is cleared before if it is full, and return the change."""
        if (len(self._cache) + 1) * change.nbytes > MAX_CACHE_BYTES:  # boards have similar numbers of taxels
            self._cache.clear()
        self._cache[key] = change
        return change


def _compute_change(before: FloatArray, after: FloatArray) -> FloatArray:
    """Return the kept share (row 0) and the gained force in newtons (row 1) of each taxel, f64[2, L, m] (m taxels of
    the board).

    before, after: forces before and after the change, f64[L, m] each, newtons, at L levels of the net force. A force
    that decreases is described by the kept share alone, a force that increases by the gained force alone.
    """
    kept = np.divide(after, before, out=np.ones_like(before), where=before > after)
    return np.stack([kept, np.maximum(after - before, 0.0)])


def make_neutral_change(state: State) -> FloatArray:
    """Return a change f64[Q, 2, L, n] (Q simulated contacts, L levels, n taxels) for `apply_change` that changes no
    force: kept share 1, gained force 0.
    """
    change = np.zeros((len(state.condition), 2, len(LEVELS), state.pair.n))
    change[:, 0] = 1.0
    return change


def assemble_change(state: State, contact_changes: Mapping[int, FloatArray]) -> FloatArray:
    """Return the change f64[Q, 2, L, n] (Q simulated contacts, L levels, n taxels) for `apply_change` from the changes
    of single boards.

    contact_changes: f64[2, L, m] (m taxels of the board) by index of the contact; the other contacts do not change.
    """
    change = make_neutral_change(state)
    for number, contact_change in contact_changes.items():
        contact = compute_geometry(state).contacts[number]
        change[contact.row][..., contact.taxels] = contact_change
    return change


def apply_change(state: State, signal: Signal, change: FloatArray) -> Signal:
    """Return a signal with changed forces.

    change: f64[Q, 2, L, n] (Q simulated contacts, L levels, n taxels), the share of the force that each taxel keeps and
    the force that it gains, newtons, at the net forces `LEVELS` of its board. Between two levels the change is
    interpolated linearly.

    A decrease is a share and not a difference, because the simulated force deviates from the force by geometry: a taxel
    without contact then has no force.
    """
    assert signal.force is not None
    kept_weights, gained_weights = _compute_level_weights(state, signal)
    force = signal.force.copy()
    for board, layout in enumerate(state.pair.boards):
        kept, gained = change[:, 0][..., layout.columns], change[:, 1][..., layout.columns]
        is_changed = ((kept != 1.0) | (gained != 0.0)).any(axis=(1, 2))
        board_force = signal.force[..., layout.columns][is_changed]
        board_force *= kept_weights[is_changed, :, board] @ kept[is_changed]
        board_force += gained_weights[is_changed, :, board] @ gained[is_changed]
        force[np.ix_(is_changed, np.arange(force.shape[1]), layout.taxels)] = board_force
    return signal.with_force(force)


@lru_cache(maxsize=4)
def _compute_level_weights(state: State, signal: Signal) -> tuple[FloatArray, FloatArray]:
    """Return the interpolation weights of the L `LEVELS` for each board and node, two arrays f64[Q, K, s, L] (Q
    simulated contacts, K time nodes).

    The first array applies to kept shares, the second to gained forces. The weights follow from the net force of each
    of the s boards, relative to its mean in hold. Cached, because a fit applies many changes to one signal.
    """
    assert signal.force is not None
    hold, board = state.time_grid.phase == Phase.HOLD, state.pair.groups.sum_matrices[2]
    net = (board @ signal.force.reshape(-1, state.pair.n).T).T.reshape(*signal.force.shape[:2], -1)
    level = net / np.maximum(net[:, hold].mean(axis=1, keepdims=True), 1e-9)
    right = np.clip(np.searchsorted(LEVELS, level), 1, len(LEVELS) - 1)
    share = np.clip((level - LEVELS[right - 1]) / (LEVELS[right] - LEVELS[right - 1]), 0.0, 1.0)[..., None]
    number = np.arange(len(LEVELS))
    kept_weights = np.where(right[..., None] == number, share, 0.0) + np.where(
        right[..., None] == number + 1, 1.0 - share, 0.0
    )
    # Below the lowest level the gained force is proportional to the net force: a board without force gains no force.
    return kept_weights, kept_weights * np.minimum(level / LEVELS[0], 1.0)[..., None]


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


@lru_cache(maxsize=8)
def compute_geometry(state: State) -> ContactGeometry:
    """Return the contacts of a simulation with contact forces, and the force-depth laws of its layer. Cached.

    A contact is a board that carries at least `MIN_NET_FORCE_N` in hold. The state must contain forces and separations.
    """
    assert state.base.force is not None
    assert state.base.separation is not None
    law = estimate_taxel_law(state)
    meshes = {name: RayMesh(state.pair.objects[name]) for name in state.pair.object_names}
    hold = state.time_grid.phase == Phase.HOLD
    contacts = _list_contacts(state, state.base.force[:, hold].mean(axis=1))
    contacts = _locate_contacts(state, meshes, contacts, state.base.separation[:, hold].mean(axis=1))
    depths = compute_piece_depths(state, meshes, contacts, [contact.object_from_board for contact in contacts])
    forces = [contact.force for contact in contacts]
    piece_law = fit_piece_law(law, list(zip(depths, forces, strict=True)))
    net_forces = np.array([[force.sum()] for force in forces])
    pressures = tuple(pressure[0] for pressure in solve_board_pressures(piece_law, depths, net_forces))
    return ContactGeometry(tuple(contacts), meshes, law, piece_law, tuple(depths), pressures)


def _list_contacts(state: State, force: FloatArray) -> list[BoardContact]:
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


def _locate_contacts(
    state: State, meshes: Mapping[str, RayMesh], contacts: Sequence[BoardContact], separation: FloatArray
) -> list[BoardContact]:
    """Return the contacts with poses that are estimated from the stated separations.

    separation: f64[Q, n] (Q simulated contacts, n taxels), mean separation in hold, metres.
    """
    stated = [separation[contact.row, contact.taxels] for contact in contacts]
    is_stated = [values < NO_SEPARATION_M for values in stated]
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
