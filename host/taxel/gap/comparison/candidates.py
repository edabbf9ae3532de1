"""The sets of effects that are compared: none, each effect, and larger sets that are built step by step."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from taxel.gap.comparison.density import BlockDensity, fit_density
from taxel.gap.comparison.held_out import HeldOutPrediction, predict_held_out
from taxel.gap.comparison.load_trend import compute_load_trend
from taxel.gap.comparison.settings import ComparisonSettings
from taxel.gap.effects.catalogue import DROPOUT, FIXED, Forms
from taxel.gap.effects.dropout import Dropout
from taxel.gap.effects.dropped import find_dropped
from taxel.gap.effects.effect import HAND
from taxel.gap.fitting.composite import CompositeModel, FittedEffect
from taxel.gap.fitting.cores import in_copies
from taxel.gap.fitting.fit import NOTHING_KNOWN, near_their_end, started
from taxel.gap.fitting.judge import Judge
from taxel.types import FloatArray


@dataclass(frozen=True, eq=False)
class Candidate:
    """A set of effects.

    chain: with fitted values. features: f64[C, F, n], of the fit. prediction: held out. inside, held_out: log density
    of each block, f64[C, s, 5], for the fit and for predictions of parts that a fit did not use. log_prior: of the
    forms and the parameters.
    """

    composite: CompositeModel
    features: FloatArray
    prediction: HeldOutPrediction
    in_sample: FloatArray
    held_out: FloatArray
    log_prior: float = 0.0

    @property
    def value(self) -> float:
        """Held-out log density plus log prior."""
        return float(self.held_out.sum()) + self.log_prior

    @property
    def names(self) -> frozenset[str]:
        """Names of the effects."""
        return frozenset(self.composite.names)


Sets = dict[frozenset[str], Candidate]


@dataclass(frozen=True, eq=False)
class CandidateSets:
    """Result of a search. sets: the best candidate of each set of names, the empty set included. alone: coarse fit of
    each effect alone. repeat_share: share of the variance between simulated repeats that applies to their mean.
    """

    sets: Sets
    alone: dict[str, FittedEffect] = field(default_factory=dict)
    repeat_share: float = 1.0


class CandidateSearch:
    """Builds the candidate sets of one pair, starting from the empty set."""

    def __init__(self, judge: Judge, forms: Forms, density: BlockDensity, settings: ComparisonSettings) -> None:
        """Prepare the search. forms: forms of each effect by its name."""
        self._judge, self._forms, self._density, self._settings = judge, forms, density, settings

    def run(self, progress: Callable[[int, int], None]) -> CandidateSets:
        """Fit and evaluate candidate sets. progress: steps done, total."""
        empty = self.evaluate(CompositeModel(), self._judge.state.mean)
        found: Sets = {empty.names: empty}
        alone: dict[str, FittedEffect] = {}
        base = empty
        for size in range(self._settings.largest_set):
            progress(size, self._settings.largest_set)
            coarse = self._fit_coarsely(base)
            if not size:
                for composite, _ in coarse:
                    alone.setdefault(composite.names[0], composite.links[0])
            number = self._settings.candidates[min(size, 1)]
            # Effects that are found by inspection cost no fit: they are always compared.
            composites = [
                composite
                for place, (composite, _) in enumerate(coarse)
                if place < number or set(composite.names) - base.names <= set(FIXED)
            ]
            extended = in_copies(self._judge.state, self.fit, composites)
            for candidate in extended:
                known = found.get(candidate.names)
                if known is None or candidate.value > known.value:
                    found[candidate.names] = candidate
            best = max(extended, key=lambda one: one.value, default=base)
            if best.value <= base.value:
                break  # no further effect predicts better
            base = best
        return CandidateSets(found, alone)

    def compute_log_prior(self, composite: CompositeModel) -> float:
        """Log prior of the forms of the effects, of parameters that are farther from the expected value than usual, and
        of properties of the skin that depend on the load (`ComparisonSettings.local_odds`, `usual_deviation`,
        `compute_load_trend`).
        """
        settings = self._settings
        total = 0.0
        for link in composite.links:
            if link.effect.name in FIXED:
                continue
            if link.effect.scope != HAND:
                total += math.log(settings.local_odds)
            trend = compute_load_trend(self._judge.state, link)
            total -= 0.5 * max(trend**2 - settings.usual_deviation**2, 0.0)
            for row, parameter in enumerate(link.effect.parameters()):
                if np.isfinite(parameter.prior):
                    squares = ((link.values[row] - parameter.middle) / parameter.prior) ** 2
                    total -= 0.5 * float(np.maximum(squares - settings.usual_deviation**2, 0.0).sum())
        return total

    def fit(self, composite: CompositeModel) -> Candidate:
        """Fit a chain from its values, and evaluate it."""
        fit = self._judge.in_sample(composite, FIXED, self._settings.fit_iterations)
        return self.evaluate(fit.composite, fit.features)

    def evaluate(self, composite: CompositeModel, features: FloatArray) -> Candidate:
        """Evaluate a fitted chain, in sample and held out. features: f64[C, F, n], of the chain."""
        held = predict_held_out(self._judge, composite, FIXED) if composite.links else HeldOutPrediction(features)
        density = self._density.compute_log_density
        prior = self.compute_log_prior(composite)
        return Candidate(composite, features, held, density(features), density(held.features), prior)

    def _fit_coarsely(self, base: Candidate) -> list[tuple[CompositeModel, float]]:
        """Fit every effect beside `base` coarsely; the best form of each scope, those with the largest log density
        first.
        """
        state = self._judge.state
        known = near_their_end(state, base.composite, base.features, FIXED) if base.composite.links else NOTHING_KNOWN
        links = [link for name in self._forms if name not in base.names for link in self._start_forms(name, base)]

        def fit_one(link: FittedEffect) -> tuple[CompositeModel, float] | None:
            composite = base.composite.with_link(link)
            fit = self._judge.in_sample(composite, FIXED, self._settings.coarse_iterations, known)
            fitted = fit.composite.get(link.effect.name)
            if fitted.effect.is_idle(state, fitted.values):
                return None
            density = float(self._density.compute_log_density(fit.features).sum())
            return fit.composite, density + self.compute_log_prior(fit.composite)

        best: dict[tuple[str, str], tuple[CompositeModel, float]] = {}
        for link, fitted in zip(links, in_copies(state, fit_one, links), strict=True):
            key = link.effect.name, link.effect.scope
            if fitted is not None and (key not in best or fitted[1] > best[key][1]):
                best[key] = fitted
        return sorted(best.values(), key=lambda pair: -pair[1])

    def _start_forms(self, name: str, base: Candidate) -> list[FittedEffect]:
        """Forms of an effect at the values where a search starts; a dropout as it is found beside `base`."""
        state = self._judge.state
        if name == DROPOUT:
            dropped = find_dropped(state, self._judge.sessions, base.features)
            effect = Dropout(dropped)
            return [FittedEffect(effect, effect.found_values(state))] if dropped.found else []
        return [started(state, form) for form in self._forms[name] if not form.unavailable(state)]


def reevaluate(
    judge: Judge, found: CandidateSets, settings: ComparisonSettings, simulated: Mapping[frozenset[str], FloatArray]
) -> CandidateSets:
    """Evaluate all sets once more, with the model error that the best set leaves.

    simulated: features f64[C, F, n] of simulations with some sets. They replace the features of the fits; the change
    from fit to held-out prediction is kept. The mean change of the log density over the simulated sets is removed,
    because a simulation has random errors that a fit has not: simulations decide only between simulated sets.
    """
    best = max(found.sets.values(), key=lambda one: one.value)
    density = fit_density(judge, settings, best.prediction.features)
    compute = density.compute_log_density
    sets = {
        key: replace(one, in_sample=compute(one.features), held_out=compute(one.prediction.features))
        for key, one in found.sets.items()
    }
    measured = {
        key: compute(features + sets[key].prediction.features - sets[key].features)
        for key, features in simulated.items()
    }
    changes = [value - sets[key].held_out for key, value in measured.items()]
    for key, value in measured.items():
        sets[key] = replace(sets[key], held_out=value - np.mean(changes, axis=0))
    return CandidateSets(sets, found.alone, density.repeat_share)
