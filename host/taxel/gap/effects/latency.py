"""Latency: the frames of a board are late."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from taxel.gap.effects.effect import BOARD, Effect, Parameter
from taxel.gap.effects.lag import apply_low_pass
from taxel.gap.fitting.state import Signal, State, delay_values
from taxel.types import FloatArray


class Latency(Effect):
    """Latency of each board.

    variant `delay`: the signals of a board are delayed by `seconds`. `lag`: they pass a first-order low-pass filter
    with the time constant `seconds`.
    """

    name = "latency"
    order = 90
    memory: ClassVar[bool] = True

    def __init__(self, scope: str = BOARD, variant: str = "delay") -> None:
        self.scope, self.variant = scope, variant

    def own_parameters(self) -> tuple[Parameter, ...]:
        """Return the parameter: delay or time constant in seconds. Only a delay can be negative."""
        low = 0.0 if self.variant == "lag" else -0.3
        return (Parameter("seconds", "s", low, 1.5, 0.0, 0.0, 0.5),)

    def is_idle(self, state: State, values: FloatArray) -> bool:
        """Return whether the delays of the loaded boards are within the resolution of the frames; False without loaded
        boards.

        values: f64[1, G], delays in seconds of G boards. Two conditions must be met. The differences between the delays
        are below one frame period; such small differences can arise from different contact solvers. The magnitude of
        each delay is below 1.5 frame periods; such a delay of all boards can arise from the times at which the frames
        were recorded.
        """
        loaded = state.loaded_boards
        delays = values[0, loaded]
        frame = state.pair.frame_s
        return len(delays) > 0 and float(np.ptp(delays)) < frame and float(np.abs(delays).max()) < 1.5 * frame

    def apply(self, state: State, signal: Signal, values: FloatArray) -> Signal:
        """Return the delayed signal, or in the form `lag` the low-pass filtered signal; `signal` itself if all values
        are 0. values: f64[1, G], delay or time constant in seconds of each of G blocks (the hand, or each board, object
        or taxel).
        """
        if not values.any():
            return signal
        signal_counts = state.to_signal_counts(signal)
        (delay,) = self.spread_out(state, values)
        if self.variant == "lag":
            return signal.with_signal_counts(apply_low_pass(signal_counts, state.node_times_s, delay[:, 0]))
        return signal.with_signal_counts(delay_values(signal_counts, state.node_times_s, delay[:, 0]))


def is_delay(effect: Effect) -> bool:
    """Return whether an effect is a latency of the form "delay".

    Its delays are relative to the simulation after the time alignment, not to the recorded times.
    """
    return effect.name == Latency.name and effect.variant == "delay"
