"""Contacts that are computed again for a displaced object, a displaced bracket, or a softer layer.

Depths follow from rays along the normals of the taxels to the meshes of the objects. Forces follow from the law of the
layer at the net force of each board. Each taxel is divided into 9 pieces (`PIECES_PER_SIDE` squared). The pressure on a
piece is stated in newtons: the force of a taxel whose whole area has the pressure of the piece.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from types import MappingProxyType
from typing import Final

import numpy as np

from taxel.gap.data.boards import PIECES_PER_SIDE
from taxel.gap.effects.board_contacts import BoardContact, compute_piece_depths, list_contacts, locate_contacts
from taxel.gap.effects.force_changes import LEVELS
from taxel.gap.effects.held_object import MIN_FORCE_SHARE, Push, compute_load_shifts, find_coupled_pushes
from taxel.gap.effects.layer_law import ForceDepthLaw, estimate_taxel_law, fit_piece_law, solve_board_pressures
from taxel.gap.effects.ray_mesh import RayMesh
from taxel.gap.fitting.state import State
from taxel.recording.grasp_format import Phase
from taxel.types import FloatArray

NO_SCALING: Final[Mapping[int, float]] = MappingProxyType({})
"""No contact has a changed stiffness."""

NO_HOLDING: Final[Mapping[int, float]] = MappingProxyType({})
"""No object has a mount that opposes a displacement."""

NO_MOTION: Final = np.eye(4)
"""Motion of a board that is not displaced."""

MAX_CACHE_BYTES: Final = 100_000_000
"""Size of the cache of computed changes in `ContactGeometry`, bytes. Chosen; a full cache is cleared."""


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

        The shares of a taxel are equal if no force acts on its pieces in the contact that the meshes predict.
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
        # The mount deflects a displaced object from the first touch on. The full extra force therefore applies at every
        # level, and a lower limit keeps the net force positive.
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
    contacts = list_contacts(state, state.base.force[:, hold].mean(axis=1))
    contacts = locate_contacts(state, meshes, contacts, state.base.separation[:, hold].mean(axis=1))
    depths = compute_piece_depths(state, meshes, contacts, [contact.object_from_board for contact in contacts])
    forces = [contact.force for contact in contacts]
    piece_law = fit_piece_law(law, list(zip(depths, forces, strict=True)))
    net_forces = np.array([[force.sum()] for force in forces])
    pressures = tuple(pressure[0] for pressure in solve_board_pressures(piece_law, depths, net_forces))
    return ContactGeometry(tuple(contacts), meshes, law, piece_law, tuple(depths), pressures)
