"""The set of effects that a verdict names, with its fits."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from taxel.gap.calibration.calibration import UNKNOWN
from taxel.gap.comparison.compare import Comparison
from taxel.gap.comparison.held_out import predict_held_out
from taxel.gap.effects.catalogue import FIXED, Forms
from taxel.gap.fitting.composite import CompositeModel
from taxel.types import FloatArray


@dataclass(frozen=True, eq=False)
class Explanation:
    """A set of effects.

    chain: fitted to all features. features: f64[C, F, n], of the chain. parts: fits without each part of the features.
    """

    composite: CompositeModel
    features: FloatArray
    parts: tuple[CompositeModel, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects."""
        return self.composite.names


def explain(comparison: Comparison, names: Collection[str]) -> Explanation:
    """The set with exactly these effects, fitted until it converges.

    The fit begins at the values of the candidate set, or of the sets with the largest weights that contain the effects.
    """
    judge, wanted = comparison.judge, frozenset(names)
    links = []
    for name in wanted:
        candidate = comparison.sets.get(wanted) or comparison.get_best_with(name)
        links.append(comparison.alone[name] if candidate is None else candidate.composite.get(name))
    fit = judge.in_sample(CompositeModel.of(links), FIXED)
    prediction = predict_held_out(judge, fit.composite, FIXED)
    return Explanation(fit.composite, fit.features, prediction.composites)


def get_questioned(
    comparison: Comparison, named: Explanation, effects: Sequence[str], rivals: Collection[str]
) -> tuple[CompositeModel, tuple[str, ...]]:
    """The chain and the effects about which a further grasp is asked.

    These are the effects of the verdict, or the first effect that has rivals if the verdict names none.
    """
    names = tuple(name for name in effects if name != UNKNOWN)
    first = next(iter(rivals), None)
    best = comparison.get_best_with(first) if first is not None and not names else None
    return (named.composite, names) if best is None or first is None else (best.composite, (first,))


def list_fits_alone(comparison: Comparison, forms: Forms) -> dict[str, tuple[CompositeModel, FloatArray]]:
    """Each effect that was fitted alone: its chain, and held-out features f64[C, F, n], or those of a coarse fit."""
    judge, result = comparison.judge, {}
    for name in forms:
        single = comparison.sets.get(frozenset({name}))
        if single is not None:
            result[name] = (single.composite, single.prediction.features)
        elif name in comparison.alone:
            composite = CompositeModel((comparison.alone[name],))
            result[name] = (composite, composite.features(judge.state))
    return result
