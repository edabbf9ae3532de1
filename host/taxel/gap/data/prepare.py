"""Features and weights of a pair of recordings, which fits and comparisons use."""

from __future__ import annotations

import numpy as np

from taxel.gap.data.align import estimate_common_shift
from taxel.gap.data.pair import Pair
from taxel.gap.data.reading import Recording
from taxel.gap.features.features import (
    FeatureLayout,
    SessionMeans,
    compute_features,
    compute_known_mean,
    compute_session_means,
    find_unloaded_taxels,
)
from taxel.gap.features.repeat_pairs import estimate_pair_shares
from taxel.gap.fitting.fit_data import FitData
from taxel.gap.fitting.state import State, build_state
from taxel.types import FloatArray


def prepare_pair(pair: Pair) -> FitData:
    """Return the features of both recordings as the input of fits, with the simulation shifted by the common delay of
    the hand.
    """
    layout = FeatureLayout.from_time_grid(pair.time_grid)
    real = compute_recording_means(pair, pair.real, layout)
    features = compute_features(pair, pair.sim, layout, find_unloaded_taxels(pair))
    simulated = compute_session_means(features, pair.sim, len(pair.conditions), np.unique(pair.sim.session), layout)
    real = real.restrict_to_known(simulated)
    if pair.is_real_real:  # the second recording takes the place of the simulation
        real = real.with_reference_variance(simulated)
    shares = estimate_pair_shares(features, pair.sim.condition, pair.sim.iteration, layout)
    state = make_simulated_state(pair, simulated, layout, shares)
    return FitData(state.shift_time(estimate_common_shift(FitData(state, real, layout))), real, layout)


def compute_recording_means(pair: Pair, recording: Recording, layout: FeatureLayout) -> SessionMeans:
    """Return the mean features of each session of a recording, for the conditions of a pair."""
    features = compute_features(pair, recording, layout, find_unloaded_taxels(pair))
    return compute_session_means(features, recording, len(pair.conditions), np.unique(recording.session), layout)


def make_simulated_state(
    pair: Pair, simulated: SessionMeans, layout: FeatureLayout, pair_shares: FloatArray | None = None
) -> State:
    """Return the state of the simulation on which effects act.

    simulated: mean features of the simulated sessions. pair_shares: f64[5], factors on the variance of the mean for
    each family of features, from `estimate_pair_shares`; None: 1.
    """
    # With two real recordings, the floor already contains the variance of the second recording.
    variance = None if pair.is_real_real else simulated.mean_variance.copy()
    if variance is not None and pair_shares is not None:
        for family, share in zip(layout.families, pair_shares.tolist(), strict=True):
            variance[:, family] *= share
    return build_state(pair, layout, np.nan_to_num(compute_known_mean(simulated.value, 1)), variance)
