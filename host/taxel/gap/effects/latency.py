"""A board's frames lag the hand."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from taxel.gap.effects.effect import BOARD, Effect, Parameter
from taxel.gap.effects.lag import low_pass
from taxel.gap.fitting.state import Signal, State, delayed
from taxel.types import FloatArray


class Latency(Effect):
    """variant "delay": each board's drops are those of `seconds` ago. "lag": they follow with a time constant
    `seconds`, as behind a filter.
    """

    name = "latency"
    order = 90
    memory: ClassVar[bool] = True

    def __init__(self, scope: str = BOARD, variant: str = "delay") -> None:
        self.scope, self.variant = scope, variant

    def own_parameters(self) -> tuple[Parameter, ...]:
        """The delay, or the time constant: no filter answers before it is asked."""
        least = 0.0 if self.variant == "lag" else -0.3
        return (Parameter("seconds", "s", least, 1.5, 0.0, 0.0, 0.5),)

    def is_idle(self, state: State, values: FloatArray) -> bool:
        """Delays that differ by less than a frame are how two solvers touch the boards; one that all touched boards
        share, within a frame and a half, is how the frames fell.
        """
        touched = state.touched_boards
        delays = values[0, touched]
        frame = state.pair.frame_s
        return len(delays) > 0 and float(np.ptp(delays)) < frame and float(np.abs(delays).max()) < 1.5 * frame

    def apply(self, state: State, signal: Signal, values: FloatArray) -> Signal:
        """See `Effect`."""
        if not values.any():
            return signal
        signal_counts = state.to_signal_counts(signal)
        (delay,) = self.spread_out(state, values)
        if self.variant == "lag":
            return signal.with_signal_counts(low_pass(signal_counts, state.since, delay[:, 0]))
        return signal.with_signal_counts(delayed(signal_counts, state.since, delay[:, 0]))


def is_delay(effect: Effect) -> bool:
    """Whether an effect's seconds are a plain delay, which counts from where the clocks were aligned."""
    return effect.name == Latency.name and effect.variant == "delay"
