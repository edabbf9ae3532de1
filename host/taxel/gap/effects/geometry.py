"""Presses that are worked out anew: where an object or a bracket is displaced, or the layer is softer. Depths come from
rays along the taxels' normals onto the objects' meshes, forces from the layer's law at the net force of each board.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.gap.data.boards import PIECES
from taxel.gap.effects.held_object import LEAST_SHARE, Push, pushes_together, shifted_load
from taxel.gap.effects.layer_law import Law, law_of, law_of_pieces, pressed_together
from taxel.gap.effects.ray_mesh import Mesh
from taxel.gap.fitting.state import Signal, State
from taxel.recording.grasp_format import Phase
from taxel.types import FloatArray

LEVELS: Final = np.array([0.2, 0.5, 1.0, 1.25])
"""Shares of a board's net force in hold at which a press is worked out anew."""

AS_IS: Final[Mapping[int, float]] = MappingProxyType({})
"""Every contact bears as much as it does."""

FREELY: Final[Mapping[int, float]] = MappingProxyType({})
"""Nothing holds an object aside."""

STILL: Final = np.eye(4)
"""A board that does not move."""

REMEMBERED: Final = 100_000_000
"""Bytes of forces of displacements that are kept."""


@dataclass(frozen=True, eq=False)
class Contact:
    """One board in one cell during hold. taxels: [m]. force: f64[m], newtons. points: f64[m, 9, 3], of
    their pieces; normals: f64[m, 3]; bracket frame. object_from_board: f64[4, 4].
    """

    condition: int
    board: int
    taxels: NDArray[np.intp]
    force: FloatArray
    points: FloatArray
    normals: FloatArray
    object_from_board: FloatArray

    @cached_property
    def board_from_object(self) -> FloatArray:
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
    depths: tuple[FloatArray, ...]
    rest: tuple[FloatArray, ...]
    _known: dict[tuple[int, bytes], FloatArray] = field(default_factory=dict)
    _rests: dict[int, FloatArray] = field(default_factory=dict)

    @cached_property
    def shares(self) -> dict[tuple[int, int], FloatArray]:
        """Which share of a taxel's force each of its pieces bears, f64[m, 9], by cell and board; all the same where by
        the meshes none is pressed.
        """
        found = {}
        for contact, pressure in zip(self.contacts, self.rest, strict=True):
            whole = pressure.sum(axis=1, keepdims=True)
            even = np.full_like(pressure, 1.0 / PIECES**2)
            found[contact.condition, contact.board] = np.divide(pressure, whole, out=even, where=whole > 0.0)
        return found

    @cached_property
    def together(self) -> list[list[Push]]:
        """Boards that bear an object together."""
        conditions: dict[int, list[Push]] = {}
        for number, one in enumerate(self.contacts):
            turn, force = one.object_from_board[:3, :3], float(one.force.sum())
            way, middle = one.force @ one.normals, one.force @ one.points.mean(axis=1) / force
            place = turn @ middle + one.object_from_board[:3, 3]
            conditions.setdefault(one.condition, []).append(
                Push(number, force, turn @ way / np.linalg.norm(way), place)
            )
        return pushes_together(conditions)

    def displaced(
        self, state: State, motions: Mapping[int, FloatArray], held: Mapping[int, float] = FREELY
    ) -> dict[int, FloatArray]:
        """What becomes of the forces on contacts' taxels at each of `LEVELS`, f64[2, L, m] as `with_change` takes it,
        when their boards move by f64[4, 4] in their objects' views. motions: by number of the contact, as the result.
        held: newtons a metre with which their objects are held aside.

        Each board's approach is solved anew so that its net force stays, or is what `held_object.py` says. A fit moves
        one block after another, and other effects beside: what it has asked before is remembered.
        """
        more: dict[int, float] = {}
        for own in self.together:
            told = [held.get(one.number, 0.0) for one in own]
            if any(told):
                more |= shifted_load(own, [motions.get(one.number, STILL) for one in own], told)

        def depths(numbers: Sequence[int]) -> list[FloatArray]:
            contacts = [self.contacts[number] for number in numbers]
            poses = [motions[number] @ self.contacts[number].object_from_board for number in numbers]
            return piece_depths(state, self.meshes, contacts, poses)

        keys = {
            number: motion.tobytes() + np.float64(more.get(number, 0.0)).tobytes() for number, motion in motions.items()
        }
        return self._changed(keys, depths, more=more)

    def sunk(self, scales: Mapping[int, float]) -> dict[int, FloatArray]:
        """The same where every piece bears so many times as much at the same depth: a softer layer is pressed deeper
        until the net force is what it was, and more of it bears.
        """
        keys = {number: np.float64(scale).tobytes() for number, scale in scales.items()}
        return self._changed(keys, lambda numbers: [self.depths[number] for number in numbers], scales)

    def _changed(
        self,
        keys: Mapping[int, bytes],
        depths: Callable[[Sequence[int]], list[FloatArray]],
        scales: Mapping[int, float] = AS_IS,
        more: Mapping[int, float] = FREELY,
    ) -> dict[int, FloatArray]:
        """What is remembered by contact and key; the rest is worked out anew from these depths."""
        result = {number: self._known[number, key] for number, key in keys.items() if (number, key) in self._known}
        new = [number for number in keys if number not in result]
        if new:
            self._rest_at_levels(new)
            pressed = self._at_levels(new, depths(new), scales, more)
            for number, force in zip(new, pressed, strict=True):
                result[number] = self._remember((number, keys[number]), _change(self._rests[number], force))
        return result

    def _rest_at_levels(self, numbers: Sequence[int]) -> None:
        """Work out those that were never asked for."""
        new = [number for number in numbers if number not in self._rests]
        if new:
            self._rests.update(zip(new, self._at_levels(new, [self.depths[number] for number in new]), strict=True))

    def _at_levels(
        self,
        numbers: Sequence[int],
        depths: Sequence[FloatArray],
        scales: Mapping[int, float] = AS_IS,
        more: Mapping[int, float] = FREELY,
    ) -> list[FloatArray]:
        """Forces f64[L, m] of contacts whose pieces are pressed in like this. more: newtons that they bear besides."""
        scale = np.array([scales.get(number, 1.0) for number in numbers])
        whole = np.array([self.contacts[number].force.sum() for number in numbers])
        besides = np.array([more.get(number, 0.0) for number in numbers])
        # What is held aside is so from the touch on, when a board hardly bears anything.
        net = np.maximum(LEVELS * whole[:, None] + besides[:, None], LEAST_SHARE * LEVELS * whole[:, None])
        pressed = pressed_together(self.piece_law, depths, net / scale[:, None])
        return [own * pressure.mean(axis=2) for own, pressure in zip(scale, pressed, strict=True)]

    def _remember(self, key: tuple[int, bytes], force: FloatArray) -> FloatArray:
        if (len(self._known) + 1) * force.nbytes > REMEMBERED:  # boards are about as large as each other
            self._known.clear()
        self._known[key] = force
        return force


