"""First-order low-pass filter of values at nodes of time."""

from __future__ import annotations

import numpy as np

from taxel.types import FloatArray

MIN_TIME_CONSTANT_S = 1e-6
"""Smallest time constant, seconds. Chosen: far below a frame period; it avoids a division by zero."""


def apply_low_pass(values: FloatArray, time_s: FloatArray, seconds: FloatArray) -> FloatArray:
    """Return values f64[Q, K, n] (Q simulated contacts, K time nodes, n taxels) after a first-order low-pass filter
    that starts at rest (0).

    values: f64[Q, K, n], linear between the nodes. time_s: f64[K], times of the nodes. seconds: f64[Q, n], time
    constants, or f64[1, 1]. While the input changes linearly from a to b within the time h, the output changes from y
    to b - (b - a) (1 - e^-x) / x + (y - a) e^-x with x = h / seconds, the solution of seconds dy/dt = input - y.
    """
    result = np.empty_like(values)
    constants = np.maximum(seconds, MIN_TIME_CONSTANT_S)
    if (constants == constants.flat[0]).all():
        constants = constants[:1, :1]  # the usual case, one value for the hand: one exponential for each node
    last_input = output = np.zeros_like(values[:, 0])
    steps = np.diff(time_s, prepend=2 * time_s[0] - time_s[1] if len(time_s) > 1 else -1.0)
    for node, step in enumerate(steps):
        x = step / constants
        node_input = values[:, node]
        output = node_input + (node_input - last_input) * np.expm1(-x) / x + (output - last_input) * np.exp(-x)
        result[:, node], last_input = output, node_input
    return result
