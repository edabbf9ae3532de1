"""The fringe field answers before contact."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from taxel.gap.effects.effect import Effect, Parameter
from taxel.gap.fitting.state import Signal, State
from taxel.types import FloatArray


class Proximity(Effect):
    """An object at a distance x before the taxel adds `counts` exp(-x / range), and all of it in contact."""

    name = "proximity"
    order = 45
    needs_force: ClassVar[bool] = True

    def __init__(self, variant: str = "exponential", scope: str = "hand") -> None:
        self.variant, self.scope = variant, scope

    def own_parameters(self) -> tuple[Parameter, ...]:
        """Range and size."""
        return Parameter("range_mm", "mm", 0.2, 20.0, 2.0, 2.0), Parameter(
            "counts", "counts", -800.0, 1500.0, 0.0, 30.0
        )

    def apply(self, state: State, signal: Signal, values: FloatArray) -> Signal:
        """See `Effect`."""
        if not values[1].any() or signal.separation is None:
            return signal
        reach, counts = self.spread_out(state, values)
        apart = np.maximum(signal.separation, 0.0) / (1e-3 * reach)
        seen = np.exp(-apart) if self.variant == "exponential" else np.maximum(1.0 - apart, 0.0)
        return signal.with_signal_counts(
            state.to_signal_counts(signal) + counts * np.where(signal.separation < MISSED_M, seen, 0.0)
        )


MISSED_M = 0.0499
"""Separations from here on say that the normal misses the object."""
