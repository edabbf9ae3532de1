"""What follows late: a first-order low pass of values at nodes of time."""

from __future__ import annotations

import numpy as np

from taxel.types import FloatArray

LEAST_S = 1e-6


def low_pass(values: FloatArray, time_s: FloatArray, seconds: FloatArray) -> FloatArray:
    """Of values f64[Q, K, n] that are linear between nodes time_s f64[K], from rest; seconds: f64[Q, n], its time
    constants.

    Over a step h of values from a to b a lag goes from y to b - (b - a) (1 - e^-x) / x + (y - a) e^-x, x = h / seconds
    (the solution of seconds dy/dt = value - y).
    """
    result = np.empty_like(values)
    constants = np.maximum(seconds, LEAST_S)
    if (constants == constants.flat[0]).all():
        constants = constants[:1, :1]  # as a rule it holds for the whole hand: one exponential a node
    before = behind = np.zeros_like(values[:, 0])
    steps = np.diff(time_s, prepend=2 * time_s[0] - time_s[1] if len(time_s) > 1 else -1.0)
    for node, step in enumerate(steps):
        x = step / constants
        now = values[:, node]
        behind = now + (now - before) * np.expm1(-x) / x + (behind - before) * np.exp(-x)
        result[:, node], before = behind, now
    return result
