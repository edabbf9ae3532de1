"""Presses that are worked out anew: where an object or a bracket is displaced, or the layer is softer. Depths come from
rays along the taxels' normals onto the objects' meshes, forces from the layer's law at the net force of each board.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.gap.boards import PIECES
from taxel.gap.effects.layer_law import Law, law_of, law_of_pieces, pressed_to, pressed_to_each
from taxel.gap.effects.ray_mesh import Mesh
from taxel.gap.state import Signal, State
from taxel.recording.grasp_format import Phase

Array = NDArray[np.float64]

LEVELS: Final = np.array([0.2, 0.5, 1.0, 1.25])
"""Shares of a board's net force in hold at which a press is worked out anew."""

REMEMBERED: Final = 100_000_000
"""Bytes of forces of displacements that are kept."""


@dataclass(frozen=True, eq=False)
class Contact:
    """One board in one cell during hold. taxels: [m]. force: f64[m], newtons. points, normals: f64[m, 9, 3], of their
    pieces, bracket frame. object_from_board: f64[4, 4].
    """

    cell: int
    board: int
    taxels: NDArray[np.intp]
    force: Array
    points: Array
    normals: Array
    object_from_board: Array

    @cached_property
    def board_from_object(self) -> Array:
        """The other way."""
        return np.asarray(np.linalg.inv(self.object_from_board))


@dataclass(frozen=True, eq=False)
class Geometry:
    """What displacements need of a state. contacts: of every board that bears in a cell. meshes: by object name.
    law: of whole taxels. piece_law: of their pieces. depths, rest: depths [m] and pressures, f64[m, 9], of each
    contact's pieces where nothing is displaced.
    """

    contacts: tuple[Contact, ...]
    meshes: dict[str, Mesh]
    law: Law
    piece_law: Law
    depths: tuple[Array, ...]
    rest: tuple[Array, ...]
    _known: dict[tuple[int, bytes], Array] = field(default_factory=dict)
    _rests: dict[int, Array] = field(default_factory=dict)

    @cached_property
    def shares(self) -> dict[tuple[int, int], Array]:
        """Which share of a taxel's force each of its pieces bears, f64[m, 9], by cell and board; all the same where by
        the meshes none is pressed.
        """
        found = {}
        for contact, pressure in zip(self.contacts, self.rest, strict=True):
            whole = pressure.sum(axis=1, keepdims=True)
            even = np.full_like(pressure, 1.0 / PIECES**2)
            found[contact.cell, contact.board] = np.divide(pressure, whole, out=even, where=whole > 0.0)
        return found

    def displaced(self, state: State, number: int, motion: Array) -> Array:
        """What becomes of the forces on a contact's taxels at each of `LEVELS`, f64[2, L, m] as `with_change` takes it,
        when the board moves by `motion` f64[4, 4] in the object's view.

        The board's approach is solved anew so that its net force stays. A fit moves one block after another, and other
        effects beside: what it has asked before is remembered.
        """
        key = (number, motion.tobytes())
        known = self._known.get(key)
        if known is None:
            contact = self.contacts[number]
            mesh = self.meshes[state.pair.cells[contact.cell][0]]
            depth = piece_depth(mesh, motion @ contact.object_from_board, contact)
            known = self._remember(key, _changed(self._at_rest(number), self._at_levels(number, depth)))
        return known

    def sunk(self, number: int, scale: float) -> Array:
        """The same where every piece bears `scale` times as much at the same depth: a softer layer is pressed deeper
        until the net force is what it was, and more of it bears.
        """
        key = (number, np.float64(scale).tobytes())
        known = self._known.get(key)
        if known is None:
            sunk = self._at_levels(number, self.depths[number], scale)
            known = self._remember(key, _changed(self._at_rest(number), sunk))
        return known

    def _at_rest(self, number: int) -> Array:
        known = self._rests.get(number)
        if known is None:
            known = self._rests[number] = self._at_levels(number, self.depths[number])
        return known

    def _at_levels(self, number: int, depth: Array, scale: float = 1.0) -> Array:
        nets = LEVELS * float(self.contacts[number].force.sum()) / scale
        return np.asarray(scale * pressed_to_each(self.piece_law, depth, nets).mean(axis=2))

    def _remember(self, key: tuple[int, bytes], force: Array) -> Array:
        if (len(self._known) + 1) * force.nbytes > REMEMBERED:  # boards are about as large as each other
            self._known.clear()
        self._known[key] = force
        return force


def _changed(rest: Array, now: Array) -> Array:
    """Of forces at rest and now, each f64[L, m]: the share that is kept, and what is gained, f64[2, L, m]."""
    kept = np.divide(now, rest, out=np.ones_like(rest), where=rest > now)
    return np.stack([kept, np.maximum(now - rest, 0.0)])


