"""Trend of the values of taxels or boards with their load: a property of the skin has none.

The gain of a taxel is a property of the taxel. If fitted gains decrease with the load, they imitate another effect,
such as a saturation.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.stats import linregress

from taxel.gap.effects.effect import HAND, OBJECT
from taxel.gap.fitting.composite import FittedEffect
from taxel.gap.fitting.state import State
from taxel.types import FloatArray

LOADED_COUNTS: Final = 150.0
"""Largest simulated signal from which a block counts: below it, its value is hardly determined. Limit of an active
taxel."""

FEWEST_BLOCKS: Final = 8
"""Loaded blocks that a trend needs."""


def compute_load_trend(state: State, link: FittedEffect) -> float:
    """Largest t value, in size, of the regression of fitted values on the logarithm of the load of their blocks.

    The load of a block is the largest simulated signal of its taxels. 0 for an effect whose values may depend on the
    load, for one value of the whole hand or of an object, and for too few loaded blocks.
    """
    if not link.effect.is_load_independent or link.effect.scope in (HAND, OBJECT):
        return 0.0
    load = _compute_loads(state, link)
    is_loaded = load > LOADED_COUNTS
    if is_loaded.sum() < FEWEST_BLOCKS:
        return 0.0
    trends = [0.0]
    for values in link.values:
        fit = linregress(np.log(load[is_loaded]), values[is_loaded])
        if fit.stderr > 0.0:
            trends.append(abs(fit.slope / fit.stderr))
    return float(max(trends))


def _compute_loads(state: State, link: FittedEffect) -> FloatArray:
    """Largest simulated signal of each block, f64[G] counts."""
    signal = np.abs(state.mean[:, : state.layout.bins]).max(axis=1)
    load = np.zeros(link.values.shape[1])
    np.maximum.at(load, link.effect.blocks(state).ravel(), signal.ravel())
    return load
