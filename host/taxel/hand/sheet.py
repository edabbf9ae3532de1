"""The dielectric sheet of each board: over its taxels, and the bare margin beside them.

The margin touches and bears like the rest, but no electrode is under it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from taxel.hand.description import Board, BoardKind, Hand
from taxel.hand.geometry import Surface
from taxel.types import FloatArray

_STEPS = ((-1, 0), (1, 0), (0, -1), (0, 1))
_FLAT = 1e-9


@dataclass(frozen=True, eq=False)
class Sheet:
    """Squares of sheet, one pitch wide: first those over the taxels in the hand's order, then the bare ones.

    Attributes:
        position, normal, distal: f64[n_taxels + m, 3], as those of `Hand`.
        board_index: which board each belongs to, [n_taxels + m].
        n_taxels: squares in all (named as on a `Hand`, for whoever takes either).
        name, boards, layer_m: those of the hand.
    """

    name: str
    boards: tuple[Board, ...]
    layer_m: float | None
    position: FloatArray
    normal: FloatArray
    distal: FloatArray
    board_index: NDArray[np.intp]

    @property
    def n_taxels(self) -> int:
        """Number of squares."""
        return len(self.position)


@lru_cache(maxsize=8)
def build_sheet(hand: Hand, parts: int = 1) -> Sheet:
    """The sheet of every board, each square cut into parts x parts pieces that follow each other.

    Pieces over a taxel follow the sheet's curvature there, bare ones lie in their square's plane. Raises
    HandGeometryError if the description gives no positions.
    """
    rows, owners = [np.hstack([hand.position, hand.normal, hand.distal])], [hand.board_index]
    bends = [_bends(board.kind, board.kind.surface) for board in hand.boards if board.kind.surface is not None]
    for index, board in enumerate(hand.boards):
        if board.kind.surface is not None:
            rows.append(build_margin(board.kind, board.kind.surface, hand.pitch_m))
            owners.append(np.full(len(rows[-1]), index))
            bends.append(np.zeros((len(rows[-1]), 2)))
    table = _cut(np.vstack(rows), np.vstack(bends), parts, hand.pitch_m)
    owner = np.repeat(np.concatenate(owners), parts * parts)
    return Sheet(hand.name, hand.boards, hand.layer_m, table[:, :3], table[:, 3:6], table[:, 6:], owner)


def _bends(kind: BoardKind, surface: Surface) -> FloatArray:
    """Curvature along the distal and the left direction at every taxel, 1/m, f64[count, 2]; 0 without neighbours.

    By how much the normals of the neighbours on both sides lean apart, over their distance.
    """
    place = {crossing: i for i, crossing in enumerate(zip(kind.tx.tolist(), kind.rx.tolist(), strict=True))}
    bends = np.zeros((len(surface.position), 2))
    for (tx, rx), index in place.items():
        distal = surface.distal[index]
        for axis, (along, step) in enumerate(((distal, (1, 0)), (np.cross(surface.normal[index], distal), (0, 1)))):
            ends = [place.get((tx + way * step[0], rx + way * step[1]), index) for way in (-1, 1)]
            apart = (surface.position[ends[0]] - surface.position[ends[1]]) @ along
            if apart > 0.0:
                bends[index, axis] = (surface.normal[ends[0]] - surface.normal[ends[1]]) @ along / apart
    return bends


def _cut(table: FloatArray, bends: FloatArray, parts: int, pitch_m: float) -> FloatArray:
    if parts == 1:
        return table
    offsets = (np.arange(parts) + 0.5) * pitch_m / parts - 0.5 * pitch_m
    normal, distal = table[:, None, 3:6], table[:, None, 6:]
    left = np.cross(normal, distal)
    along, across = (grid.ravel()[:, None] for grid in np.meshgrid(offsets, offsets, indexing="ij"))
    lean_along, lean_across = bends[:, :1, None] * along, bends[:, 1:, None] * across
    sink = 0.5 * (lean_along * along + lean_across * across)
    pieces = np.repeat(table[:, None], parts * parts, axis=1)
    pieces[..., :3] += along * distal + across * left - sink * normal
    pieces[..., 3:6] += lean_along * distal + lean_across * left
    pieces[..., 3:6] /= np.linalg.norm(pieces[..., 3:6], axis=2, keepdims=True)
    pieces[..., 6:] -= pieces[..., 3:6] * np.sum(pieces[..., 3:6] * pieces[..., 6:], axis=2, keepdims=True)
    pieces[..., 6:] /= np.linalg.norm(pieces[..., 6:], axis=2, keepdims=True)
    return np.asarray(pieces.reshape(-1, table.shape[1]))


def build_margin(kind: BoardKind, surface: Surface, pitch_m: float) -> FloatArray:
    """Squares of bare sheet at every place beside a taxel, in the map or just outside it, that has none.

    Each is carried on from its neighbours along the sheet's curvature. f64[m, 9]: centre (metres), normal, and the
    direction of the distal side, bracket frame.
    """
    place = {crossing: i for i, crossing in enumerate(zip(kind.tx.tolist(), kind.rx.tolist(), strict=True))}
    found: dict[tuple[int, int], list[FloatArray]] = {}
    for (tx, rx), index in place.items():
        for step in _STEPS:
            beside = (tx + step[0], rx + step[1])
            if beside not in place:
                behind = place.get((tx - step[0], rx - step[1]))
                found.setdefault(beside, []).append(_carried_on(surface, index, behind, step, pitch_m))
    squares = [np.mean(found[beside], axis=0) for beside in sorted(found)]
    if not squares:
        return np.empty((0, 9))
    rows = np.stack(squares)
    rows[:, 3:6] /= np.linalg.norm(rows[:, 3:6], axis=1, keepdims=True)
    rows[:, 6:] -= rows[:, 3:6] * np.sum(rows[:, 3:6] * rows[:, 6:], axis=1, keepdims=True)
    rows[:, 6:] /= np.linalg.norm(rows[:, 6:], axis=1, keepdims=True)
    return rows


def _carried_on(surface: Surface, index: int, behind: int | None, step: tuple[int, int], pitch: float) -> FloatArray:
    """One pitch beyond taxel `index`, on a circle through it that bends as from the taxel on its other side."""
    position, normal, distal = surface.position[index], surface.normal[index], surface.distal[index]
    left = np.cross(normal, distal)
    along = -step[0] * distal - step[1] * left  # TX 0 is distal, RX 0 is left
    angle = 0.0
    if behind is not None:  # the normal there leans back by the sine of the angle between them
        angle = float(np.arcsin(np.clip(-surface.normal[behind] @ along, -1.0, 1.0)))
    if abs(angle) < _FLAT:
        moved = pitch * along
    else:
        radius = pitch / angle
        moved = radius * (np.sin(angle) * along - (1.0 - np.cos(angle)) * normal)
    turned = np.cos(angle) * along - np.sin(angle) * normal
    direction = -step[0] * turned if step[0] else distal
    return np.concatenate([position + moved, np.cos(angle) * normal + np.sin(angle) * along, direction])
