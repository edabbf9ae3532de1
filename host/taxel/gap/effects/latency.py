"""A board's frames lag the hand."""

from __future__ import annotations

import numpy as np

from taxel.gap.effects.effect import BOARD, Array, Effect, Parameter
from taxel.gap.state import Signal, State


class Latency(Effect):
    """Each board's drops are those of `seconds` ago."""

    name = "latency"
    order = 90

    def __init__(self, scope: str = BOARD) -> None:
        self.scope = scope

    def parameters(self) -> tuple[Parameter, ...]:
        """The delay."""
        return (Parameter("seconds", "s", -0.3, 1.5, 0.0, 0.05),)

    def apply(self, state: State, signal: Signal, values: Array) -> Signal:
        """See `Effect`."""
        if not values.any():
            return signal
        drop = state.to_drop(signal)
        (delay,) = self.spread_out(state, values)
        return signal.with_drop(delayed(drop, state.since, delay[:, 0]))


def delayed(drop: Array, time_s: Array, delay_s: Array) -> Array:
    """Drops f64[Q, K, n] of `delay_s` f64[Q, n] ago, linear between nodes; before the first node there was none."""
    result = drop.copy()
    own = delay_s[0] if (delay_s == delay_s[0]).all() else None  # as a rule every press has the same delays
    for value in np.unique(delay_s[delay_s != 0.0]):
        at = time_s - value
        right = np.clip(np.searchsorted(time_s, at), 0, len(time_s) - 1)
        left = np.maximum(right - 1, 0)
        gap = time_s[right] - time_s[left]
        share = np.where(gap > 0, (at - time_s[left]) / np.where(gap > 0, gap, 1.0), 1.0).clip(0.0, 1.0)[:, None]
        taxels = np.flatnonzero(own == value) if own is not None else np.arange(drop.shape[2])
        part = drop[:, :, taxels]
        moved = part[:, left] + share * (part[:, right] - part[:, left])
        moved[:, at < time_s[0] - 0.5 * (time_s[1] - time_s[0])] = 0.0
        result[:, :, taxels] = moved if own is not None else np.where((delay_s == value)[:, None, :], moved, result)
    return result
