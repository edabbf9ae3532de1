"""A board's frames lag the hand."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from taxel.gap.effects.effect import BOARD, Array, Effect, Parameter
from taxel.gap.state import Signal, State, delayed


class Latency(Effect):
    """Each board's drops are those of `seconds` ago."""

    name = "latency"
    order = 90
    memory: ClassVar[bool] = True

    def __init__(self, scope: str = BOARD) -> None:
        self.scope = scope

    def own_parameters(self) -> tuple[Parameter, ...]:
        """The delay."""
        return (Parameter("seconds", "s", -0.3, 1.5, 0.0, 0.0, 0.5),)

    def is_idle(self, state: State, values: Array) -> bool:
        """Delays that differ by less than a frame are how two solvers touch the boards; one that all touched boards
        share, within a frame and a half, is how the frames fell.
        """
        touched = state.touched_boards
        delays = values[0, touched]
        frame = state.pair.frame_s
        return len(delays) > 1 and float(np.ptp(delays)) < frame and float(np.abs(delays).max()) < 1.5 * frame

    def apply(self, state: State, signal: Signal, values: Array) -> Signal:
        """See `Effect`."""
        if not values.any():
            return signal
        drop = state.to_drop(signal)
        (delay,) = self.spread_out(state, values)
        return signal.with_drop(delayed(drop, state.since, delay[:, 0]))
