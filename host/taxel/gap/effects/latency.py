"""A board's frames lag the hand."""

from __future__ import annotations

from typing import ClassVar

from taxel.gap.effects.effect import BOARD, Array, Effect, Parameter
from taxel.gap.state import Signal, State, delayed


class Latency(Effect):
    """Each board's drops are those of `seconds` ago."""

    name = "latency"
    order = 90
    memory: ClassVar[bool] = True

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
