"""Pressure spreads sideways through the elastic dielectric before it is measured."""

from __future__ import annotations

from functools import lru_cache
from typing import ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from taxel.gap.boards import BoardLayout
from taxel.gap.effects.effect import BOARD, Array, Effect, Parameter
from taxel.gap.state import Signal, State

FAR_M: Final = 0.04
"""Taxels farther apart do not reach each other."""

SUB: Final = 5
"""Points along a taxel's side over which the kernel is averaged."""


class ContactPropagation(Effect):
    """A share `strength` of each taxel's force goes to its surroundings with the kernel exp(-r / spread).

    variant "kept": the board's net force stays. "added": the surroundings gain what the taxel does not lose, as where
    the patch of contact grows.
    """

    name = "contact_propagation"
    order = 20
    needs_force: ClassVar[bool] = True

    def __init__(self, variant: str = "kept", scope: str = "hand") -> None:
        self.variant, self.scope = variant, scope

    def own_parameters(self) -> tuple[Parameter, ...]:
        """Spread and strength."""
        return Parameter("spread_mm", "mm", 0.3, 12.0, 2.0, 2.0), Parameter("strength", "1", 0.0, 1.0, 0.0, 0.4)

    def apply(self, state: State, signal: Signal, values: Array) -> Signal:
        """See `Effect`."""
        if not values[1].any() or signal.force is None:
            return signal
        force = signal.force.copy()
        for number, board in enumerate(state.pair.boards):
            block = number if self.scope == BOARD else 0
            spread_m, strength = 1e-3 * float(values[0, block]), float(values[1, block])
            own = signal.force[:, :, board.taxels].reshape(-1, len(board.taxels))
            loaded = np.flatnonzero(own.any(axis=1))
            if strength != 0.0 and len(loaded):
                own[loaded] = self.spread(board, own[loaded], spread_m, strength)
                force[:, :, board.taxels] = own.reshape(len(force), -1, len(board.taxels))
        return signal.with_force(force)

    def spread(self, board: BoardLayout, force: Array, spread_m: float, strength: float) -> Array:
        """What becomes of a board's forces f64[r, m] at r moments."""
        keep = 1.0 if self.variant == "added" else 1.0 - strength
        return np.asarray(keep * force + strength * (force @ spread_kernel(board, spread_m)))


def spread_kernel(board: BoardLayout, spread_m: float) -> Array:
    """Share of a taxel's force (row) that reaches another (column) of the same board, f64[m, m]; rows add to 1."""
    distance, share = _square_kernel(round(spread_m, 7), round(board.pitch_m, 6))
    kernel = np.where(board.apart_m < FAR_M, np.interp(board.apart_m, distance, share), 0.0)
    return np.asarray(kernel / kernel.sum(axis=1, keepdims=True))


@lru_cache(maxsize=256)
def _square_kernel(spread_m: float, side_m: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """exp(-r / spread) averaged over two squares, over the distance of their centres, mean of two directions."""
    points = ((np.arange(SUB) + 0.5) / SUB - 0.5) * side_m
    step = (points[:, None] - points).ravel()
    x, y = (grid.ravel() for grid in np.meshgrid(step, step))
    distance = np.linspace(0.0, FAR_M, 81)
    along = np.exp(-np.hypot(distance[:, None] + x, y) / spread_m).mean(axis=1)
    across = np.exp(-np.hypot(distance[:, None] / np.sqrt(2) + x, distance[:, None] / np.sqrt(2) + y) / spread_m)
    return distance, 0.5 * (along + across.mean(axis=1))
