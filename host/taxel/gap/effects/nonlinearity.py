"""Nonlinearity: another dependence of the signal on the load, for a simulation without contact forces."""

from __future__ import annotations

from typing import Final

import numpy as np

from taxel.gap.effects.effect import HAND, Effect, Parameter
from taxel.gap.fitting.state import Signal, State
from taxel.types import FloatArray

EXPONENT_STD: Final = 0.3
"""Prior standard deviation of the exponent. Chosen: sensors of one type have similar curves."""


class Nonlinearity(Effect):
    """Power law of the signal: x becomes sign(x) r (|x| / r)^exponent, with the full scale r in counts."""

    name = "nonlinearity"
    order = 55

    def __init__(self, scope: str = HAND) -> None:
        self.scope = scope

    def own_parameters(self) -> tuple[Parameter, ...]:
        """Return the parameter: the exponent."""
        return (Parameter("exponent", "1", 0.3, 3.0, 1.0, 1.0, EXPONENT_STD),)

    def find_unavailable_reason(self, state: State) -> str:
        """Return why the form is unavailable: with contact forces, `stiffness` takes its place; otherwise as in
        `Effect`.
        """
        if state.has_force:
            return "the simulation has contact forces: the effect stiffness describes its curve"
        return super().find_unavailable_reason(state)

    def apply(self, state: State, signal: Signal, values: FloatArray) -> Signal:
        """Return the signal after the power law; `signal` itself if all values are 1. values: f64[1, G] (G blocks: the
        hand, boards, objects or taxels), exponent of each block.
        """
        if (values == 1.0).all():
            return signal
        (exponent,) = self.spread_out(state, values)
        signal_counts, scale = state.to_signal_counts(signal), state.full_scale
        return signal.with_signal_counts(np.sign(signal_counts) * scale * (np.abs(signal_counts) / scale) ** exponent)
