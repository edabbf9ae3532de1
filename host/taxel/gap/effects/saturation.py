"""The count stops falling at high force."""

from __future__ import annotations

import numpy as np

from taxel.gap.effects.effect import Array, Effect, Parameter
from taxel.gap.state import Signal, State


class Saturation(Effect):
    """Drops end at `counts`: sharply (variant "clip"), or gradually, x counts / (x + counts) ("soft")."""

    name = "saturation"
    order = 60

    def __init__(self, variant: str = "clip", scope: str = "hand") -> None:
        self.variant, self.scope = variant, scope

    def own_parameters(self) -> tuple[Parameter, ...]:
        """Where it ends; the upper bound is out of reach of 16 bit."""
        return (Parameter("counts", "counts", 50.0, 1e6, 1e6, 1000.0),)

    def apply(self, state: State, signal: Signal, values: Array) -> Signal:
        """See `Effect`."""
        if (values >= 1e6).all():
            return signal
        (most,) = self.spread_out(state, values)
        drop = state.to_drop(signal)
        if self.variant == "clip":
            return signal.with_drop(np.minimum(drop, most))
        positive = np.maximum(drop, 0.0)
        return signal.with_drop(np.where(most >= 1e6, drop, drop - positive + positive * most / (positive + most)))
