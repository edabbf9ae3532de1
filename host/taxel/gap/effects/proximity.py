"""Proximity: the fringe field produces a signal before contact."""

from __future__ import annotations

from typing import ClassVar, Final

import numpy as np

from taxel.gap.effects.effect import Effect, Parameter
from taxel.gap.fitting.state import Signal, State
from taxel.types import FloatArray

SHAPE: Final = Parameter("shape", "1", 0.5, 4.0, 1.0, 1.5, 0.7)
"""Exponent of the decrease with the distance in the form `power`. Prior chosen: the decrease of a fringe field is close
to an exponential."""


class Proximity(Effect):
    """Additional signal of an object at the distance x from the taxel; `counts` in contact.

    variant `exponential`: `counts` exp(-x / range). `power`: `counts` exp(-(x / range)^shape). `linear`: `counts`
    max(1 - x / range, 0).
    """

    name = "proximity"
    order = 45
    needs_force: ClassVar[bool] = True

    def __init__(self, variant: str = "exponential", scope: str = "hand") -> None:
        self.variant, self.scope = variant, scope

    def own_parameters(self) -> tuple[Parameter, ...]:
        """Return the range in millimetres, the signal in contact in counts, and in the form `power` the shape."""
        # name, unit, lower and upper bound, neutral value, start value
        return (
            Parameter("range_mm", "mm", 0.2, 20.0, 2.0, 2.0),
            Parameter("counts", "counts", -800.0, 1500.0, 0.0, 30.0),
            *((SHAPE,) if self.variant == "power" else ()),
        )

    def apply(self, state: State, signal: Signal, values: FloatArray) -> Signal:
        """Return the signal with the proximity signal added; `signal` itself if all counts are 0 or the separations are
        unknown. values: f64[P, G], range in millimetres, signal in contact in counts, and in the form `power` the
        shape, of each of G blocks (the hand, or each board, object or taxel).
        """
        if not values[1].any() or signal.separation is None:
            return signal
        range_mm, counts, *shape = self.spread_out(state, values)
        relative_distance = np.maximum(signal.separation, 0.0) / (1e-3 * range_mm)
        if self.variant == "linear":
            share = np.maximum(1.0 - relative_distance, 0.0)
        else:
            share = np.exp(-(relative_distance ** shape[0] if shape else relative_distance))
        return signal.with_signal_counts(
            state.to_signal_counts(signal) + counts * np.where(signal.separation < MISS_SEPARATION_M, share, 0.0)
        )


MISS_SEPARATION_M = 0.0499
"""Separation from which on the normal of the taxel misses the object, metres. The simulator
stores 0.05 m in this case."""
