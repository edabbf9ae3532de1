"""A press draws the layer down around it: a dielectric of pillars gives way beside a press, with a limited slope."""

from __future__ import annotations

from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.gap.data.boards import PIECES, BoardLayout
from taxel.gap.effects.contact_propagation import ContactPropagation
from taxel.gap.effects.effect import Parameter
from taxel.gap.effects.geometry import geometry_of
from taxel.gap.effects.sheet_kernel import MOST_PAIRS
from taxel.gap.fitting.state import Signal, State
from taxel.types import FloatArray

LEVELS: Final = np.array([0.0, 0.3, 0.65, 1.0, 1.25])
"""Shares of a press's greatest force at which what a board's surroundings gain is worked out: nothing at the first;
between them linear."""

LEAST_SHARE: Final = 1e-4
"""Of the greatest pressure: pieces that are pressed by less draw nothing down."""

MOST_DEPTH: Final = 0.97
"""Share of the greatest depth, which no finite force reaches."""


FALLEN: Final = 1.0 - np.exp(-1.0)
"""Share of a depth that is gone at the spread, by the report's definition."""


class PillarPropagation(ContactPropagation):
    """A piece's depth is at least what any other's leaves over the way between them; its own force stays.

    Depth is told as a share of the greatest, force / (force + half_depth_n): that of the sensor model's drop, were the
    taxel a capacitor whose plate approaches. spread_mm: the way over which it falls from that to 1/e of it. strength:
    share of what comes by this that the others gain.
    """

    def __init__(self, scope: str = "hand") -> None:
        super().__init__("pillars", scope)

    def own_parameters(self) -> tuple[Parameter, ...]:
        """Spread and strength."""
        return Parameter("spread_mm", "mm", 0.2, 25.0, 1.3, 3.8), Parameter("strength", "1", 0.0, 3.0, 0.0, 0.8)

    def apply(self, state: State, signal: Signal, values: FloatArray) -> Signal:
        """See `Effect`."""
        if not values[1].any() or signal.force is None:
            return signal
        _, strength = self.spread_out(state, values)
        spreads = values[0, self.blocks(state)[0, [int(board.taxels[0]) for board in state.pair.boards]]]
        return signal.with_force(signal.force + strength * _gained(state, signal, tuple(spreads.tolist())))


@lru_cache(maxsize=4)
def _gained(state: State, signal: Signal, spread_mm: tuple[float, ...]) -> FloatArray:
    """What the forces draw to other taxels at the strength 1, f64[Q, K, n]. A fit changes the strength beside the same
    spreads: worked out once for these. spread_mm: of each board.
    """
    assert signal.force is not None
    shares = geometry_of(state).shares
    # Half the sensor model's force: of shares tried the best on worlds of this project's emulator, chosen there.
    half_depth_n = 0.5 * float(np.mean(state.model.half_force_n))
    result = np.zeros(signal.force.shape)
    for number, (board, spread) in enumerate(zip(state.pair.boards, spread_mm, strict=True)):
        even = np.full((len(board.taxels), PIECES**2), 1.0 / PIECES**2)
        force = signal.force[:, :, board.columns]
        for condition in np.unique(state.condition[force.any(axis=(1, 2))]).tolist():
            contacts = state.condition == condition
            own = force[contacts]
            most = np.maximum(own.max(axis=1).mean(axis=0), 0.0)
            whole = float(most.sum())
            if whole <= 0.0:
                continue
            pressure = PIECES**2 * most[:, None] * shares.get((condition, number), even)
            gained = drawn(board, pressure, 1e-3 * spread / FALLEN, half_depth_n)
            level = np.clip(own.sum(axis=2) / whole, 0.0, LEVELS[-1])
            right = np.clip(np.searchsorted(LEVELS, level), 1, len(LEVELS) - 1)
            share = ((level - LEVELS[right - 1]) / (LEVELS[right] - LEVELS[right - 1]))[..., None]
            result[contacts, :, board.columns] = (1.0 - share) * gained[right - 1] + share * gained[right]
    return result


def drawn(board: BoardLayout, pressure: FloatArray, reach_m: float, half_depth_n: float) -> FloatArray:
    """Force that a board's taxels gain at each of `LEVELS`, newtons, f64[L, m]. pressure: f64[m, 9], of their pieces at
    the level 1, as the force of a taxel that is pressed so all over. reach_m: the way over which the greatest depth
    falls to none.
    """
    in_pieces = pressure.size**2 <= MOST_PAIRS
    pressed = (pressure if in_pieces else pressure.mean(axis=1, keepdims=True)).ravel()
    sources = np.flatnonzero(pressed > LEAST_SHARE * pressed.max())
    gained = np.zeros((len(LEVELS), len(pressed)))
    # Single precision: pairs of pieces are many, and what is left of a depth need not be known better.
    lost = _apart(board, in_pieces)[sources] * np.float32(1.0 / reach_m)
    for level, result in zip(LEVELS[1:], gained[1:], strict=True):
        own = level * pressed
        depth = own / (own + half_depth_n)
        left = (depth[sources, None].astype(np.float32) - lost).max(axis=0, initial=0.0)
        deeper = np.clip(left, depth, MOST_DEPTH)
        result[:] = np.maximum(half_depth_n * deeper / (1.0 - deeper) - own, 0.0)
    return np.asarray(gained.reshape(len(LEVELS), len(pressure), -1).mean(axis=2))


@lru_cache(maxsize=64)
def _apart(board: BoardLayout, in_pieces: bool) -> NDArray[np.float32]:
    """Distances of a board's pieces, or of its taxels, f32[k, k], metres; none draws itself down."""
    points = board.pieces.reshape(-1, 3)
    apart = np.linalg.norm(points[:, None] - points, axis=2) if in_pieces else board.apart_m.copy()
    np.fill_diagonal(apart, np.inf)
    return np.asarray(apart, dtype=np.float32)
