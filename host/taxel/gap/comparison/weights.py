"""Weights of candidate sets: pseudo Bayesian model averaging with a bootstrap over the conditions."""

from collections.abc import Sequence

import numpy as np

from taxel.gap.comparison.settings import ComparisonSettings
from taxel.types import FloatArray


def compute_set_weights(
    density: FloatArray,
    sizes: Sequence[int],
    settings: ComparisonSettings,
    seed: int = 0,
    log_prior: Sequence[float] | None = None,
) -> FloatArray:
    """Compute the weight of each of m sets of effects, f64[m]; the weights add up to 1.

    density: f64[m, C] (C conditions), held-out log density of each set in each condition. The conditions are the
    independent units: their weights are sampled from a Dirichlet distribution (Bayesian bootstrap, Rubin 1981), and the
    weights of the sets are averaged over the samples (Yao et al. 2018). sizes: number of effects of each set; every
    effect has the prior odds of the settings. seed: seed of the samples. log_prior: log prior of the forms and
    parameters of each set; None: 0.
    """
    conditions = density.shape[1]
    samples = np.random.default_rng(seed).dirichlet(np.ones(conditions), settings.bootstrap_samples) * conditions
    priors = np.log(settings.prior_odds) * np.asarray(sizes, np.float64)
    if log_prior is not None:
        priors = priors + np.asarray(log_prior, np.float64)
    values = samples @ density.T + priors
    values -= values.max(axis=1, keepdims=True)
    weights = np.exp(values)
    return np.asarray((weights / weights.sum(axis=1, keepdims=True)).mean(axis=0))
