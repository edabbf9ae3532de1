"""Unloading does not retrace loading: the layer creeps under force and recovers late."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from taxel.gap.effects.effect import Array, Effect, Parameter
from taxel.gap.state import Signal, State


class Hysteresis(Effect):
    """A share `fraction` acts late, with a time constant `seconds` (a standard linear solid).

    variant "force": of the force. "drop": of the drop, as where the layer's compression creeps. "more": of the force,
    and on top of it, as where a press goes on to give way.
    """

    name = "hysteresis"
    order = 42
    memory: ClassVar[bool] = True

    def __init__(self, variant: str = "drop", scope: str = "hand") -> None:
        self.variant, self.scope = variant, scope

    def own_parameters(self) -> tuple[Parameter, ...]:
        """Late share and time constant."""
        return Parameter("fraction", "1", 0.0, 1.5, 0.0, 0.2), Parameter("seconds", "s", 0.05, 100.0, 1.0, 1.0)

    def unavailable(self, state: State) -> str:
        """See `Effect`."""
        return "" if self.variant == "drop" or state.has_force else "the simulation tells no contact force"

    def apply(self, state: State, signal: Signal, values: Array) -> Signal:
        """See `Effect`."""
        if not values[0].any():
            return signal
        fraction, seconds = self.spread_out(state, values)
        if self.variant == "drop":
            drop = state.to_drop(signal)
            return signal.with_drop((1.0 - fraction) * drop + fraction * low_pass(drop, state.since, seconds[:, 0]))
        assert signal.force is not None
        late = low_pass(signal.force, state.since, seconds[:, 0])
        keep = 1.0 if self.variant == "more" else 1.0 - fraction
        return signal.with_force(keep * signal.force + fraction * late)


def low_pass(values: Array, time_s: Array, seconds: Array) -> Array:
    """First-order low pass along nodes, from rest; each node's value holds from the node before. f64[Q, K, n]."""
    result = np.zeros_like(values)
    state = np.zeros_like(values[:, 0])
    steps = np.diff(time_s, prepend=2 * time_s[0] - time_s[1] if len(time_s) > 1 else 0.0)
    for node, step in enumerate(steps):
        share = -np.expm1(-step / np.maximum(seconds, 1e-9))
        state = state + share * (values[:, node] - state)
        result[:, node] = state
    return result