def unchanged(state: State) -> Array:
    """For `with_change`."""
    change = np.zeros((len(state.pair.cells), 2, len(LEVELS), state.pair.n))
    change[:, 0] = 1.0
    return change


def with_change(state: State, signal: Signal, change: Array) -> Signal:
    """A signal whose forces are changed by f64[C, 2, L, n], the share that is kept and newtons that are gained, where a
    board's net force is one of `LEVELS`, f64[L], of what it is in hold; between them by what lies between.

    By what geometry says is lost a force falls in proportion, for the simulator's own force is never quite what
    geometry says: what is no longer pressed shows nothing.
    """
    assert signal.force is not None
    lies, gains = _between_levels(state, signal)
    force = signal.force.copy()
    for board, layout in enumerate(state.pair.boards):
        kept, gained = change[:, 0][..., layout.taxels], change[:, 1][..., layout.taxels]
        where = ((kept != 1.0) | (gained != 0.0)).any(axis=(1, 2))[state.cell]
        cell, pressed = state.cell[where], force[where][..., layout.taxels]
        now = pressed * (lies[where, :, board] @ kept[cell]) + gains[where, :, board] @ gained[cell]
        force[np.ix_(where, np.arange(force.shape[1]), layout.taxels)] = now
    return signal.with_force(force)


@lru_cache(maxsize=4)
def _between_levels(state: State, signal: Signal) -> tuple[Array, Array]:
    """How much each of `LEVELS` counts for a board at a node: of what is kept, and of what is gained, f64[Q, K, s, L]
    each. A fit changes one signal again and again: worked out once for it.
    """
    assert signal.force is not None
    hold, board = state.clock.phase == Phase.HOLD, state.pair.groups.sums[2]
    net = (board @ signal.force.reshape(-1, state.pair.n).T).T.reshape(*signal.force.shape[:2], -1)
    level = net / np.maximum(net[:, hold].mean(axis=1, keepdims=True), 1e-9)
    right = np.clip(np.searchsorted(LEVELS, level), 1, len(LEVELS) - 1)
    share = np.clip((level - LEVELS[right - 1]) / (LEVELS[right] - LEVELS[right - 1]), 0.0, 1.0)[..., None]
    number = np.arange(len(LEVELS))
    lies = np.where(right[..., None] == number, share, 0.0) + np.where(right[..., None] == number + 1, 1.0 - share, 0.0)
    # Below the least level a press gains in proportion.
    return lies, lies * np.minimum(level / LEVELS[0], 1.0)[..., None]


def piece_depth(mesh: Mesh, object_from_board: Array, contact: Contact) -> Array:
    """How far each piece is pressed in, f64[m, 9], metres; very negative where its ray misses."""
    turn, offset = object_from_board[:3, :3], object_from_board[:3, 3]
    points, normals = contact.points @ turn.T + offset, contact.normals @ turn.T
    shape = points.shape[:2]
    apart = mesh.separation(points.reshape(-1, 3), normals.reshape(-1, 3)).reshape(shape)
    return np.asarray(np.where(np.isfinite(apart), -apart, -1.0))


@lru_cache(maxsize=8)
def geometry_of(state: State) -> Geometry:
    """Work out, once for a state, where boards bear."""
    pair = state.pair
    assert state.base.force is not None
    law = law_of(state)
    meshes = {name: Mesh(pair.objects[name]) for name in pair.object_names}
    hold = state.clock.phase == Phase.HOLD
    contacts = []
    for cell in range(len(pair.cells)):
        force = state.base.force[state.cell == cell][:, hold].mean(axis=(0, 1))
        for board, layout in enumerate(pair.boards):
            taxels = layout.taxels
            if force[taxels].sum() < 0.05:
                continue
            pose = np.linalg.inv(pair.object_poses[cell]) @ pair.sensor_poses[cell, board]
            normals = np.repeat(pair.taxels.normal[taxels][:, None], PIECES**2, axis=1)
            contacts.append(Contact(cell, board, taxels, force[taxels], layout.pieces, normals, pose))
    depths = tuple(piece_depth(meshes[pair.cells[one.cell][0]], one.object_from_board, one) for one in contacts)
    piece_law = law_of_pieces(law, [(depth, one.force) for depth, one in zip(depths, contacts, strict=True)])
    rest = tuple(
        pressed_to(piece_law, depth, float(one.force.sum())) for depth, one in zip(depths, contacts, strict=True)
    )
    return Geometry(tuple(contacts), meshes, law, piece_law, depths, rest)
