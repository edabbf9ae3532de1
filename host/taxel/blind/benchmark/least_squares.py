"""A reference diagnosis: plain least squares over the same catalogue, with the Bayesian information criterion."""

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
LARGEST_SET: Final = 3


def diagnose_by_least_squares(real: Path, sim: Path, seed: int) -> dict[str, float]:
    """Probabilities from the criterion BIC = cost + p log(N) of sets that are built step by step.

    cost: weighted squared deviation of the fit to all features. p: number of parameters. N: number of taxels and
    conditions with known features. A set has the weight exp(-BIC / 2) (Schwarz 1978), and an effect the sum of the
    weights of its sets. seed: not used.
    """
    own = prepare_pair(read_pair(real, sim))
    # Plain least squares: only the real sessions vary.
    fit_data = FitData(replace(own.state, mean_variance=None), own.sessions, own.layout)
    catalogue = choose_effects()
    penalty = float(np.log(max(int((fit_data.weight > 0).any(axis=1).sum()), 2)))
    base, criterion = CompositeModel(), fit_data.build_problem().cost(fit_data.state.mean)
    found: dict[frozenset[str], float] = {frozenset(): criterion}
    for _ in range(LARGEST_SET):
        best = base, criterion
        for name, variants in catalogue.items():
            links = [
                start_effect(fit_data.state, one) for one in variants if not one.find_unavailable_reason(fit_data.state)
            ]
            if name in base.names:
                continue
            for link in links or _find_dropout(fit_data, base):
                fit = fit_data.fit_in_sample(base.with_effect(link), INSPECTED_EFFECTS, ITERATIONS)
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
    return {**{name: min(value, 1.0) for name, value in probabilities.items()}, NO_GAP: float(weights[0])}


def _find_dropout(fit_data: FitData, base: CompositeModel) -> list[FittedEffect]:
    """The taxels that do not respond, as an effect; none if all respond."""
    effect = Dropout(find_defects(fit_data.state, fit_data.sessions, base.predict_features(fit_data.state)))
    return [FittedEffect(effect, effect.make_detected_values(fit_data.state))] if effect.defects.has_any else []
