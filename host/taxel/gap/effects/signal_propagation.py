"""Contact propagation of the signal: a share of the signal of a taxel reaches neighbouring taxels."""

from __future__ import annotations

from typing import ClassVar

from taxel.gap.data.missing_inputs import GEOMETRY
from taxel.gap.effects.contact_propagation import POWER_SUFFIX, SHAPE, ContactPropagation
from taxel.gap.effects.effect import Effect, Parameter
from taxel.gap.effects.sheet_kernel import compute_even_kernel
from taxel.gap.fitting.state import Signal, State
from taxel.types import FloatArray


class SignalPropagation(Effect):
    """A share `strength` of each taxel's signal reaches its surroundings with the kernel exp(-r / spread).

    variant `signal`: the taxel loses this share. `signal added`: the taxel loses nothing. `signal power`, `signal added
    power`: the same with the kernel exp(-(r / spread)^shape).
    """

    name = "contact_propagation"
    order = 65
    needs: ClassVar[frozenset[str]] = frozenset({GEOMETRY})

    def __init__(self, variant: str = "signal", scope: str = "hand") -> None:
        self.variant, self.scope = variant, scope

    def own_parameters(self) -> tuple[Parameter, ...]:
        """Return spread and strength, and in the forms "power" the shape of the kernel."""
        shape = (SHAPE,) if self.variant.endswith(POWER_SUFFIX) else ()
        return Parameter("spread_mm", "mm", 0.3, 60.0, 2.0, 2.0), Parameter("strength", "1", 0.0, 1.0, 0.0, 0.3), *shape

    def make_start_values(self, state: State) -> FloatArray:
        """Return the values at which a search starts, f64[P, G] (P parameters; G blocks: the hand, boards, objects or
        taxels). The spread is the median pitch of the boards in millimetres, limited to the bounds, unless the spread
        has a prior.
        """
        values = super().make_start_values(state)
        pitches = sorted(board.pitch_m for board in state.pair.boards)
        if "spread_mm" not in self.priors:  # 0.3 and 60 mm are the bounds of the spread
            values[0] = min(max(1e3 * pitches[len(pitches) // 2], 0.3), 60.0)
        return values

    def find_unavailable_reason(self, state: State) -> str:
        """Return why the form is unavailable: with contact forces, `CountsPropagation` applies; otherwise as in
        `Effect`.
        """
        if state.has_force and not self.needs_force:
            return "the simulation has contact forces, for which other forms apply"
        return super().find_unavailable_reason(state)

    def apply(self, state: State, signal: Signal, values: FloatArray) -> Signal:
        """Return the signal after the spread; `signal` itself if the strength is 0. values: f64[P, 1], spread in
        millimetres, strength, and in the forms "power" the shape of the kernel.
        """
        spread_m, strength = 1e-3 * float(values[0, 0]), float(values[1, 0])
        if strength == 0.0:
            return signal
        signal_counts = state.to_signal_counts(signal)
        result = signal_counts.copy() if "added" in self.variant else (1.0 - strength) * signal_counts
        for board in state.pair.boards:
            board_counts = signal_counts[:, :, board.columns]
            if board_counts.any():
                kernel = compute_even_kernel(board, spread_m, *values[2:, 0].tolist())
                result[:, :, board.columns] += strength * (board_counts @ kernel)
        return signal.with_signal_counts(result)


class CountsPropagation(SignalPropagation):
    """Propagation of the signal, in counts, that a simulation computes from contact forces.

    variant `counts power`, `counts added power`: as `signal power` and `signal added power`.

    It differs from a spread of the forces where the signal is not proportional to the force: the sum of the signals is
    kept instead of the sum of the forces. The simulated place of contact has an error, so the change has one, too.
    """

    needs_force: ClassVar[bool] = True
    change_errors: ClassVar[tuple[float, ...]] = ContactPropagation.change_errors
