"""From a pair of recordings to the features and weights that are compared."""

from __future__ import annotations

import numpy as np

from taxel.gap.data.align import common_shift
from taxel.gap.data.pair import Pair
from taxel.gap.data.reading import Recording
from taxel.gap.features.features import (
    Layout,
    SessionMeans,
    features_of,
    known_mean,
    session_means,
    untouched_conditions,
)
from taxel.gap.fitting.judge import Judge
from taxel.gap.fitting.state import State, state_of


def prepared(pair: Pair) -> Judge:
    """Reduce both sides to features, and move the simulator's to the hand's time."""
    layout = Layout.of(pair.clock)
    real = means_of(pair, pair.real, layout)
    simulated = means_of(pair, pair.sim, layout)
    real = real.known_beside(simulated)
    if pair.is_real_real:
        real = real.with_reference_variance(simulated)
    state = simulated_state(pair, simulated, layout)
    return Judge(state.shifted(common_shift(Judge(state, real, layout))), real, layout)


def means_of(pair: Pair, recording: Recording, layout: Layout) -> SessionMeans:
    """Features of a recording's sessions, of a pair's cells."""
    features = features_of(pair, recording, layout, untouched_conditions(pair))
    return session_means(features, recording, len(pair.conditions), np.unique(recording.session), layout)


def simulated_state(pair: Pair, simulated: SessionMeans, layout: Layout) -> State:
    """What effects act on."""
    # The variance of a reference is a part of the floor already.
    variance = None if pair.is_real_real else simulated.mean_variance
    return state_of(pair, layout, np.nan_to_num(known_mean(simulated.value, 1)), variance)
