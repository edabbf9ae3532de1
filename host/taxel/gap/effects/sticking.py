"""Sticking, a form of hysteresis: the layer has a play between loading and unloading, and creeps logarithmically."""

from __future__ import annotations

from functools import lru_cache
from typing import ClassVar, Final

import numpy as np

from taxel.gap.effects.effect import Effect, Parameter
from taxel.gap.effects.hysteresis import Hysteresis
from taxel.gap.effects.lag import apply_low_pass
from taxel.gap.effects.plate import compute_closed_share, compute_signal_counts
from taxel.gap.fitting.state import Signal, State
from taxel.types import FloatArray

CREEP_PRIOR_STD: Final = 0.3
"""Prior standard deviation, about 0, of the creep per decade of time as a share of the closing."""

FRICTION_SHARE: Final = 0.3
"""Share of the closing on which friction acts. It is not a parameter, because a wider play of a smaller share is almost
equivalent. Selected on worlds of the emulator; not verified on hardware."""

STEP_DECADES: Final = 0.5
"""Ratio of successive time constants of the creep, decades."""

TIME_CONSTANTS_S: Final = 10.0 ** np.arange(-1.5, 2.0, STEP_DECADES)
"""Time constants of the creep, seconds. Chosen: from one frame period to far beyond the duration of a grasp."""

CREEP_START_S: Final = 0.1
"""Time after a load step at which the creep is 0, seconds. Chosen: about one frame period, after which a simulator
without creep has the complete signal."""

DERIVED_PARAMETERS: Final = ("fraction", "seconds")
"""Parameters of the other forms of hysteresis, which are reported in addition: see `convert_to_lag_parameters`."""


class Sticking(Effect):
    """The form `sticks` of `Hysteresis`: play and logarithmic creep of the closed share of a plate capacitor's gap.

    Play operator (Prandtl): while the load increases, the closed share lags by up to `play`; while the load decreases,
    the closed share remains constant until the lag is used up. The result does not depend on the speed. Creep: with
    each decade of time the closed share increases by the share `creep`, as in elastomers.
    """

    name = Hysteresis.name
    order = Hysteresis.order
    memory: ClassVar[bool] = True
    variant = "sticks"

    def own_parameters(self) -> tuple[Parameter, ...]:
        """Return the parameters: width of the play, and creep per decade of time, as shares of the closing."""
        creep = Parameter("creep", "1", 0.0, 1.0, 0.0, 0.05, CREEP_PRIOR_STD)
        return Parameter("play", "1", 0.0, 1.0, 0.0, 0.05), creep

    def apply(self, state: State, signal: Signal, values: FloatArray) -> Signal:
        """Return the signal with play and creep of the closed share; `signal` itself if all values are 0. values:
        f64[2, G], play and creep of each of G blocks (the hand, or each board, object or taxel).
        """
        if not values.any():
            return signal
        play, creep = self.spread_out(state, values)
        closed = compute_closed_share(state, signal)
        closed = closed + FRICTION_SHARE * (apply_play(closed, play[:, 0] / FRICTION_SHARE) - closed)
        return signal.with_signal_counts(compute_signal_counts(state, apply_creep(closed, state.node_times_s, creep)))


def convert_to_lag_parameters(values: FloatArray, frame_s: float, duration_s: float) -> tuple[float, float]:
    """Return the parameters `fraction` and `seconds` of the other forms of hysteresis that correspond to a creep.

    The fraction is the creep between one frame period and the end of the record. The creep is logarithmic in time, so
    half of this fraction is reached at the geometric mean of both times, `seconds`. values: play and creep, f64[2, 1].
    frame_s: frame period, seconds. duration_s: duration of the record, seconds.
    """
    return float(values[1, 0]) * float(np.log10(duration_s / frame_s)), float(np.sqrt(frame_s * duration_s))


def apply_play(values: FloatArray, width: FloatArray) -> FloatArray:
    """Return the output of a play operator (mechanical backlash) along the time nodes, f64[Q, K, n] (Q simulated
    contacts, K time nodes, n taxels).

    values: input f64[Q, K, n], at least 0. width: width of the play, f64[Q, n]. The output lags increasing values by up
    to `width`, and remains constant until decreasing values reach it.
    """
    result = np.empty_like(values)
    output = np.zeros_like(values[:, 0])
    for node in range(values.shape[1]):
        node_values = values[:, node]
        output = np.clip(output, np.maximum(node_values - width, 0.0), node_values)
        result[:, node] = output
    return result


def apply_creep(values: FloatArray, time_s: FloatArray, creep: FloatArray) -> FloatArray:
    """Return values with logarithmic creep, f64[Q, K, n] (Q simulated contacts, K time nodes, n taxels); a step becomes
    1 + creep log10(t / `CREEP_START_S`).

    values: f64[Q, K, n]. time_s: f64[K]. creep: per decade, broadcast over values. The creep is a sum of first-order
    lags, which is linear in the values and therefore one matrix.
    """
    return np.asarray(values + creep * (_compute_creep_matrix(tuple(time_s.tolist())) @ values))


@lru_cache(maxsize=8)
def _compute_creep_matrix(time_s: tuple[float, ...]) -> FloatArray:
    """Return the matrix f64[K, K] (K time nodes) from values at the nodes to their additional creep, for the creep 1
    per decade.
    """
    times, identity = np.array(time_s), np.eye(len(time_s))
    # The response of the lags at the age `CREEP_START_S` is subtracted, so that the creep is 0 at this age.
    creep = np.expm1(-CREEP_START_S / TIME_CONSTANTS_S).sum() * identity
    for constant in TIME_CONSTANTS_S:
        creep += apply_low_pass(identity[:, :, None], times, np.full((1, 1), constant))[:, :, 0].T
    return np.asarray(STEP_DECADES * creep)
