"""Least squares for a chain of effects whose parameters hold for the hand, a board, an object or a taxel.

Levenberg-Marquardt with numeric derivatives. All blocks of one parameter are moved at once: a taxel in a cell belongs
to one block of an effect only, so one evaluation gives every block's derivative.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import numpy as np

from taxel.gap.effects.effect import Effect, Parameter
from taxel.gap.fitting.composite import CompositeModel, FittedEffect
from taxel.gap.fitting.cores import in_copies
from taxel.gap.fitting.equations import Column, Problem, Steps, gradient_of, system_of
from taxel.gap.fitting.state import State
from taxel.types import FloatArray

STEP: Final = 2e-3
"""Of a parameter, relative to its scale, for the numeric derivative."""

DAMPING: Final = 0.1
"""At first: along what is hardly determined, such as a slide along a face, a full step would go astray."""

KNOWN_DAMPING: Final = 1e-3
"""The same of a fit that begins near its end."""

SETTLING_DAMPING: Final = 1e-6
"""Of the last step."""

CAUTION: Final = 8.0
"""Factor on the damping after a step that did harm."""

CHORD_CAUTION: Final = 30.0
"""The same of a fit that begins near its end: there it hardly moves along what is hardly determined."""

TRIES: Final = 4
"""Dampings of one step."""

ITERATIONS: Final = 12
ENOUGH: Final = 1e-3
"""Relative gain at which the search ends."""

FAR: Final = 0.05
"""Relative gain of a step beyond which derivatives are worked out anew; after a shorter one a chord serves."""


KnownColumns = Mapping[str, tuple[Column, ...]]
NOTHING_KNOWN: Final[KnownColumns] = MappingProxyType({})


@dataclass(frozen=True, eq=False)
class Fit:
    """chain: with the fitted values. features: f64[C, F, n]. cost: of the problem, without priors."""

    composite: CompositeModel
    features: FloatArray
    cost: float


@dataclass(frozen=True, eq=False)
class Start:
    """Where fits to different parts of one problem begin, and how features change there with each value: both are
    worked out once for all of them. They end near where they begin, and a chord serves as well as a tangent.
    """

    composite: CompositeModel
    features: FloatArray
    columns: tuple[Column, ...]


def start_of(state: State, composite: CompositeModel, fixed: Sequence[str] = ()) -> Start:
    """Features of a chain and their derivatives."""
    features = composite.features(state)
    return Start(composite, features, _columns(state, composite, free_links(composite, fixed), features))


def near_their_end(
    state: State, composite: CompositeModel, features: FloatArray, fixed: Sequence[str] = ()
) -> KnownColumns:
    """Derivatives of a chain's effects, each by its name, for fits that hardly move them. features: of the chain."""
    free = free_links(composite, fixed)
    found = in_copies(state, lambda index: _columns(state, composite, [index], features), free)
    return {composite.links[index].effect.name: columns for index, columns in zip(free, found, strict=True)}


def free_links(composite: CompositeModel, fixed: Sequence[str]) -> list[int]:
    """Places of the links whose values are fitted."""
    return [index for index, link in enumerate(composite.links) if link.effect.name not in fixed]


def fit(
    problem: Problem,
    composite: CompositeModel,
    fixed: Sequence[str] = (),
    iterations: int = ITERATIONS,
    start: Start | None = None,
    known: KnownColumns = NOTHING_KNOWN,
) -> Fit:
    """Fit all effects of the chain but those named in `fixed`, from the values they have (those of `start`). known:
    derivatives, by effect, that serve throughout.
    """
    problem = Problem(problem.state, np.where(problem.weight > 0, problem.target, 0.0), problem.weight)
    free = free_links(composite, fixed)
    point = _Point.of(problem, composite, free, start.features if start else None)
    damping = KNOWN_DAMPING if start else DAMPING
    converged, gain = False, np.inf
    for number in range(iterations if free else 0):
        # A step that gained little ends the search only where no better derivatives are to be had.
        fresh = number == 0 or (gain > FAR and not start)
        last = fresh or start is not None
        if fresh:
            columns = start.columns if start else _columns(problem.state, point.composite, free, point.features, known)
            steps = Steps(system_of(problem, columns))
        gradient = _gradient(problem, columns, point, free)
        before, gain = point, 0.0
        # The first step is always tried: how values differ between fits to different parts is what makes intervals.
        if number == 0 or gradient @ steps.step(gradient, damping) >= ENOUGH * point.whole:  # gained if all is linear
            for _ in range(TRIES if last else 1):
                tried = _Point.of(problem, moved(point.composite, free, steps.step(gradient, damping)), free)
                if tried.whole < point.whole:
                    gain, point = 1.0 - tried.whole / point.whole, tried
                    break
                damping *= CHORD_CAUTION if start else CAUTION
            converged = point is not before or (not last and converged)
            damping = damping if start or point is before else max(damping / 10.0, 1e-6)
        if gain < ENOUGH:
            if last:
                break
            gain = np.inf
    if converged and point.prior > 0.0:
        # What presses cannot tell gains less than `ENOUGH` by going back to what is expected of it.
        gradient = _gradient(problem, columns, point, free)
        settled = _Point.of(problem, moved(point.composite, free, steps.step(gradient, SETTLING_DAMPING)), free)
        point = settled if settled.whole < point.whole else point
    return Fit(point.composite, point.features, point.cost)


