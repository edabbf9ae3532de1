"""Drift of the raw count without contact, with time or temperature, between baseline and contact."""

from __future__ import annotations

from typing import Final

import numpy as np

from taxel.gap.effects.effect import Effect, Parameter
from taxel.gap.fitting.state import Signal, State
from taxel.types import FloatArray

FROM_CLOSING: Final = "closing"
"""Variant of a drift that begins with the closing of the hand."""


class BaselineDrift(Effect):
    """A common drift of `slope` counts over a grasp, and a random drift with the standard deviation `scatter` counts.

    The common drift increases linearly with time and is added to the signal. The random drift differs from grasp to
    grasp and increases only the drift residual of unloaded taxels.

    variant "": the common drift begins in the middle of the baseline frames. `closing`: it begins with the closing of
    the hand, for example because a warm object heats the skin.
    """

    name = "baseline_drift"
    order = 80

    def __init__(self, scope: str = "hand", variant: str = "") -> None:
        self.scope, self.variant = scope, variant

    def own_parameters(self) -> tuple[Parameter, ...]:
        """Return the mean drift over a grasp, and its standard deviation from grasp to grasp."""
        # name, unit, lower and upper bound, neutral value, start value
        return (
            Parameter("slope", "counts", -500.0, 500.0, 0.0, 1.0),
            Parameter("scatter", "counts", 0.0, 500.0, 0.0, 1.0),
        )

    def apply(self, state: State, signal: Signal, values: FloatArray) -> Signal:
        """Return the signal with the common drift added; `signal` itself if all slopes are 0.

        values: f64[2, G], `slope` and `scatter` of each of G blocks (the hand, or each board, object or taxel).
        """
        if not values[0].any():
            return signal
        slope, _ = self.spread_out(state, values)
        # The middle of the baseline frames is `baseline_age_s` before closing, the time 0 of the nodes.
        age = 0.0 if self.variant == FROM_CLOSING else state.pair.baseline_age_s
        elapsed_share = ((state.node_times_s + age) / (state.node_times_s[-1] + age))[None, :, None]
        return signal.with_signal_counts(state.to_signal_counts(signal) + slope * elapsed_share)

    def apply_to_features(self, state: State, features: FloatArray, values: FloatArray) -> FloatArray:
        """Return the features with an increased drift residual r of unloaded taxels.

        The new residual is the root of r^2 + `slope`^2 + `scatter`^2. features: f64[C, F, n] (C conditions, F features,
        n taxels), returned themselves if all values are 0. values: f64[2, G], `slope` and `scatter` of each of G blocks
        (the hand, or each board).
        """
        if not values.any():
            return features
        added_square = (values**2).sum(axis=0)[self.find_blocks(state)]
        result = features.copy()
        column = state.layout.drift_residual
        result[:, column] = np.where(
            state.is_unloaded, np.sqrt(features[:, column] ** 2 + added_square), features[:, column]
        )
        return result
