"""Lateral spread of pressure in the elastic dielectric before the measurement."""

from __future__ import annotations

from typing import ClassVar, Final

import numpy as np

from taxel.gap.effects.effect import BOARD, Effect, Parameter
from taxel.gap.effects.geometry import compute_geometry
from taxel.gap.effects.sheet_kernel import compute_even_kernel, compute_sheet_kernel, compute_taxel_kernel
from taxel.gap.fitting.state import Signal, State
from taxel.types import FloatArray

EVEN_SUFFIX: Final = " even"
"""End of the name of a variant that assumes an even load on each taxel."""

POWER_SUFFIX: Final = " power"
"""End of the name of a variant whose kernel has the parameter `SHAPE`."""

SHAPE: Final = Parameter("shape", "1", 0.5, 6.0, 1.0, 2.0, 1.5)
"""Exponent of the kernel exp(-(r / spread)^shape): 1 for an exponential, 2 for a Gaussian, larger for an even spread
within the distance `spread`. Prior chosen: kernels of soft covers are between an exponential and an even spread."""


class ContactPropagation(Effect):
    """A share `strength` of the force of each taxel spreads to its surroundings with the kernel exp(-r / spread).

    The force spreads from the place on the taxel that the mesh of the object loads: a load at an edge spreads more to
    the neighbouring taxel on this side.

    variant "kept": the net force of the board is kept. "added": the surroundings gain force and the taxel loses none,
    as if the contact area grew. "kept even", "added even": the same with an even load on the taxel. "kept power",
    "added power": as "kept even" and "added even" with the kernel exp(-(r / spread)^shape).
    """

    name = "contact_propagation"
    order = 20
    needs_force: ClassVar[bool] = True
    change_errors: ClassVar[tuple[float, ...]] = (0.0, 0.25, 0.5)

    def __init__(self, variant: str = "kept", scope: str = "hand") -> None:
        self.variant, self.scope = variant, scope

    def own_parameters(self) -> tuple[Parameter, ...]:
        """Return spread and strength, and in the forms "power" the shape of the kernel."""
        shape = (SHAPE,) if self.variant.endswith(POWER_SUFFIX) else ()
        return Parameter("spread_mm", "mm", 0.3, 12.0, 2.0, 2.0), Parameter("strength", "1", 0.0, 1.0, 0.0, 0.4), *shape

    def apply(self, state: State, signal: Signal, values: FloatArray) -> Signal:
        """Return the signal with the contact forces of every board spread; `signal` itself without contact forces, or
        if all strengths are 0. values: f64[P, G], spread in millimetres, strength and in the forms "power" the shape of
        the kernel, of each of G blocks (the hand, or each board, object or taxel).
        """
        if not values[1].any() or signal.force is None:
            return signal
        force = signal.force.copy()
        for number, board in enumerate(state.pair.boards):
            block = number if self.scope == BOARD else 0
            spread_m, strength = 1e-3 * float(values[0, block]), float(values[1, block])
            board_force = signal.force[:, :, board.columns]
            if strength != 0.0 and board_force.any():
                lengths = (spread_m, *values[2:, block].tolist())
                force[:, :, board.columns] = self._spread_force(state, number, board_force, lengths, strength)
        return signal.with_force(force)

    def _spread_force(
        self, state: State, number: int, force: FloatArray, lengths: tuple[float, ...], strength: float
    ) -> FloatArray:
        """Return the forces of the m taxels of board `number` after the spread, f64[Q, K, m] (Q simulated contacts, K
        time nodes), newtons.

        force: forces before the spread, f64[Q, K, m], newtons. lengths: arguments of `compute_sheet_kernel` after the
        board. strength: share of the force that spreads. In the forms "added" the taxel itself loses no force. In the
        forms "even" and "power" the load on a taxel is even; otherwise the force spreads from the loaded pieces of the
        taxel.
        """
        board = state.pair.boards[number]
        result = force if self.variant.startswith("added") else (1.0 - strength) * force
        if self.variant.endswith((EVEN_SUFFIX, POWER_SUFFIX)):
            return np.asarray(result + strength * (force @ compute_even_kernel(board, *lengths)))
        kernel = compute_sheet_kernel(board, *lengths)
        piece_shares, result = compute_geometry(state).piece_shares, result.copy()
        for row in np.flatnonzero(force.any(axis=(1, 2))).tolist():
            share = piece_shares.get((row, number))
            result[row] += strength * (force[row] @ compute_taxel_kernel(kernel, share))
        return np.asarray(result)
