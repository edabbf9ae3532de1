"""Nonlinearity: another dependence of the signal on the load, for a simulation without contact forces."""

from __future__ import annotations

from typing import Final

import numpy as np

from taxel.gap.effects.effect import HAND, Effect, Parameter
from taxel.gap.fitting.state import Signal, State
from taxel.types import FloatArray

EXPONENT_STD: Final = 0.3
"""Prior standard deviation of the exponent. Chosen: sensors of one type have similar curves."""

POLYNOMIAL: Final = "polynomial"
"""Variant with a polynomial of third degree."""

TERM_STD: Final = 0.4
"""Prior standard deviation of a term of the polynomial. Chosen: at half the full scale, the term changes the signal as
much as an exponent at `EXPONENT_STD`."""


class Nonlinearity(Effect):
    """Another curve of the signal x, relative to the full scale r in counts: u = |x| / r.

    variant "": power law, sign(x) r u^exponent. `polynomial`: x (1 - quadratic (1 - u) - cubic u (1 - u)), the Taylor
    expansion of a curve through 0 and through the full scale.
    """

    name = "nonlinearity"
    order = 55

    def __init__(self, scope: str = HAND, variant: str = "") -> None:
        self.scope, self.variant = scope, variant

    def own_parameters(self) -> tuple[Parameter, ...]:
        """Return the parameters: the exponent, or in the form `polynomial` both terms.

        The bounds of the terms keep the curve increasing at both ends.
        """
        if self.variant == POLYNOMIAL:
            return (
                Parameter("quadratic", "1", -0.9, 0.9, 0.0, 0.0, TERM_STD),
                Parameter("cubic", "1", -0.9, 0.9, 0.0, 0.0, TERM_STD),
            )
        return (Parameter("exponent", "1", 0.3, 3.0, 1.0, 1.0, EXPONENT_STD),)

    def find_unavailable_reason(self, state: State) -> str:
        """Return why the form is unavailable: with contact forces, `stiffness` takes its place; otherwise as in
        `Effect`.
        """
        if state.has_force:
            return "the simulation has contact forces: the effect stiffness describes its curve"
        return super().find_unavailable_reason(state)

    def apply(self, state: State, signal: Signal, values: FloatArray) -> Signal:
        """Return the signal on the other curve; `signal` itself if all values are neutral. values: f64[P, G] (P
        parameters; G blocks: the hand, boards, objects or taxels).
        """
        if (values == self.make_neutral_values(state)).all():
            return signal
        signal_counts, scale = state.to_signal_counts(signal), state.full_scale
        if self.variant == POLYNOMIAL:
            quadratic, cubic = self.spread_out(state, values)
            level = np.minimum(np.abs(signal_counts) / scale, 1.0)
            factor = 1.0 - (quadratic + cubic * level) * (1.0 - level)
            return signal.with_signal_counts(signal_counts * factor)
        (exponent,) = self.spread_out(state, values)
        return signal.with_signal_counts(np.sign(signal_counts) * scale * (np.abs(signal_counts) / scale) ** exponent)
