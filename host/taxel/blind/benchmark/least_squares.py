"""A reference diagnosis: plain least squares over the same catalogue, with the Bayesian information criterion."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from taxel.gap.calibration.calibration import NO_GAP
from taxel.gap.data.pair import read_pair
from taxel.gap.data.prepare import prepared
from taxel.gap.effects.catalogue import FIXED, chosen
from taxel.gap.effects.dropout import Dropout
from taxel.gap.effects.dropped import find_dropped
from taxel.gap.fitting.composite import CompositeModel, FittedEffect
from taxel.gap.fitting.fit import started
from taxel.gap.fitting.judge import Judge

ITERATIONS: Final = 4
LARGEST_SET: Final = 3


def diagnose_by_least_squares(real: Path, sim: Path, seed: int) -> dict[str, float]:
    """Probabilities from the criterion BIC = cost + p log(N) of sets that are built step by step.

    cost: weighted squared deviation of the fit to all features. p: number of parameters. N: number of taxels and
    conditions with known features. A set has the weight exp(-BIC / 2) (Schwarz 1978), and an effect the sum of the
    weights of its sets. seed: not used.
    """
    own = prepared(read_pair(real, sim))
    # Plain least squares: only the real sessions vary.
    judge = Judge(replace(own.state, mean_variance=None), own.sessions, own.layout)
    catalogue = chosen()
    penalty = float(np.log(max(int((judge.weight > 0).any(axis=1).sum()), 2)))
    base, criterion = CompositeModel(), judge.problem().cost(judge.state.mean)
    found: dict[frozenset[str], float] = {frozenset(): criterion}
    for _ in range(LARGEST_SET):
        best = base, criterion
        for name, variants in catalogue.items():
            links = [started(judge.state, one) for one in variants if not one.unavailable(judge.state)]
            if name in base.names:
                continue
            for link in links or _find_dropout(judge, base):
                fit = judge.in_sample(base.with_link(link), FIXED, ITERATIONS)
                value = fit.cost + penalty * sum(one.values.size for one in fit.composite.links)
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


def _find_dropout(judge: Judge, base: CompositeModel) -> list[FittedEffect]:
    """The taxels that do not respond, as an effect; none if all respond."""
    effect = Dropout(find_dropped(judge.state, judge.sessions, base.features(judge.state)))
    return [FittedEffect(effect, effect.found_values(judge.state))] if effect.dropped.found else []
