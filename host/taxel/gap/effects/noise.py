"""Read-out noise that the simulator lacks, white and common to a line."""

from __future__ import annotations

import numpy as np

from taxel.gap.effects.effect import Effect, Parameter
from taxel.gap.fitting.state import Signal, State
from taxel.types import FloatArray


class Noise(Effect):
    """Adds variance to every taxel's counts: white, and common to lines or to the board. The mean of a few frames after
    release has its part of it.
    """

    name = "noise"
    order = 95

    def __init__(self, scope: str = "hand") -> None:
        self.scope = scope

    def own_parameters(self) -> tuple[Parameter, ...]:
        """Standard deviations."""
        return (
            Parameter("white_counts", "counts", 0.0, 3000.0, 0.0, 5.0),
            Parameter("common_counts", "counts", 0.0, 3000.0, 0.0, 2.0),
        )

    def apply(self, state: State, signal: Signal, values: FloatArray) -> Signal:
        """Drops are means: noise leaves them."""
        return signal

    def features(self, state: State, features: FloatArray, values: FloatArray) -> FloatArray:
        """See `Effect`."""
        if not values.any():
            return features
        added = (values**2).sum(axis=0)[self.blocks(state)]
        result = features.copy()
        noise = state.layout.noise
        result[:, noise] = np.sqrt(features[:, noise] ** 2 + added[:, None])
        drift_residual = state.layout.drift_residual
        mean2 = added * _share_of_mean(state)
        result[:, drift_residual] = np.where(state.untouched, np.sqrt(features[:, drift_residual] ** 2 + mean2), 0.0)
        return result


def _share_of_mean(state: State) -> float:
    """Variance of the mean drop after release over that of a frame: of so many frames, and of the baseline's."""
    clock, pair = state.clock, state.pair
    last = clock.phase == clock.phase[-1]
    after = float(np.sum((clock.end - clock.begin)[last])) / pair.frame_s
    return 1.0 / max(after, 1.0) + 1.0 / max(float(pair.real.frames.mean()), 1.0)
