"""Trend of fitted values of taxels or boards with their load.

A property of the skin, such as the gain of a taxel, does not depend on the load. If fitted gains decrease
with the load, they imitate another effect, such as a saturation.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from taxel.gap.effects.effect import HAND, OBJECT
from taxel.gap.fitting.composite import FittedEffect
from taxel.gap.fitting.state import State
from taxel.types import FloatArray

LOADED_COUNTS: Final = 150.0
"""Largest simulated signal in counts from which a block enters the trend: the limit of an active taxel. The value of a
block with a smaller signal is poorly determined."""

MIN_BLOCKS: Final = 8
"""Smallest number of loaded blocks for a trend (chosen)."""


def compute_load_trend(state: State, fitted_effect: FittedEffect) -> float:
    """Compute the largest absolute t value of the regressions of fitted values on the logarithm of the load.

    Each parameter has one regression over its loaded blocks (boards or taxels with a value of their own). The load of a
    block is the largest simulated signal of its taxels. The result is 0 for an effect whose values may depend on the
    load, for a value of the whole hand or of an object, and with fewer than `MIN_BLOCKS` loaded blocks.
    """
    if not fitted_effect.effect.is_load_independent or fitted_effect.effect.scope in (HAND, OBJECT):
        return 0.0
    loads = _compute_loads(state, fitted_effect)
    is_loaded = loads > LOADED_COUNTS
    if is_loaded.sum() < MIN_BLOCKS:
        return 0.0
    log_loads = np.log(loads[is_loaded])
    return max(compute_slope_t(log_loads, values[is_loaded]) for values in fitted_effect.values)


def compute_slope_t(x: FloatArray, y: FloatArray) -> float:
    """Compute the absolute t value of the slope of a regression of y f64[m] on x f64[m]: slope divided by its standard
    error. 0 if the line fits exactly, or if all x are equal.
    """
    x, y = x - x.mean(), y - y.mean()
    square = float(x @ x)
    slope = float(x @ y) / square if square > 0.0 else 0.0
    variance = float(np.sum((y - slope * x) ** 2)) / (len(x) - 2)
    return abs(slope) * math.sqrt(square / variance) if variance > 0.0 else 0.0


def _compute_loads(state: State, fitted_effect: FittedEffect) -> FloatArray:
    """Return the largest simulated signal of the taxels of each of the G blocks of an effect, f64[G], counts."""
    signal = np.abs(state.mean[:, : state.layout.bins]).max(axis=1)
    loads = np.zeros(fitted_effect.values.shape[1])
    np.maximum.at(loads, fitted_effect.effect.find_blocks(state).ravel(), signal.ravel())
    return loads