@dataclass(frozen=True, eq=False)
class _Point:
    """Where a search stands. cost: of the problem; prior: of the values."""

    composite: CompositeModel
    features: FloatArray
    cost: float
    prior: float

    @classmethod
    def of(
        cls, problem: Problem, composite: CompositeModel, free: list[int], features: FloatArray | None = None
    ) -> _Point:
        """features: of the chain, if they are known."""
        features = composite.features(problem.state) if features is None else features
        return cls(composite, features, problem.cost(features), _prior_cost(composite, free))

    @property
    def whole(self) -> float:
        """What is to be made small."""
        return self.cost + self.prior


def _gradient(problem: Problem, columns: Sequence[Column], point: _Point, free: list[int]) -> FloatArray:
    return gradient_of(problem, columns, point.features) + _pull(point.composite, free)


def started(state: State, effect: Effect) -> FittedEffect:
    """An effect at the values where its search starts."""
    return FittedEffect(effect, effect.starts(state))


def _scale(parameter: Parameter, values: FloatArray) -> FloatArray:
    """A typical size of each value."""
    expected = 0.1 * parameter.prior if np.isfinite(parameter.prior) else 0.0
    span = min(parameter.high - parameter.low, 10.0 * max(abs(parameter.start), 0.02, expected))
    return np.maximum(np.abs(values - parameter.neutral) if parameter.neutral == 0 else np.abs(values), 0.05 * span)


def _columns(
    state: State, composite: CompositeModel, free: list[int], features: FloatArray, known: KnownColumns = NOTHING_KNOWN
) -> tuple[Column, ...]:
    columns: list[Column] = []
    for index in free:
        link = composite.links[index]
        if link.effect.name in known:
            columns += known[link.effect.name]
            continue
        blocks = link.effect.blocks(state)
        for row, parameter in enumerate(link.effect.parameters()):
            step = STEP * _scale(parameter, link.values[row])
            step = np.where(link.values[row] + step > parameter.high, -step, step)
            beside = link.values.copy()
            beside[row] = beside[row] + step
            values = [
                beside if other == index else composite.links[other].values for other in range(len(composite.links))
            ]
            change = np.nan_to_num(composite.with_values(values).features(state) - features) / step[blocks][:, None]
            precision = parameter.prior**-2 if np.isfinite(parameter.prior) else 0.0
            count = link.values.shape[1]
            columns.append(Column(change, blocks, count, np.full(count, precision)))
    return tuple(columns)


def moved(composite: CompositeModel, free: list[int], step: FloatArray) -> CompositeModel:
    """A chain whose free values went by a step f64[p], within their bounds."""
    links = list(composite.links)
    first = 0
    for index in free:
        link = links[index]
        values = link.values.copy()
        for row, parameter in enumerate(link.effect.parameters()):
            count = values.shape[1]
            values[row] = np.clip(values[row] + step[first : first + count], parameter.low, parameter.high)
            first += count
        links[index] = FittedEffect(link.effect, values)
    return CompositeModel(tuple(links))


def _prior_cost(composite: CompositeModel, free: list[int]) -> float:
    total = 0.0
    for index in free:
        link = composite.links[index]
        for row, parameter in enumerate(link.effect.parameters()):
            if np.isfinite(parameter.prior):
                total += float(np.sum((link.values[row] - parameter.middle) ** 2)) / parameter.prior**2
    return total


def _pull(composite: CompositeModel, free: list[int]) -> FloatArray:
    """Of the priors on the values as they are, f64[p]."""
    parts = []
    for link in (composite.links[index] for index in free):
        for row, parameter in enumerate(link.effect.parameters()):
            precision = parameter.prior**-2 if np.isfinite(parameter.prior) else 0.0
            parts.append(precision * (parameter.middle - link.values[row]))
    return np.concatenate(parts)