def _change(rest: FloatArray, now: FloatArray) -> FloatArray:
    """Of forces at rest and now, each f64[L, m]: the share that is kept, and what is gained, f64[2, L, m]."""
    kept = np.divide(now, rest, out=np.ones_like(rest), where=rest > now)
    return np.stack([kept, np.maximum(now - rest, 0.0)])


def unchanged(state: State) -> FloatArray:
    """For `with_change`."""
    change = np.zeros((len(state.pair.conditions), 2, len(LEVELS), state.pair.n))
    change[:, 0] = 1.0
    return change


def changed(state: State, parts: Mapping[int, FloatArray]) -> FloatArray:
    """For `with_change`: what `Geometry` tells of some contacts, by their numbers."""
    change = unchanged(state)
    for number, part in parts.items():
        contact = geometry_of(state).contacts[number]
        change[contact.condition][..., contact.taxels] = part
    return change


def with_change(state: State, signal: Signal, change: FloatArray) -> Signal:
    """A signal whose forces are changed by f64[C, 2, L, n], the share that is kept and newtons that are gained, where a
    board's net force is one of `LEVELS`, f64[L], of what it is in hold; between them by what lies between.

    By what geometry says is lost a force falls in proportion, for the simulator's own force is never quite what
    geometry says: what is no longer pressed shows nothing.
    """
    assert signal.force is not None
    lies, gains = _between_levels(state, signal)
    force = signal.force.copy()
    for board, layout in enumerate(state.pair.boards):
        kept, gained = change[:, 0][..., layout.columns], change[:, 1][..., layout.columns]
        where = ((kept != 1.0) | (gained != 0.0)).any(axis=(1, 2))[state.condition]
        condition, pressed = state.condition[where], signal.force[..., layout.columns][where]
        pressed *= lies[where, :, board] @ kept[condition]
        pressed += gains[where, :, board] @ gained[condition]
        force[np.ix_(where, np.arange(force.shape[1]), layout.taxels)] = pressed
    return signal.with_force(force)


