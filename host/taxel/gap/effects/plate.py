"""A plate capacitor whose gap closes: what counts say of the layer, where no force is told."""

from __future__ import annotations

from typing import Final

import numpy as np

from taxel.gap.fitting.state import Signal, State
from taxel.types import FloatArray

HALF_SHARE: Final = 0.25
"""Of full scale: counts of a gap that is half closed. No parameter: with that free it could be any law of counts. A
gap's share at full scale hangs on the layout; 0.25 lies within what free fits gave on worlds of this project's emulator
(0.24 to 0.35), chosen there and on no hardware."""

MOST_CLOSED: Final = 0.98
"""Of a gap: beyond that the counts of a plate capacitor say nothing of a sensor's."""


def closed_by(state: State, signal: Signal) -> FloatArray:
    """Share x f64[Q, K, n] by which the gap is closed where the drop, as x / (1 - x), is the signal's."""
    signal_counts = np.maximum(state.to_signal_counts(signal), 0.0)
    return np.asarray(signal_counts / (HALF_SHARE * state.full_scale + signal_counts))


def compute_signal_counts(state: State, closed: FloatArray) -> FloatArray:
    """Drops [counts] of gaps that are closed by shares f64[Q, K, n]: the inverse of `closed_by`."""
    closed = np.minimum(closed, MOST_CLOSED)
    return np.asarray(HALF_SHARE * state.full_scale * closed / (1.0 - closed))
