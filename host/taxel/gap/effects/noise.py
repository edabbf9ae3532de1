"""Read-out noise that the simulator lacks: white noise, and noise that a line or board has in common."""

from __future__ import annotations

import numpy as np

from taxel.gap.effects.effect import Effect, Parameter
from taxel.gap.fitting.state import Signal, State
from taxel.types import FloatArray


class Noise(Effect):
    """Additional variance of the counts of each taxel: white noise, and noise common to a line or board.

    The effect increases the noise features and the drift residual, which is a mean over few frames.
    """

    name = "noise"
    order = 95

    def __init__(self, scope: str = "hand") -> None:
        self.scope = scope

    def own_parameters(self) -> tuple[Parameter, ...]:
        """Return the parameters: standard deviations of white and of common noise, counts."""
        # name, unit, lower and upper bound, neutral value, start value
        return (
            Parameter("white_counts", "counts", 0.0, 3000.0, 0.0, 5.0),
            Parameter("common_counts", "counts", 0.0, 3000.0, 0.0, 2.0),
        )

    def apply(self, state: State, signal: Signal, values: FloatArray) -> Signal:
        """Return the signal itself: noise does not change mean signals."""
        return signal

    def apply_to_features(self, state: State, features: FloatArray, values: FloatArray) -> FloatArray:
        """Return the features with the variances of the noise added: to both noise features and the drift residual.

        Both noise features are standard deviations of one taxel; white and common noise contribute to both. The drift
        residual is defined on unloaded taxels; it is 0 on loaded ones. features: f64[C, F, n] (C conditions, F
        features, n taxels), returned themselves if all values are 0. values: f64[2, G], white and common standard
        deviation of each of G blocks (the hand, or each board, object or taxel), counts.
        """
        if not values.any():
            return features
        added = (values**2).sum(axis=0)[self.find_blocks(state)]
        result = features.copy()
        noise = state.layout.noise
        result[:, noise] = np.sqrt(features[:, noise] ** 2 + added[:, None])
        drift_residual = state.layout.drift_residual
        mean_variance = added * _compute_variance_ratio(state)
        result[:, drift_residual] = np.where(
            state.is_unloaded, np.sqrt(features[:, drift_residual] ** 2 + mean_variance), 0.0
        )
        return result


def _compute_variance_ratio(state: State) -> float:
    """Return the variance of the mean signal in the last phase divided by the variance of one frame.

    The ratio includes the variance of the mean baseline, because the signal is the baseline minus the raw count.
    """
    time_grid, pair = state.time_grid, state.pair
    last = time_grid.phase == time_grid.phase[-1]
    frames_in_phase = float(np.sum((time_grid.end - time_grid.begin)[last])) / pair.frame_s
    return 1.0 / max(frames_in_phase, 1.0) + 1.0 / max(float(pair.real.baseline_frames.mean()), 1.0)
