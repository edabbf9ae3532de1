"""The count stops falling at high force."""

from __future__ import annotations

from typing import Final

import numpy as np

from taxel.gap.effects.effect import Effect, Parameter
from taxel.gap.fitting.state import Signal, State
from taxel.types import FloatArray

START: Final = 0.7
"""Of the largest drop: a search must start where something is cut off, or nothing tells it the way."""


class Saturation(Effect):
    """The size of a signal ends at `counts`: sharply (variant "clip"), or as x counts / (x + counts) ("soft")."""

    name = "saturation"
    order = 60

    def __init__(self, variant: str = "clip", scope: str = "hand") -> None:
        self.variant, self.scope = variant, scope

    def own_parameters(self) -> tuple[Parameter, ...]:
        """Where it ends; the upper bound is out of reach of 16 bit. Its start is of a hand that nobody has measured."""
        return (Parameter("counts", "counts", 50.0, 1e6, 1e6, 1000.0),)

    def starts(self, state: State) -> FloatArray:
        """See `Effect`."""
        values = super().starts(state)
        if "counts" not in self.priors:
            (counts,) = self.parameters()
            largest = float(np.nan_to_num(state.mean[:, : state.layout.bins]).max(initial=0.0))
            values[:] = np.clip(START * largest, counts.low, counts.high)
        return values

    def apply(self, state: State, signal: Signal, values: FloatArray) -> Signal:
        """See `Effect`."""
        if (values >= 1e6).all():
            return signal
        (most,) = self.spread_out(state, values)
        signal_counts = state.to_signal_counts(signal)
        if self.variant == "clip":
            return signal.with_signal_counts(np.clip(signal_counts, -most, most))
        size = np.abs(signal_counts)
        return signal.with_signal_counts(np.where(most >= 1e6, signal_counts, signal_counts * most / (size + most)))
