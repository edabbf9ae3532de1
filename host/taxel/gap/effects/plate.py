"""Plate capacitor whose gap closes: a model of the layer for simulations without contact forces."""

from __future__ import annotations

from typing import Final

import numpy as np

from taxel.gap.fitting.state import Signal, State
from taxel.types import FloatArray

HALF_CLOSED_SHARE: Final = 0.25
"""Signal at a half closed gap, as a share of the full scale. It is not a parameter, because the effect could then fit
any law of counts. Selected on worlds of the emulator, where free fits gave 0.24 to 0.35; not verified on hardware."""

MAX_CLOSED_SHARE: Final = 0.98
"""Largest closed share of a gap. Chosen: beyond it the signal of the plate model diverges, unlike that of a sensor."""


def compute_closed_share(state: State, signal: Signal) -> FloatArray:
    """Return the closed share x of the gap, f64[Q, K, n] (Q simulated contacts, K time nodes, n taxels), at which the
    plate model has the given signal.

    The signal of the model is `HALF_CLOSED_SHARE` times the full scale times x / (1 - x), with x from 0 (open) to 1
    (closed). Negative signals are treated as 0.
    """
    signal_counts = np.maximum(state.to_signal_counts(signal), 0.0)
    return np.asarray(signal_counts / (HALF_CLOSED_SHARE * state.full_scale + signal_counts))


def compute_signal_counts(state: State, closed: FloatArray) -> FloatArray:
    """Return the signal in counts, f64[Q, K, n] (Q simulated contacts, K time nodes, n taxels), of gaps with the closed
    shares `closed`, f64[Q, K, n].

    This is the inverse of `compute_closed_share` up to `MAX_CLOSED_SHARE`.
    """
    closed = np.minimum(closed, MAX_CLOSED_SHARE)
    return np.asarray(HALF_CLOSED_SHARE * state.full_scale * closed / (1.0 - closed))
