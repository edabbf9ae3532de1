"""The no-contact count wanders with time or temperature, so that a baseline is old when the hand has closed."""

from __future__ import annotations

import numpy as np

from taxel.gap.effects.effect import Effect, Parameter
from taxel.gap.fitting.state import Signal, State
from taxel.types import FloatArray


class BaselineDrift(Effect):
    """Adds `slope` counts over a grasp to every drop, and `scatter` counts that differ from grasp to grasp."""

    name = "baseline_drift"
    order = 80

    def __init__(self, scope: str = "hand") -> None:
        self.scope = scope

    def own_parameters(self) -> tuple[Parameter, ...]:
        """Drift over a grasp: its mean, and its standard deviation from grasp to grasp."""
        return (
            Parameter("slope", "counts", -500.0, 500.0, 0.0, 1.0),
            Parameter("scatter", "counts", 0.0, 500.0, 0.0, 1.0),
        )

    def apply(self, state: State, signal: Signal, values: FloatArray) -> Signal:
        """See `Effect`."""
        if not values[0].any():
            return signal
        slope, _ = self.spread_out(state, values)
        # The baseline is as old as the middle of its frames.
        age = state.pair.baseline_age_s
        share = ((state.since + age) / (state.since[-1] + age))[None, :, None]
        return signal.with_signal_counts(state.to_signal_counts(signal) + slope * share)

    def features(self, state: State, features: FloatArray, values: FloatArray) -> FloatArray:
        """See `Effect`."""
        if not values.any():
            return features
        added = (values**2).sum(axis=0)[self.blocks(state)]
        result = features.copy()
        drift_residual = state.layout.drift_residual
        result[:, drift_residual] = np.where(
            state.untouched, np.sqrt(features[:, drift_residual] ** 2 + added), features[:, drift_residual]
        )
        return result
