"""Open questions of a diagnosis: confounded effects, and the standard errors of the parameters of named effects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.gap.comparison.compare import Comparison
from taxel.gap.data.pair import Pair
from taxel.gap.effects.catalogue import INSPECTED_EFFECTS, Forms
from taxel.gap.effects.effect import BOARD, HAND, OBJECT, Effect, Parameter
from taxel.gap.features.metric import compute_jackknife_error
from taxel.gap.fitting.composite import CompositeModel, FittedEffect
from taxel.gap.fitting.fit import Fit, fit, start_effect
from taxel.gap.fitting.fit_data import REFIT_ITERATIONS, FitData
from taxel.gap.fitting.parallel import map_in_processes
from taxel.types import FloatArray

MAX_PAIRS: Final = 6
"""Largest number of confounded pairs in a ranking. Chosen to limit the run time: each pair needs at least one fit."""


@dataclass(frozen=True, eq=False)
class Findings:
    """Results of a diagnosis that determine which contacts would add information.

    Attributes:
        fit_data: simulated contacts, real sessions and weights of the features.
        composite: the fitted composite model of the verdict, or of the most probable effect.
        names: names of the effects of the verdict, or of the most probable effect.
        rivals: for each pair of a named effect and an effect that is confounded with it, the fitted composite model
            with the other effect in place of the named effect.
        replicates: effects of `composite`, fitted without each session in turn; empty if there are no such fits.
    """

    fit_data: FitData
    composite: CompositeModel
    names: tuple[str, ...]
    rivals: Mapping[tuple[str, str], CompositeModel]
    replicates: Sequence[Sequence[FittedEffect]]


def collect_findings(
    comparison: Comparison,
    composite: CompositeModel,
    forms: Forms,
    named: Sequence[str],
    confounded: Mapping[str, Sequence[str]],
    replicates: Sequence[Sequence[FittedEffect]],
) -> Findings:
    """Return the findings of a comparison.

    composite, replicates: see `Findings`. forms: the catalogue. named: names of the effects of the verdict, or of the
    most probable effect. confounded: for each named effect the names of the confounded effects, the rivals of
    the comparison first.
    """
    fit_data = comparison.fit_data
    names = tuple(name for name in named if name in composite.names)
    starts: dict[tuple[str, str], Sequence[FittedEffect]] = {}
    for pair in rank_pairs(names, confounded):
        # The form of the fit of the single effect is also in the report, so that the report gives the same findings.
        single = comparison.get_single_fit(pair[1])
        effects = (single.effect,) if single is not None else forms.get(pair[1], ())
        starts[pair] = _start_forms(fit_data, effects)
    return Findings(fit_data, composite, names, fit_rivals(fit_data, composite, starts), replicates)


def fit_rivals(
    fit_data: FitData, composite: CompositeModel, starts: Mapping[tuple[str, str], Sequence[FittedEffect]]
) -> dict[tuple[str, str], CompositeModel]:
    """Fit for each pair the composite model with the second effect in place of the first effect.

    starts: for each pair the forms of the second effect, with start values. Only the first `MAX_PAIRS` pairs are
    fitted. A pair whose second effect is already in the model is omitted. Of several forms, the form with the smallest
    cost is kept.
    """
    jobs = [
        ((name, other), composite.without(name).with_effect(start))
        for (name, other), forms in list(starts.items())[:MAX_PAIRS]
        if other not in composite.without(name).names
        for start in forms
    ]
    fits = map_in_processes(
        fit_data.state, lambda job: fit(fit_data.build_problem(), job[1], INSPECTED_EFFECTS, 2 * REFIT_ITERATIONS), jobs
    )
    best: dict[tuple[str, str], Fit] = {}
    for (pair, _), result in zip(jobs, fits, strict=True):
        if pair not in best or result.cost < best[pair].cost:
            best[pair] = result
    return {pair: result.composite for pair, result in best.items()}


def rank_pairs(names: Sequence[str], confounded: Mapping[str, Sequence[str]]) -> list[tuple[str, str]]:
    """Return each pair of a named effect and a rival (an effect that is confounded with it) once.

    First come all named effects with their first rival, then all with their second rival, and so on. names: named
    effects. confounded: for each named effect its rivals, the strongest rival first.
    """
    ranked = sorted((rank, name, other) for name in names for rank, other in enumerate(confounded.get(name, ())))
    pairs: dict[frozenset[str], tuple[str, str]] = {}
    for _, name, other in ranked:
        pairs.setdefault(frozenset({name, other}), (name, other))
    return list(pairs.values())


def _start_forms(fit_data: FitData, forms: Sequence[Effect]) -> list[FittedEffect]:
    """Return the forms that can be fitted to the data, with their start values; the other forms are omitted."""
    return [start_effect(fit_data.state, form) for form in forms if not form.find_unavailable_reason(fit_data.state)]


@dataclass(frozen=True, eq=False)
class ParameterValues:
    """The V parameter values of the named effects.

    Attributes:
        names: names of the effects.
        labels: [V], text for the user.
        index: [V], index among the free values of the composite model.
        effect_index: [V], index of the effect in `names`.
        standard_error: f64[V], jackknife standard error over the sessions; NaN below three sessions. Unit of the value.
        scale: f64[V], largest absolute value of the same parameter; its start value, or 1, if all values are 0.
    """

    names: tuple[str, ...]
    labels: tuple[str, ...]
    index: NDArray[np.intp]
    effect_index: NDArray[np.intp]
    standard_error: FloatArray
    scale: FloatArray


def collect_parameter_values(findings: Findings) -> ParameterValues:
    """Describe the parameter values of the effects in `findings.names`, which further contacts can determine better.

    The index of a value counts the values of all fitted effects except `INSPECTED_EFFECTS`, also of effects that are
    not in `findings.names`.
    """
    pair, first = findings.fit_data.state.pair, 0
    names: list[str] = []
    labels: list[str] = []
    columns: list[tuple[FloatArray, FloatArray, FloatArray, FloatArray]] = []
    for fitted_effect in findings.composite.fitted_effects:
        effect = fitted_effect.effect
        if effect.name in INSPECTED_EFFECTS:
            continue
        replicates = [
            fitted.values for fits in findings.replicates for fitted in fits if fitted.effect.name == effect.name
        ]
        count = fitted_effect.values.shape[1]
        if effect.name in findings.names:
            names.append(effect.name)
        for row, parameter in enumerate(effect.parameters()):
            if effect.name in findings.names:
                parameter_values = fitted_effect.values[row]
                scale = float(np.abs(parameter_values).max()) or abs(parameter.start) or 1.0
                columns.append(  # index, effect, standard error and scale of each value of the parameter
                    (
                        np.arange(first, first + count),
                        np.full(count, len(names) - 1),
                        _compute_standard_errors(replicates, row, count),
                        np.full(count, scale),
                    )
                )
                labels += [_format_label(pair, fitted_effect, parameter, block) for block in range(count)]
            first += count
    if not columns:
        empty = np.zeros(0)
        return ParameterValues((), (), np.zeros(0, np.intp), np.zeros(0, np.intp), empty, empty)
    index, effect_index, error, scales = (np.concatenate(column) for column in zip(*columns, strict=True))
    return ParameterValues(
        tuple(names), tuple(labels), index.astype(np.intp), effect_index.astype(np.intp), error, scales
    )


def _compute_standard_errors(replicates: Sequence[FloatArray], row: int, count: int) -> FloatArray:
    """Return the jackknife standard errors over sessions (Tukey 1958), f64[count]; NaN below three sessions.

    replicates: f64[P, G] (P parameters; G blocks: the hand, boards, objects or taxels) for each session, the values of
    an effect fitted without this session. row: row of the parameter in these values. count: number of blocks, G.
    """
    return (
        compute_jackknife_error(np.array([values[row] for values in replicates]))
        if len(replicates) > 2
        else np.full(count, np.nan)
    )


def _format_label(pair: Pair, fitted_effect: FittedEffect, parameter: Parameter, block: int) -> str:
    """Return the label of a parameter for the user, such as "spread of contact propagation, index tip".

    The label contains the parameter without its unit, the effect, and the board or object. Parameters with one value
    for each taxel share the label "... of single taxels".
    """
    name, effect = parameter.name.removesuffix(f"_{parameter.unit}").replace("_", " "), fitted_effect.effect
    text = f"{name} of {effect.name.replace('_', ' ')}"
    if effect.scope == BOARD:
        return f"{text}, {pair.sensors.name[block].replace('_', ' ')}"
    if effect.scope == OBJECT:
        return f"{text}, {pair.object_names[block]}"
    return text if effect.scope == HAND else f"{name} of single taxels"
