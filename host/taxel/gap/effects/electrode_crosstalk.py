"""Taxels that share a TX or RX electrode disturb each other."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array

from taxel.gap.effects.effect import Array, Effect, Parameter
from taxel.gap.state import Signal, State


class ElectrodeCrosstalk(Effect):
    """Each taxel's drop gains a fraction of the mean drop of the other taxels on its TX line, and on its RX line."""

    name = "electrode_crosstalk"
    order = 70

    def __init__(self, scope: str = "hand") -> None:
        self.scope = scope

    def parameters(self) -> tuple[Parameter, ...]:
        """Fractions of either axis."""
        return (
            Parameter("tx_fraction", "1", -1.0, 1.5, 0.0, 0.02),
            Parameter("rx_fraction", "1", -1.0, 1.5, 0.0, 0.02),
        )

    def apply(self, state: State, signal: Signal, values: Array) -> Signal:
        """See `Effect`."""
        if not values.any():
            return signal
        drop = state.to_drop(signal)
        tx, rx = self.spread_out(state, values)
        sums = state.pair.groups.sums
        return signal.with_drop(drop + tx * others_on_line(drop, sums[0]) + rx * others_on_line(drop, sums[1]))


def others_on_line(drop: Array, line: csr_array) -> Array:
    """Mean drop of the other taxels on each taxel's line, f64[Q, K, n]; 0 where it is alone."""
    flat = drop.reshape(-1, drop.shape[2])
    size = np.asarray(line.sum(axis=1)).ravel()
    total = (line.T @ (line @ flat.T)).T - flat
    others = np.maximum((line.T @ size) - 1.0, 1.0)
    return np.asarray((total / others).reshape(drop.shape))
