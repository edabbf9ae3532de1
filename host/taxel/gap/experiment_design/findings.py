"""What a diagnosis leaves open: effects that look alike, fitted in each other's place; how well values are known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.gap.comparison.compare import Comparison
from taxel.gap.data.pair import Pair
from taxel.gap.effects.catalogue import FIXED, Forms
from taxel.gap.effects.effect import BOARD, HAND, OBJECT, Effect, Parameter
from taxel.gap.features.metric import jackknife_error
from taxel.gap.fitting.composite import CompositeModel, FittedEffect
from taxel.gap.fitting.cores import in_copies
from taxel.gap.fitting.fit import Fit, fit, started
from taxel.gap.fitting.judge import REFITS, Judge
from taxel.types import FloatArray

MOST_RIVALS: Final = 6
"""Pairs that presses are judged by."""


@dataclass(frozen=True, eq=False)
class Findings:
    """What a diagnosis found.

    chain: fitted. names: of the verdict. rivals: by found effect and the one that cannot be told from it, a chain with
    the other in its place, fitted. links: the chain's, as fitted without each session in turn.
    """

    judge: Judge
    composite: CompositeModel
    names: tuple[str, ...]
    rivals: Mapping[tuple[str, str], CompositeModel]
    links: Sequence[Sequence[FittedEffect]]


def findings_of(
    comparison: Comparison,
    composite: CompositeModel,
    forms: Forms,
    named: Sequence[str],
    confounded: Mapping[str, Sequence[str]],
    links: Sequence[Sequence[FittedEffect]],
) -> Findings:
    """Of a comparison. chain: of the verdict, or of the most probable effect. forms: the catalogue. named: effects of
    the verdict, or this effect. confounded, links: see `Findings`.
    """
    judge = comparison.judge
    names = tuple(name for name in named if name in composite.names)
    starts: dict[tuple[str, str], Sequence[FittedEffect]] = {}
    for pair in pairs_of(names, confounded):
        # The form of the fit alone, which a report also has, so that a report gives the same findings.
        alone = comparison.get_alone(pair[1])
        own = (alone.effect,) if alone is not None else forms.get(pair[1], ())
        starts[pair] = _plain(judge, own)
    return Findings(judge, composite, names, rivals_of(judge, composite, starts), links)


def rivals_of(
    judge: Judge, composite: CompositeModel, starts: Mapping[tuple[str, str], Sequence[FittedEffect]]
) -> dict[tuple[str, str], CompositeModel]:
    """For each pair the chain with the second effect in the first one's place, in the form that fits best."""
    jobs = [
        ((name, other), composite.without(name).with_link(link))
        for (name, other), links in list(starts.items())[:MOST_RIVALS]
        if other not in composite.without(name).names
        for link in links
    ]
    fits = in_copies(judge.state, lambda job: fit(judge.problem(), job[1], FIXED, 2 * REFITS), jobs)
    found: dict[tuple[str, str], Fit] = {}
    for (pair, _), one in zip(jobs, fits, strict=True):
        if pair not in found or one.cost < found[pair].cost:
            found[pair] = one
    return {pair: one.composite for pair, one in found.items()}


def pairs_of(names: Sequence[str], confounded: Mapping[str, Sequence[str]]) -> list[tuple[str, str]]:
    """Each pair once, and the nearest rival of every effect before the second one of any."""
    ranked = sorted((place, name, other) for name in names for place, other in enumerate(confounded.get(name, ())))
    pairs: dict[frozenset[str], tuple[str, str]] = {}
    for _, name, other in ranked:
        pairs.setdefault(frozenset({name, other}), (name, other))
    return list(pairs.values())


def _plain(judge: Judge, forms: Sequence[Effect]) -> list[FittedEffect]:
    return [started(judge.state, form) for form in forms if not form.unavailable(judge.state)]


@dataclass(frozen=True, eq=False)
class Values:
    """V values of the named effects. place: [V], among the chain's free values. owner: [V], index of the effect in
    `names`. error: f64[V], standard errors over sessions, NaN where these do not tell. size: f64[V], of the largest
    value of the same parameter.
    """

    names: tuple[str, ...]
    labels: tuple[str, ...]
    place: NDArray[np.intp]
    owner: NDArray[np.intp]
    error: FloatArray
    size: FloatArray


def values_of(findings: Findings) -> Values:
    """The values that presses could tell more of."""
    pair, first = findings.judge.state.pair, 0
    names: list[str] = []
    labels: list[str] = []
    parts: list[tuple[FloatArray, FloatArray, FloatArray, FloatArray]] = []
    for link in findings.composite.links:
        effect = link.effect
        if effect.name in FIXED:
            continue
        in_sample = [one.values for links in findings.links for one in links if one.effect.name == effect.name]
        count = link.values.shape[1]
        if effect.name in findings.names:
            names.append(effect.name)
        for row, parameter in enumerate(effect.parameters()):
            if effect.name in findings.names:
                own = link.values[row]
                size = float(np.abs(own).max()) or abs(parameter.start) or 1.0
                places = np.arange(first, first + count)
                parts.append(
                    (places, np.full(count, len(names) - 1), _errors(in_sample, row, count), np.full(count, size))
                )
                labels += [_label(pair, link, parameter, block) for block in range(count)]
            first += count
    if not parts:
        empty = np.zeros(0)
        return Values((), (), np.zeros(0, np.intp), np.zeros(0, np.intp), empty, empty)
    place, owner, error, size_of = (np.concatenate(part) for part in zip(*parts, strict=True))
    return Values(tuple(names), tuple(labels), place.astype(np.intp), owner.astype(np.intp), error, size_of)


def _errors(in_sample: Sequence[FloatArray], row: int, count: int) -> FloatArray:
    """Jackknife over sessions (Tukey 1958), f64[count]; NaN below three."""
    return jackknife_error(np.array([one[row] for one in in_sample])) if len(in_sample) > 2 else np.full(count, np.nan)


def _label(pair: Pair, link: FittedEffect, parameter: Parameter, block: int) -> str:
    """A parameter as text: without its unit, with its effect and its board or object."""
    name, effect = parameter.name.removesuffix(f"_{parameter.unit}").replace("_", " "), link.effect
    text = f"{name} of {effect.name.replace('_', ' ')}"
    if effect.scope == BOARD:
        return f"{text}, {pair.sensors.name[block].replace('_', ' ')}"
    if effect.scope == OBJECT:
        return f"{text}, {pair.object_names[block]}"
    return text if effect.scope == HAND else f"{name} of single taxels"
