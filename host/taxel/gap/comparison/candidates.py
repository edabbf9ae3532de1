"""The sets of effects that are compared: none, each effect, and larger sets that are built step by step."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from taxel.gap.comparison.density import CERTAIN, BlockDensity, UncertainChange, fit_density
from taxel.gap.comparison.held_out import HeldOutPrediction, predict_held_out
from taxel.gap.comparison.load_trend import compute_load_trend
from taxel.gap.comparison.settings import ComparisonSettings
from taxel.gap.effects.catalogue import DROPOUT, INSPECTED_EFFECTS, Forms
from taxel.gap.effects.dropout import Dropout
from taxel.gap.effects.dropout_inspection import find_defects
from taxel.gap.fitting.composite import CompositeModel, FittedEffect
from taxel.gap.fitting.fit import NO_COLUMNS, compute_columns_by_effect, start_effect
from taxel.gap.fitting.fit_data import FitData
from taxel.gap.fitting.parallel import map_in_processes
from taxel.gap.fitting.state import State
from taxel.types import FloatArray


@dataclass(frozen=True, eq=False)
class Candidate:
    """A candidate: a set of effects with fitted values, and its evaluation.

    composite: model with fitted values. features: f64[C, F, n] (C conditions, F features, n taxels), features that the
    fit to all data predicts, counts. prediction: held-out prediction of the features. in_sample, held_out: log density
    of each block for these two predictions, f64[C, s, 5]; a block consists of the features of one of 5 families on one
    of s boards in one condition. log_prior: log prior of the forms of the effects and of their parameters. uncertain:
    part of the prediction that has a relative error.
    """

    composite: CompositeModel
    features: FloatArray
    prediction: HeldOutPrediction
    in_sample: FloatArray
    held_out: FloatArray
    log_prior: float = 0.0
    uncertain: UncertainChange = CERTAIN

    @property
    def value(self) -> float:
        """Held-out log density plus log prior."""
        return float(self.held_out.sum()) + self.log_prior

    def predict_sessions(self, fit_data: FitData) -> list[FloatArray]:
        """Predict the features for each session by the fit without this session, f64[C, F, n] (C conditions, F
        features, n taxels), counts. Without fitted parameters all predictions are equal.

        The parameters of these fits are one linearised step away from those of the fit to all sessions. A step that
        does not reduce the cost of the other sessions is outside the range of the linearisation. The prediction of the
        fit to all sessions is then used instead.
        """
        composites = self.prediction.session_composites
        if not composites:
            return [self.features] * fit_data.sessions.value.shape[1]
        all_sessions, predictions = fit_data.build_problem(), []
        for composite, target in zip(composites, fit_data.targets_without_session, strict=True):
            problem = replace(all_sessions, target=target)
            features = composite.predict_features(fit_data.state)
            predictions.append(features if problem.cost(features) < problem.cost(self.features) else self.features)
        return predictions

    @property
    def names(self) -> frozenset[str]:
        """Names of the effects of the set."""
        return frozenset(self.composite.names)


class CoarseFit(NamedTuple):
    """Coarse fit of a set of effects: composite model, log density plus log prior, and seconds that the fit took."""

    composite: CompositeModel
    value: float
    seconds: float


Sets = dict[frozenset[str], Candidate]
"""Best candidate of each set of effects, by the names of the effects."""


@dataclass(frozen=True, eq=False)
class CandidateSets:
    """Result of a search.

    sets: best candidate of each set of effects, including the empty set. single_fits: coarse fit of each effect alone,
    by name. repeat_share: share of the variance between simulated repeats that is a part of the variance of their mean.
    """

    sets: Sets
    single_fits: dict[str, FittedEffect] = field(default_factory=dict)
    repeat_share: float = 1.0


class CandidateSearch:
    """Search for the candidate sets of one pair, starting from the empty set."""

    def __init__(self, fit_data: FitData, forms: Forms, density: BlockDensity, settings: ComparisonSettings) -> None:
        """Prepare the search. forms: forms of each effect by its name. density: predictive density of the real
        features.
        """
        self._fit_data, self._forms, self._density, self._settings = fit_data, forms, density, settings
        self._coarse_data = fit_data.keep_first_repeats()

    def run(self, progress: Callable[[int, int], None]) -> CandidateSets:
        """Fit and evaluate candidate sets, and return them.

        In each iteration every further effect is fitted coarsely together with the best set so far (`base`), and the
        best of these sets are fitted in full. progress: called with the number of finished iterations and their largest
        number.
        """
        empty = self.evaluate(CompositeModel(), self._fit_data.state.mean)
        sets: Sets = {empty.names: empty}
        single_fits: dict[str, FittedEffect] = {}
        base = empty
        for size in range(self._settings.largest_set):
            progress(size, self._settings.largest_set)
            coarse_fits = self._fit_coarsely(base)
            if not size:
                for coarse in coarse_fits:
                    single_fits.setdefault(coarse.composite.names[0], coarse.composite.fitted_effects[0])
            number_of_fits = self._settings.candidates[min(size, 1)]  # element 0: first iteration, 1: all others
            # Effects that are found by inspection cost no fit: they are always compared.
            selected = [
                coarse
                for rank, coarse in enumerate(coarse_fits)
                if rank < number_of_fits or set(coarse.composite.names) - base.names <= set(INSPECTED_EFFECTS)
            ]
            extended = map_in_processes(
                self._fit_data.state,
                lambda coarse: self.fit(coarse.composite),
                selected,
                [coarse.seconds for coarse in selected],
            )
            for candidate in extended:
                previous = sets.get(candidate.names)
                if previous is None or candidate.value > previous.value:
                    sets[candidate.names] = candidate
            best = max(extended, key=lambda candidate: candidate.value, default=base)
            if best.value + math.log(self._settings.prior_odds) <= base.value:
                break  # no further effect predicts so much better that the larger set has the larger weight
            base = best
        return CandidateSets(sets, single_fits)

    def compute_log_prior(self, composite: CompositeModel) -> float:
        """Compute the log prior of the forms of the effects, of parameters far from their expected values, and of
        properties of the skin that depend on the load (`ComparisonSettings.local_odds`, `usual_deviation`,
        `compute_load_trend`).

        Each deviation of more than `usual_deviation` standard deviations reduces the log prior by half the excess of
        its square.
        """
        settings = self._settings
        total = 0.0
        for fitted_effect in composite.fitted_effects:
            if fitted_effect.effect.name in INSPECTED_EFFECTS:
                continue
            # The density selects the best of the possible relative errors, each of which has the same prior.
            total -= math.log(len(fitted_effect.effect.change_errors))
            if fitted_effect.values.shape[1] > 1:
                total += math.log(settings.local_odds)
            trend = compute_load_trend(self._fit_data.state, fitted_effect)
            total -= 0.5 * max(trend**2 - settings.usual_deviation**2, 0.0)
            for row, parameter in enumerate(fitted_effect.effect.parameters()):
                if np.isfinite(parameter.prior):
                    squares = ((fitted_effect.values[row] - parameter.prior_mean) / parameter.prior) ** 2
                    total -= 0.5 * float(np.maximum(squares - settings.usual_deviation**2, 0.0).sum())
        return total

    def fit(self, composite: CompositeModel) -> Candidate:
        """Fit a composite model, starting from its values, and evaluate the result."""
        fit = self._fit_data.fit_in_sample(composite, INSPECTED_EFFECTS, self._settings.fit_iterations)
        return self.evaluate(fit.composite, fit.features)

    def evaluate(self, composite: CompositeModel, features: FloatArray) -> Candidate:
        """Evaluate a fitted composite model, in sample and held out. features: f64[C, F, n] (C conditions, F features,
        n taxels), its prediction.
        """
        prediction = (
            predict_held_out(self._fit_data, composite, INSPECTED_EFFECTS)
            if composite.fitted_effects
            else HeldOutPrediction(features)
        )
        uncertain = find_uncertain_change(self._fit_data.state, composite, features)
        in_sample, held_out = (
            self._density.compute_log_density(one, uncertain) for one in (features, prediction.features)
        )
        return Candidate(
            composite, features, prediction, in_sample, held_out, self.compute_log_prior(composite), uncertain
        )

    def _fit_coarsely(self, base: Candidate) -> list[CoarseFit]:
        """Fit every further effect coarsely together with the effects of `base`.

        Return the fits, largest log density plus log prior first; for each effect and scope only the best form. The
        forms of an effect are compared by the Akaike criterion: a fit to the same data increases the log density by one
        for each superfluous value, compared with new data. Forms whose fitted values have no consequence of their own
        (`Effect.is_idle`) are omitted. The effects act on the first simulated contact of each condition.
        """
        state = self._coarse_data.state
        fixed_columns = (
            compute_columns_by_effect(state, base.composite, base.composite.predict_features(state), INSPECTED_EFFECTS)
            if base.composite.fitted_effects
            else NO_COLUMNS
        )
        start_forms = [
            fitted_effect
            for name in self._forms
            if name not in base.names
            for fitted_effect in self._list_start_forms(name, base)
        ]

        def fit_one(fitted_effect: FittedEffect) -> CoarseFit | None:
            """Return the coarse fit with one more effect; None if the fitted values have no consequence of their
            own.
            """
            start_s = time.perf_counter()
            composite = base.composite.with_effect(fitted_effect)
            fit = self._coarse_data.fit_in_sample(
                composite, INSPECTED_EFFECTS, self._settings.coarse_iterations, fixed_columns
            )
            fitted = fit.composite.get(fitted_effect.effect.name)
            if fitted.effect.is_idle(state, fitted.values):
                return None
            uncertain = find_uncertain_change(state, fit.composite, fit.features)
            density = float(self._density.compute_log_density(fit.features, uncertain).sum())
            value = density + self.compute_log_prior(fit.composite)
            return CoarseFit(fit.composite, value, time.perf_counter() - start_s)

        best: dict[tuple[str, str], CoarseFit] = {}
        criteria: dict[tuple[str, str], float] = {}
        for fitted_effect, fitted in zip(
            start_forms, map_in_processes(self._fit_data.state, fit_one, start_forms), strict=True
        ):
            key = fitted_effect.effect.name, fitted_effect.effect.scope
            if fitted is None:
                continue
            criterion = fitted.value - fitted_effect.values.size
            if criterion > criteria.get(key, -math.inf):
                best[key], criteria[key] = fitted, criterion
        return sorted(best.values(), key=lambda fitted: -fitted.value)

    def _list_start_forms(self, name: str, base: Candidate) -> list[FittedEffect]:
        """Return the available forms of an effect with their start values.

        A dropout has the values that an inspection finds with the features of `base`; the list is empty if nothing is
        found.
        """
        state = self._fit_data.state
        if name == DROPOUT:
            defects = find_defects(state, self._fit_data.sessions, base.features)
            effect = Dropout(defects)
            return [FittedEffect(effect, effect.make_detected_values(state))] if defects.has_any else []
        return [start_effect(state, form) for form in self._forms[name] if not form.find_unavailable_reason(state)]


def find_uncertain_change(state: State, composite: CompositeModel, features: FloatArray) -> UncertainChange:
    """Return the part of the predicted features that is due to effects with an uncertain prediction.

    These are the effects of the composite model with several possible relative errors (`Effect.change_errors`); the
    result contains the errors of all of them. features: f64[C, F, n] (C conditions, F features, n taxels), the
    prediction of the whole model.
    """
    uncertain = [one for one in composite.fitted_effects if len(one.effect.change_errors) > 1]
    if not uncertain:
        return CERTAIN
    others = CompositeModel(tuple(one for one in composite.fitted_effects if one not in uncertain))
    change = features - others.predict_features(state)
    return UncertainChange(change, tuple(sorted({error for one in uncertain for error in one.effect.change_errors})))


def reevaluate(
    fit_data: FitData,
    candidate_sets: CandidateSets,
    settings: ComparisonSettings,
    simulated: Mapping[frozenset[str], FloatArray],
) -> CandidateSets:
    """Evaluate all candidate sets once more, with the model error that is estimated from the best set, and return them.

    simulated: features f64[C, F, n] (C conditions, F features, n taxels) of simulations with some sets, by the names of
    the effects. They replace the features of the fits; the change from the fit to its held-out prediction is kept. The
    mean change of the log density over the simulated sets is removed, because a simulation has random errors and a fit
    has none: simulations decide only between simulated sets.
    """
    best = max(candidate_sets.sets.values(), key=lambda candidate: candidate.value)
    density = fit_density(fit_data, settings, best.prediction.features)
    compute = density.compute_log_density
    sets = {
        key: replace(
            candidate,
            in_sample=compute(candidate.features, candidate.uncertain),
            held_out=compute(candidate.prediction.features, candidate.uncertain),
        )
        for key, candidate in candidate_sets.sets.items()
    }
    measured = {
        key: compute(features + sets[key].prediction.features - sets[key].features, sets[key].uncertain)
        for key, features in simulated.items()
    }
    changes = [value - sets[key].held_out for key, value in measured.items()]
    for key, value in measured.items():
        sets[key] = replace(sets[key], held_out=value - np.mean(changes, axis=0))
    return CandidateSets(sets, candidate_sets.single_fits, density.repeat_share)
