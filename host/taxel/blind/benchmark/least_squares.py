"""A reference diagnosis: plain least squares with the same catalogue of effects and the Bayesian information
criterion.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from taxel.gap.calibration.calibration import NO_GAP
from taxel.gap.data.pair import read_pair
from taxel.gap.data.prepare import prepare_pair
from taxel.gap.effects.catalogue import INSPECTED_EFFECTS, choose_effects
from taxel.gap.effects.dropout import Dropout
from taxel.gap.effects.dropout_inspection import find_defects
from taxel.gap.fitting.composite import CompositeModel, FittedEffect
from taxel.gap.fitting.fit import start_effect
from taxel.gap.fitting.fit_data import FitData

ITERATIONS: Final = 4
"""Iterations of each fit."""

LARGEST_SET: Final = 3
"""Largest number of effects in a set."""


def diagnose_by_least_squares(real: Path, sim: Path, seed: int) -> dict[str, float]:
    """Compute probabilities of causes from the criterion BIC = cost + p log(N) of sets of effects.

    The sets grow step by step by the effect with the smallest criterion. cost: weighted squared deviation of the fit to
    all features. p: number of parameters. N: number of pairs of taxel and condition with known features. A set has the
    weight exp(-BIC / 2) (Schwarz 1978); the probability of an effect is the relative weight of the sets that contain
    it. seed: not used.
    """
    prepared = prepare_pair(read_pair(real, sim))
    # Plain least squares: only the variance of the real sessions is considered.
    fit_data = FitData(replace(prepared.state, mean_variance=None), prepared.sessions, prepared.layout)
    catalogue = choose_effects()
    penalty = float(np.log(max(int((fit_data.weight > 0).any(axis=1).sum()), 2)))
    base, criterion = CompositeModel(), fit_data.build_problem().cost(fit_data.state.mean)
    found: dict[frozenset[str], float] = {frozenset(): criterion}
    for _ in range(LARGEST_SET):
        best = base, criterion
        for name, variants in catalogue.items():
            starts = [
                start_effect(fit_data.state, one) for one in variants if not one.find_unavailable_reason(fit_data.state)
            ]
            if name in base.names:
                continue
            # Dropout has no form that a fit can start from: it is found by inspection.
            for start in starts or _find_dropout(fit_data, base):
                fit = fit_data.fit_in_sample(base.with_effect(start), INSPECTED_EFFECTS, ITERATIONS)
                value = fit.cost + penalty * sum(one.values.size for one in fit.composite.fitted_effects)
                key = frozenset(fit.composite.names)
                found[key] = min(value, found.get(key, np.inf))
                if value < best[1]:
                    best = fit.composite, value
        if best[1] >= criterion:
            break
        base, criterion = best
    values = np.array(list(found.values()))
    weights = np.exp(-0.5 * (values - values.min()))
    weights /= weights.sum()
    shares = list(zip(found, weights, strict=True))
    probabilities = {name: float(sum(weight for key, weight in shares if name in key)) for name in catalogue}
    # The first set is the empty one, which stands for no gap.
    return {**{name: min(value, 1.0) for name, value in probabilities.items()}, NO_GAP: float(weights[0])}


def _find_dropout(fit_data: FitData, base: CompositeModel) -> list[FittedEffect]:
    """Return the effect of the taxels that do not respond as a list with one element; empty if all taxels respond.

    base: effects that are already fitted.
    """
    effect = Dropout(find_defects(fit_data.state, fit_data.sessions, base.predict_features(fit_data.state)))
    return [FittedEffect(effect, effect.make_detected_values(fit_data.state))] if effect.defects.has_any else []
