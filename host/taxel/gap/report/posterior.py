"""Samples from the posterior of the fitted values, linearised about the fit.

Some parameters hardly change the recorded features, such as the translation of an object along a flat face. All fits of
a jackknife then end at the same value, which the prior determines, and the jackknife interval is too narrow. The
posterior samples show the range that the data permit.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from scipy.linalg import cholesky, solve_triangular

from taxel.gap.effects.baseline_drift import BaselineDrift
from taxel.gap.effects.noise import Noise
from taxel.gap.fitting.composite import CompositeModel, FittedEffect
from taxel.gap.fitting.equations import build_normal_matrix
from taxel.gap.fitting.fit import apply_step, find_free_indices, linearise
from taxel.gap.fitting.fit_data import FitData

VARIANCE_EFFECTS: Final = (Noise.name, BaselineDrift.name)
"""Effects with a standard deviation as parameter, which are not sampled: the linearisation fails at the value 0. Their
intervals rest on the jackknife."""

SAMPLE_COUNT: Final = 400
"""Number of samples from the posterior. Chosen: 95 % quantiles then rest on ten samples at each end."""

SEED: Final = 20
"""Fixed seed of the samples, so that a report is reproducible."""

JITTER: Final = 1e-9
"""Number added to the unit diagonal of the scaled normal equations, so that the Cholesky factorisation succeeds for a
singular matrix."""


def sample_posterior(
    fit_data: FitData, composite: CompositeModel, fixed: Sequence[str]
) -> dict[str, list[FittedEffect]]:
    """Sample the fitted effects from the linearised posterior: `SAMPLE_COUNT` samples of each effect, by name of the
    effect.

    composite: fitted model. fixed: names of effects that are not sampled, in addition to `VARIANCE_EFFECTS`. The errors
    of the features are treated as independent, with the inverse weights of `FitData` as variances. In addition to its
    prior, each parameter has a weak normal prior, whose standard deviation is the width of the parameter's range.
    Sampled values are clipped to the parameter's bounds. The result is empty if no effect is sampled.
    """
    fixed = (*fixed, *VARIANCE_EFFECTS)
    free = find_free_indices(composite, fixed)
    if not free:
        return {}
    start = linearise(fit_data.state, composite, fixed)
    system = build_normal_matrix(fit_data.build_problem(), start.columns)
    fitted_effects = [composite.fitted_effects[index] for index in free]
    bound_precisions = [
        np.full(fitted_effect.values.shape[1], (one.high - one.low) ** -2)
        for fitted_effect in fitted_effects
        for one in fitted_effect.effect.parameters()
    ]
    system[np.diag_indices_from(system)] += np.concatenate(bound_precisions)
    scale = np.sqrt(np.diag(system))
    scaled = system / np.outer(scale, scale)
    scaled[np.diag_indices_from(scaled)] += JITTER
    # With the scaled posterior precision U^T U and standard normal numbers z, U^-1 z has the posterior covariance.
    normal = np.random.default_rng(SEED).standard_normal((len(scaled), SAMPLE_COUNT))
    steps = solve_triangular(cholesky(scaled, lower=False, check_finite=False), normal) / scale[:, None]
    samples = [apply_step(composite, free, step) for step in steps.T]
    return {
        composite.fitted_effects[index].effect.name: [one.fitted_effects[index] for one in samples] for index in free
    }
