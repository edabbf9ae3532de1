"""A press draws the layer down around it: a dielectric of pillars gives way beside a press, with a limited slope."""

from __future__ import annotations

from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.gap.boards import PIECES, BoardLayout
from taxel.gap.effects.contact_propagation import ContactPropagation
from taxel.gap.effects.effect import Array, Parameter
from taxel.gap.effects.geometry import geometry_of
from taxel.gap.effects.sheet_kernel import MOST_PAIRS
from taxel.gap.state import State

LEVELS: Final = np.array([0.0, 0.3, 0.65, 1.0, 1.25])
"""Shares of a press's greatest force at which what a board's surroundings gain is worked out; between them linear."""

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

    def spread(self, state: State, number: int, force: Array, spread_m: float, strength: float) -> Array:
        """See `ContactPropagation`."""
        board, shares = state.pair.boards[number], geometry_of(state).shares
        even = np.full((len(board.taxels), PIECES**2), 1.0 / PIECES**2)
        # Half the sensor model's force: of shares tried the best on worlds of this project's emulator, chosen there.
        half_depth_n = 0.5 * state.model.half_force_n
        reach_m = spread_m / FALLEN
        result = force.copy()
        for cell in np.unique(state.cell[force.any(axis=(1, 2))]).tolist():
            own = force[state.cell == cell]
            most = np.maximum(own.max(axis=1).mean(axis=0), 0.0)
            whole = float(most.sum())
            if whole <= 0.0:
                continue
            pressure = PIECES**2 * most[:, None] * shares.get((cell, number), even)
            gained = strength * np.stack([drawn(board, level * pressure, reach_m, half_depth_n) for level in LEVELS])
            level = np.clip(own.sum(axis=2) / whole, 0.0, LEVELS[-1])
            right = np.clip(np.searchsorted(LEVELS, level), 1, len(LEVELS) - 1)
            share = ((level - LEVELS[right - 1]) / (LEVELS[right] - LEVELS[right - 1]))[..., None]
            result[state.cell == cell] += (1.0 - share) * gained[right - 1] + share * gained[right]
        return result


def drawn(board: BoardLayout, pressure: Array, reach_m: float, half_depth_n: float) -> Array:
    """Force that a board's taxels gain, newtons, f64[m]. pressure: f64[m, 9], of their pieces, as the force of a taxel
    that is pressed so all over; f64[m, 1] of taxels where these are too many. reach_m: the way over which the greatest
    depth falls to none.
    """
    if pressure.shape[1] > 1 and pressure.size**2 > MOST_PAIRS:
        return drawn(board, pressure.mean(axis=1, keepdims=True), reach_m, half_depth_n)
    apart_m = _apart(board) if pressure.shape[1] > 1 else board.apart_m
    depth = (pressure / (pressure + half_depth_n)).ravel()
    sources = np.flatnonzero(pressure.ravel() > LEAST_SHARE * pressure.max())
    if not len(sources):
        return np.zeros(len(pressure))
    left = depth[sources, None] - apart_m[sources] / reach_m
    deeper = np.clip(left.max(axis=0), depth, MOST_DEPTH)
    gained = np.maximum(half_depth_n * deeper / (1.0 - deeper) - pressure.ravel(), 0.0)
    return np.asarray(gained.reshape(pressure.shape).mean(axis=1))


@lru_cache(maxsize=64)
def _apart(board: BoardLayout) -> NDArray[np.float32]:
    """Distances of a board's pieces, f32[9 m, 9 m], metres."""
    points = board.pieces.reshape(-1, 3)
    return np.asarray(np.linalg.norm(points[:, None] - points, axis=2), dtype=np.float32)
