"""Contact propagation in a dielectric of pillars: around a loaded place the depth decreases with a fixed slope."""

from __future__ import annotations

from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.gap.data.boards import PIECES_PER_SIDE, BoardLayout
from taxel.gap.effects.contact_propagation import ContactPropagation
from taxel.gap.effects.effect import Parameter
from taxel.gap.effects.geometry import compute_geometry
from taxel.gap.effects.sheet_kernel import MAX_PIECE_PAIRS
from taxel.gap.fitting.state import Signal, State
from taxel.types import FloatArray

FORCE_LEVELS: Final = np.array([0.0, 0.3, 0.65, 1.0])
"""Net force of a board, as shares of the sum of the largest forces of its taxels, at which the gained forces are
computed. Between the levels the gained force is interpolated linearly; it is 0 at the first level."""

MAX_DEPTH_SHARE: Final = 0.97
"""Largest depth, as a share of the greatest depth, which no finite force reaches. It limits the gained force."""

DECREASE_AT_SPREAD: Final = 1.0 - np.exp(-1.0)
"""Decrease of the depth at the distance `spread_mm`, as a share of the greatest depth: the depth there is 1/e of it, by
the definition in the report."""


class PillarPropagation(ContactPropagation):
    """Contact propagation with a fixed slope: the depth of a piece is at least the depth of each other piece minus a
    decrease that is proportional to their distance. The force on the piece itself is kept.

    The depth is force / (force + half_depth_n), as a share of the greatest depth: the closed share of the gap of a
    plate capacitor. spread_mm: distance at which the greatest depth has decreased to 1/e. strength: factor on the force
    that the other pieces gain.
    """

    def __init__(self, scope: str = "hand") -> None:
        super().__init__("pillars", scope)

    def own_parameters(self) -> tuple[Parameter, ...]:
        """Return the parameters: spread in millimetres and strength."""
        return Parameter("spread_mm", "mm", 0.2, 25.0, 1.3, 3.8), Parameter("strength", "1", 0.0, 3.0, 0.0, 0.8)

    def apply(self, state: State, signal: Signal, values: FloatArray) -> Signal:
        """Return the signal with the gained forces added; `signal` itself without contact forces, or if all strengths
        are 0. values: f64[2, G], spread in millimetres and strength of each of G blocks (the hand, or each board,
        object or taxel).
        """
        if not values[1].any() or signal.force is None:
            return signal
        _, strength = self.spread_out(state, values)
        spreads = values[0, self.find_blocks(state)[0, [int(board.taxels[0]) for board in state.pair.boards]]]
        return signal.with_force(signal.force + strength * _compute_unit_gain(state, signal, tuple(spreads.tolist())))


@lru_cache(maxsize=4)
def _compute_unit_gain(state: State, signal: Signal, spread_mm: tuple[float, ...]) -> FloatArray:
    """Return the force that each taxel gains at the strength 1, newtons, f64[Q, K, n] (Q simulated contacts, K time
    nodes, n taxels).

    The gain is computed at the levels `FORCE_LEVELS` of the net force of each board, and interpolated between them.
    spread_mm: parameter `spread_mm` of each board. The result is cached, because a fit varies the strength at the same
    spreads.
    """
    assert signal.force is not None
    shares = compute_geometry(state).piece_shares
    # The factor 0.5 was selected from several values on worlds of the emulator.
    half_depth_n = 0.5 * float(np.mean(state.sensor_model.half_force_n))
    result = np.zeros(signal.force.shape)
    for number, (board, spread) in enumerate(zip(state.pair.boards, spread_mm, strict=True)):
        even = np.full((len(board.taxels), PIECES_PER_SIDE**2), 1.0 / PIECES_PER_SIDE**2)
        force = signal.force[:, :, board.columns]
        for row in np.flatnonzero(force.any(axis=(1, 2))).tolist():
            board_force = force[row]
            max_force = np.maximum(board_force.max(axis=0), 0.0)
            max_net = float(max_force.sum())
            if max_net <= 0.0:
                continue
            # pressure on a piece: the force of a taxel whose whole area has this pressure
            pressure = PIECES_PER_SIDE**2 * max_force[:, None] * shares.get((row, number), even)
            gained = compute_gained_force(board, pressure, 1e-3 * spread / DECREASE_AT_SPREAD, half_depth_n)
            level = np.clip(board_force.sum(axis=1) / max_net, 0.0, FORCE_LEVELS[-1])
            right = np.clip(np.searchsorted(FORCE_LEVELS, level), 1, len(FORCE_LEVELS) - 1)
            share = ((level - FORCE_LEVELS[right - 1]) / (FORCE_LEVELS[right] - FORCE_LEVELS[right - 1]))[..., None]
            result[row][:, board.columns] = (1.0 - share) * gained[right - 1] + share * gained[right]
    return result


def compute_gained_force(board: BoardLayout, pressure: FloatArray, reach_m: float, half_depth_n: float) -> FloatArray:
    """Return the force that the taxels of a board gain at each of the L `FORCE_LEVELS`, newtons, f64[L, m] (m taxels of
    the board).

    A force F presses a piece to the share F / (F + half_depth_n) of the greatest depth. The depth of a piece is at
    least the depth of each other piece minus a decrease that is proportional to the distance. The gained force is the
    force of this depth minus the own force of the piece.

    pressure: f64[m, 9], newtons, of the pieces at the level 1: the force of a taxel whose whole area has this pressure.
    reach_m: distance over which the greatest depth decreases to 0, metres. half_depth_n: force of half the greatest
    depth, newtons. On a board with more than `MAX_PIECE_PAIRS` pairs of pieces, whole taxels take the place of pieces.
    """
    uses_pieces = pressure.size**2 <= MAX_PIECE_PAIRS
    source_pressure = (pressure if uses_pieces else pressure.mean(axis=1, keepdims=True)).ravel()
    gained = np.zeros((len(FORCE_LEVELS), len(source_pressure)))
    distance, nearest_m = _compute_distances(board, uses_pieces)
    for level, result in zip(FORCE_LEVELS[1:], gained[1:], strict=True):
        own_pressure = level * source_pressure
        own_depth = own_pressure / (own_pressure + half_depth_n)
        sources = np.flatnonzero(own_depth * reach_m > nearest_m)  # the others reach no other piece
        if not len(sources):
            continue
        # Single precision suffices for a depth, and the pairs of pieces are many.
        lead_m = (reach_m * own_depth[sources, None]).astype(np.float32) - distance[sources]
        propagated = lead_m.max(axis=0, initial=0.0) / reach_m
        depth = np.clip(propagated, own_depth, MAX_DEPTH_SHARE)
        result[:] = np.maximum(half_depth_n * depth / (1.0 - depth) - own_pressure, 0.0)
    return np.asarray(gained.reshape(len(FORCE_LEVELS), len(pressure), -1).mean(axis=2))


@lru_cache(maxsize=64)
def _compute_distances(board: BoardLayout, uses_pieces: bool) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the distances between a board's pieces, or between its taxels, metres, f32[k, k], infinite on the
    diagonal, and the smallest distance of each of them, f32[k].

    uses_pieces: whether k is the number of pieces (9 per taxel) or the number of taxels.
    """
    points = board.piece_centres.reshape(-1, 3)
    distance = np.linalg.norm(points[:, None] - points, axis=2) if uses_pieces else board.distance_m.copy()
    np.fill_diagonal(distance, np.inf)
    distances = distance.astype(np.float32)
    return distances, distances.min(axis=1, initial=np.inf)
