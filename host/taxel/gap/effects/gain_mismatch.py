"""Taxels or whole boards that are more or less sensitive than in the simulation."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from taxel.gap.effects.effect import BOARD, TAXEL, Effect, Parameter
from taxel.gap.fitting.state import Signal, State
from taxel.types import FloatArray


class GainMismatch(Effect):
    """The signal counts are multiplied by exp(log_gain), for each board or for each taxel.

    prior: standard deviation of the prior of `log_gain`.
    """

    name = "gain_mismatch"
    order = 50
    is_load_independent: ClassVar[bool] = True

    def __init__(self, scope: str = TAXEL, prior: float = 0.3) -> None:
        self.scope, self.prior = scope, prior
        self.variant = "boards" if scope == BOARD else "taxels"

    def own_parameters(self) -> tuple[Parameter, ...]:
        """Return the natural logarithm of the gain.

        The lower bound is a gain of 0.3, because a smaller gain is a defect and not a tolerance.
        """
        # name, unit, lower and upper bound, neutral value, start value, standard deviation of the prior
        return (Parameter("log_gain", "1", -1.2, 1.0, 0.0, 0.0, self.prior),)

    def apply(self, state: State, signal: Signal, values: FloatArray) -> Signal:
        """Return the signal times exp(log_gain); `signal` itself if all values are 0. values: f64[1, G] (G blocks: the
        hand, boards, objects or taxels), log_gain of each block.
        """
        if not values.any():
            return signal
        (log_gain,) = self.spread_out(state, values)
        return signal.with_signal_counts(state.to_signal_counts(signal) * np.exp(log_gain))