@lru_cache(maxsize=4)
def _between_levels(state: State, signal: Signal) -> tuple[FloatArray, FloatArray]:
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


def piece_depths(
    state: State, meshes: Mapping[str, Mesh], contacts: Sequence[Contact], poses: Sequence[FloatArray]
) -> list[FloatArray]:
    """How far each contact's pieces are pressed in, f64[m, 9] each, metres; very negative where a ray misses. meshes:
    by object name. poses: of the boards as the objects see them, f64[4, 4] each.
    """
    points = [one.points @ pose[:3, :3].T + pose[:3, 3] for one, pose in zip(contacts, poses, strict=True)]
    rays = [one.normals @ pose[:3, :3].T for one, pose in zip(contacts, poses, strict=True)]
    names = [state.pair.conditions[one.condition][0] for one in contacts]
    result: dict[int, FloatArray] = {}
    for name in dict.fromkeys(names):
        own = [number for number, other in enumerate(names) if other == name]
        apart = meshes[name].separation(*(np.concatenate([part[number] for number in own]) for part in (points, rays)))
        depth = np.where(np.isfinite(apart), -apart, -1.0)
        ends = np.cumsum([len(rays[number]) for number in own])[:-1]
        result.update(zip(own, np.split(depth, ends), strict=True))
    return [result[number] for number in range(len(contacts))]


@lru_cache(maxsize=8)
def geometry_of(state: State) -> Geometry:
    """Work out, once for a state, where boards bear."""
    pair = state.pair
    assert state.base.force is not None
    law = law_of(state)
    meshes = {name: Mesh(pair.objects[name]) for name in pair.object_names}
    hold = state.clock.phase == Phase.HOLD
    contacts = []
    for condition in range(len(pair.conditions)):
        force = state.base.force[state.condition == condition][:, hold].mean(axis=(0, 1))
        for board, layout in enumerate(pair.boards):
            taxels = layout.taxels
            if force[taxels].sum() < 0.05:
                continue
            pose = np.linalg.inv(pair.object_poses[condition]) @ pair.sensor_poses[condition, board]
            normals = pair.taxels.normal[taxels]
            contacts.append(Contact(condition, board, taxels, force[taxels], layout.pieces, normals, pose))
    depths = piece_depths(state, meshes, contacts, [one.object_from_board for one in contacts])
    piece_law = law_of_pieces(law, [(depth, one.force) for depth, one in zip(depths, contacts, strict=True)])
    whole = np.array([[one.force.sum()] for one in contacts])
    rest = tuple(pressed[0] for pressed in pressed_together(piece_law, depths, whole))
    return Geometry(tuple(contacts), meshes, law, piece_law, tuple(depths), rest)
