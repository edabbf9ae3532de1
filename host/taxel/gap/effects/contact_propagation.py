"""Pressure spreads sideways through the elastic dielectric before it is measured."""

from __future__ import annotations

from typing import ClassVar, Final

import numpy as np

from taxel.gap.effects.effect import BOARD, Effect, Parameter
from taxel.gap.effects.geometry import geometry_of
from taxel.gap.effects.sheet_kernel import sheet_kernel, taxel_kernel
from taxel.gap.fitting.state import Signal, State
from taxel.types import FloatArray

EVEN: Final = " even"


class ContactPropagation(Effect):
    """A share `strength` of each taxel's force goes to its surroundings with the kernel exp(-r / spread), from where on
    the taxel the object's mesh presses it: what bears on an edge goes to the next taxel sooner.

    variant "kept": the board's net force stays. "added": the surroundings gain what the taxel does not lose, as where
    the patch of contact grows. "kept even", "added even": the same from all over the taxel.
    """

    name = "contact_propagation"
    order = 20
    needs_force: ClassVar[bool] = True

    def __init__(self, variant: str = "kept", scope: str = "hand") -> None:
        self.variant, self.scope = variant, scope

    def own_parameters(self) -> tuple[Parameter, ...]:
        """Spread and strength."""
        return Parameter("spread_mm", "mm", 0.3, 12.0, 2.0, 2.0), Parameter("strength", "1", 0.0, 1.0, 0.0, 0.4)

    def apply(self, state: State, signal: Signal, values: FloatArray) -> Signal:
        """See `Effect`."""
        if not values[1].any() or signal.force is None:
            return signal
        force = signal.force.copy()
        for number, board in enumerate(state.pair.boards):
            block = number if self.scope == BOARD else 0
            spread_m, strength = 1e-3 * float(values[0, block]), float(values[1, block])
            own = signal.force[:, :, board.columns]
            if strength != 0.0 and own.any():
                force[:, :, board.columns] = self.spread(state, number, own, spread_m, strength)
        return signal.with_force(force)

    def spread(self, state: State, number: int, force: FloatArray, spread_m: float, strength: float) -> FloatArray:
        """What becomes of the forces f64[Q, K, m] on board `number`."""
        kernel = sheet_kernel(state.pair.boards[number], spread_m)
        result = force if self.variant.startswith("added") else (1.0 - strength) * force
        if self.variant.endswith(EVEN):
            return np.asarray(result + strength * (force @ taxel_kernel(kernel, None)))
        shares, result = geometry_of(state).shares, result.copy()
        for condition in np.unique(state.condition[force.any(axis=(1, 2))]).tolist():
            own = state.condition == condition
            result[own] += strength * (force[own] @ taxel_kernel(kernel, shares.get((condition, number))))
        return np.asarray(result)
