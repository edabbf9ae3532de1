"""A layer that sticks: it is let go at another depth than that at which it was pressed, and it creeps for long."""

from __future__ import annotations

from functools import lru_cache
from typing import ClassVar, Final

import numpy as np

from taxel.gap.effects.effect import Effect, Parameter
from taxel.gap.effects.hysteresis import Hysteresis
from taxel.gap.effects.lag import low_pass
from taxel.gap.effects.plate import closed_by, compute_signal_counts
from taxel.gap.fitting.state import Signal, State
from taxel.types import FloatArray

CREEP_PRIOR: Final = 0.3
"""Expected creep a decade of time."""

STUCK_SHARE: Final = 0.3
"""Of the way, what friction holds back. No parameter: a wider play of a smaller share is almost the same. Chosen on
opened worlds of this project's emulator, and on no hardware."""

STEP_DECADES: Final = 0.5
TIMES_S: Final = 10.0 ** np.arange(-1.5, 2.0, STEP_DECADES)
"""Time constants of what creeps: from a frame to far beyond a grasp."""

AT_ONCE_S: Final = 0.1
"""At that age of a load, creep changes nothing: about a frame, in which a simulator without memory has it all."""

WORKED_OUT: Final = ("fraction", "seconds")
"""Parameters of the other forms, told beside its own: see `as_late`."""


class Sticking(Effect):
    """A form of `Hysteresis`, "sticks": the closed share of a plate capacitor's gap falls behind by up to `play` while
    it grows and is let go only when the load has fallen as far below it, at any speed (Prandtl's play); and of what is
    closed a share `creep` comes in every decade of time, as elastomers creep: with the logarithm of time.
    """

    name = Hysteresis.name
    order = Hysteresis.order
    memory: ClassVar[bool] = True
    variant = "sticks"

    def own_parameters(self) -> tuple[Parameter, ...]:
        """Width of the play, and creep a decade."""
        creep = Parameter("creep", "1", 0.0, 1.0, 0.0, 0.05, CREEP_PRIOR)
        return Parameter("play", "1", 0.0, 1.0, 0.0, 0.05), creep

    def apply(self, state: State, signal: Signal, values: FloatArray) -> Signal:
        """See `Effect`."""
        if not values.any():
            return signal
        play, creep = self.spread_out(state, values)
        closed = closed_by(state, signal)
        closed = closed + STUCK_SHARE * (stuck(closed, play[:, 0] / STUCK_SHARE) - closed)
        return signal.with_signal_counts(compute_signal_counts(state, crept(closed, state.since, creep)))


def as_late(values: FloatArray, frame_s: float, lasts_s: float) -> tuple[float, float]:
    """In the words of the other forms: the share that comes between a frame and the end of the record, and the seconds
    by which half of that has come. values: of the parameters, f64[2, 1].
    """
    return float(values[1, 0]) * float(np.log10(lasts_s / frame_s)), float(np.sqrt(frame_s * lasts_s))


def stuck(values: FloatArray, width: FloatArray) -> FloatArray:
    """What follows values f64[Q, K, n] >= 0 along K with a play: it lags by up to width f64[Q, n] while they grow, and
    stays while they fall to it.
    """
    result = np.empty_like(values)
    held = np.zeros_like(values[:, 0])
    for node in range(values.shape[1]):
        now = values[:, node]
        held = np.clip(held, np.maximum(now - width, 0.0), now)
        result[:, node] = held
    return result


def crept(values: FloatArray, time_s: FloatArray, creep: FloatArray) -> FloatArray:
    """Of values f64[Q, K, n] at times f64[K]: to a step, 1 + creep log10(t / AT_ONCE_S). creep: f64, of each value.

    A sum of first-order lags is linear in the values: one matrix for all of them.
    """
    return np.asarray(values + creep * (_creep_a_decade(tuple(time_s.tolist())) @ values))


@lru_cache(maxsize=8)
def _creep_a_decade(time_s: tuple[float, ...]) -> FloatArray:
    """Matrix f64[K, K]: what comes of values at nodes of time, with a creep of 1."""
    times, one = np.array(time_s), np.eye(len(time_s))
    late = np.expm1(-AT_ONCE_S / TIMES_S).sum() * one
    for constant in TIMES_S:
        late += low_pass(one[:, :, None], times, np.full((1, 1), constant))[:, :, 0].T
    return np.asarray(STEP_DECADES * late)
