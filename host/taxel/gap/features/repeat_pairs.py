"""Variance of the mean of simulated repeats, if the variation of two successive repeats cancels in their mean."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taxel.gap.features.features import FeatureLayout
from taxel.types import FloatArray

MIN_PAIRS = 2
"""Smallest number of pairs of a condition from which a variance between pairs follows."""


def estimate_pair_shares(
    features: NDArray[np.float32], condition: NDArray[np.intp], iteration: NDArray[np.int64], layout: FeatureLayout
) -> FloatArray:
    """Return the ratio of two estimates of the variance of the mean over simulated repeats, f64[5], for each family of
    features (`FeatureLayout.families`): the estimate from pairs of repeats divided by the estimate from single repeats.

    features: f32[R, F, n] (R simulated grasps, F features, n taxels), counts; NaN where unknown. condition: [R].
    iteration: i64[R], number of the repeat.

    The repeats 2 k and 2 k + 1 of a condition form a pair. The estimate from the means of pairs is unbiased (method of
    batch means, Conway 1963) for random repeats, where the ratio is about 1. It is also unbiased if the deviations of
    both repeats of a pair were planned to be opposite, where the ratio is below 1. The ratio is pooled over all
    conditions, features of the family and taxels, because few pairs estimate a variance poorly. The ratio is 1 if no
    condition has two pairs.
    """
    single = np.zeros(features.shape[1:])
    paired = np.zeros(features.shape[1:])
    for number in np.unique(condition):
        rows = np.flatnonzero(condition == number)
        pairs = [rows[iteration[rows] // 2 == pair] for pair in np.unique(iteration[rows] // 2)]
        complete = np.array([pair for pair in pairs if len(pair) == 2], np.intp)
        if len(complete) < MIN_PAIRS:
            continue
        values = features[complete].astype(np.float64)
        pair_variance = values.mean(axis=1).var(axis=0, ddof=1) / len(complete)
        own_variance = values.reshape(-1, *values.shape[2:]).var(axis=0, ddof=1) / (2 * len(complete))
        known = np.isfinite(pair_variance) & np.isfinite(own_variance)
        paired += np.where(known, pair_variance, 0.0)
        single += np.where(known, own_variance, 0.0)
    shares = np.ones(len(layout.families))
    for index, family in enumerate(layout.families):
        weight = layout.weight[family]
        total = float((weight @ single[family]).sum())
        if total > 0.0:
            shares[index] = float((weight @ paired[family]).sum()) / total
    return shares
