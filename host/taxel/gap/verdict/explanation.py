"""Fits of the effects that a verdict names."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from taxel.gap.calibration.calibration import UNKNOWN
from taxel.gap.comparison.compare import Comparison
from taxel.gap.comparison.held_out import predict_held_out
from taxel.gap.effects.catalogue import INSPECTED_EFFECTS, Forms
from taxel.gap.fitting.composite import CompositeModel
from taxel.types import FloatArray


@dataclass(frozen=True, eq=False)
class Explanation:
    """The effects of a verdict, fitted together.

    composite: composite model, fitted to all features. features: f64[C, F, n] (C conditions, F features, n taxels),
    features that the composite model predicts, counts. fold_composites: composite models that were fitted without each
    fold of the features.
    """

    composite: CompositeModel
    features: FloatArray
    fold_composites: tuple[CompositeModel, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects."""
        return self.composite.names


def fit_explanation(comparison: Comparison, names: Collection[str]) -> Explanation:
    """Fit a model with exactly these effects together until the fit converges.

    names: names of the effects. The fit starts at the values of the compared set with exactly these effects. If no such
    set was compared, each effect starts at its values in the set with the largest weight that contains this effect, or
    else at the values of its coarse fit alone.
    """
    fit_data, wanted = comparison.fit_data, frozenset(names)
    fitted_effects = []
    for name in wanted:
        candidate = comparison.sets.get(wanted) or comparison.get_best_with(name)
        fitted_effects.append(comparison.single_fits[name] if candidate is None else candidate.composite.get(name))
    fit = fit_data.fit_in_sample(CompositeModel.from_effects(fitted_effects), INSPECTED_EFFECTS)
    prediction = predict_held_out(fit_data, fit.composite, INSPECTED_EFFECTS)
    return Explanation(fit.composite, fit.features, prediction.composites)


def get_leading_composite(
    comparison: Comparison, named: Explanation, effects: Sequence[str], rivals: Collection[str]
) -> tuple[CompositeModel, tuple[str, ...]]:
    """Return the composite model and the names of the effects for which further contacts are recommended.

    These are the effects of the verdict, or the first effect that has rivals if the verdict names no effect. named: the
    effects of the verdict with their fits. effects: causes of the verdict. rivals: names of effects that have rivals
    (effects that predict almost as well).
    """
    names = tuple(name for name in effects if name != UNKNOWN)
    first = next(iter(rivals), None)
    best = comparison.get_best_with(first) if first is not None and not names else None
    return (named.composite, names) if best is None or first is None else (best.composite, (first,))


def list_fits_alone(comparison: Comparison, forms: Forms) -> dict[str, tuple[CompositeModel, FloatArray]]:
    """Return for each effect, by name, the composite model with this effect alone, and its features f64[C, F, n] (C
    conditions, F features, n taxels), counts.

    The features are held-out predictions for a set that was evaluated, otherwise in-sample predictions of the coarse
    fit. Effects without a fit are omitted. forms: the effects of the catalogue that were tried.
    """
    fit_data, result = comparison.fit_data, {}
    for name in forms:
        single = comparison.sets.get(frozenset({name}))
        if single is not None:
            result[name] = (single.composite, single.prediction.features)
        elif name in comparison.single_fits:
            composite = CompositeModel((comparison.single_fits[name],))
            result[name] = (composite, composite.predict_features(fit_data.state))
    return result
