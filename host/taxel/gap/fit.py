"""Least squares for a chain of effects whose parameters hold for the hand, a board, an object or a taxel.

Levenberg-Marquardt with numeric derivatives. All blocks of one parameter are moved at once: a taxel in a cell belongs
to one block of an effect only, so one evaluation gives every block's derivative.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from taxel.gap.chain import Chain, Link
from taxel.gap.effects.effect import Effect, Parameter
from taxel.gap.state import State

Array = NDArray[np.float64]

STEP: Final = 2e-3
"""Of a parameter, relative to its scale, for the numeric derivative."""

ITERATIONS: Final = 12
ENOUGH: Final = 1e-3
"""Relative gain at which the search ends."""


@dataclass(frozen=True, eq=False)
class Problem:
    """What is to be fitted. target: f64[C, F, n], the real features. weight: f64[C, F, n], 1 / counts^2; 0 where
    unknown or not to be used.
    """

    state: State
    target: Array
    weight: Array

    def cost(self, features: Array) -> float:
        """Weighted sum of squares."""
        return float(np.sum(self.weight * (self.target - features) ** 2))


@dataclass(frozen=True, eq=False)
class Fit:
    """chain: with the fitted values. features: f64[C, F, n]. cost: of the problem, without priors."""

    chain: Chain
    features: Array
    cost: float


def fit(problem: Problem, chain: Chain, fixed: Sequence[str] = (), iterations: int = ITERATIONS) -> Fit:
    """Fit all effects of the chain but those named in `fixed`, from the values they have."""
    problem = Problem(problem.state, np.where(problem.weight > 0, problem.target, 0.0), problem.weight)
    free = [index for index, link in enumerate(chain.links) if link.effect.name not in fixed]
    features = chain.features(problem.state)
    cost, prior = problem.cost(features), _prior_cost(chain, free)
    damping = 1e-3
    for _ in range(iterations if free else 0):
        system, gradient = _normal_equations(problem, chain, free, features)
        better = False
        for _ in range(6):
            step = _solve(system, gradient, damping)
            tried = _moved(chain, free, step)
            new_features = tried.features(problem.state)
            new_cost, new_prior = problem.cost(new_features), _prior_cost(tried, free)
            if new_cost + new_prior < cost + prior:
                better = True
                break
            damping *= 8.0
        if not better:
            break
        gain = (cost + prior - new_cost - new_prior) / max(cost + prior, 1e-12)
        chain, features, cost, prior = tried, new_features, new_cost, new_prior
        damping = max(damping / 10.0, 1e-6)
        if gain < ENOUGH:
            break
    return Fit(chain, features, cost)


def started(state: State, effect: Effect) -> Link:
    """An effect at the values where its search starts."""
    values = effect.neutral(state)
    for row, parameter in enumerate(effect.parameters()):
        values[row] = parameter.start
    return Link(effect, values)


def _scale(parameter: Parameter, values: Array) -> Array:
    """A typical size of each value."""
    span = min(parameter.high - parameter.low, 10.0 * max(abs(parameter.start), 0.02))
    return np.maximum(np.abs(values - parameter.neutral) if parameter.neutral == 0 else np.abs(values), 0.05 * span)


def _normal_equations(problem: Problem, chain: Chain, free: list[int], features: Array) -> tuple[Array, Array]:
    state = problem.state
    residual = problem.target - features
    columns: list[
        tuple[Array, NDArray[np.intp], int, int]
    ] = []  # derivative, block of each (cell, taxel), first column
    first = 0
    diagonal: list[Array] = []
    pull: list[Array] = []
    for index in free:
        link = chain.links[index]
        blocks = link.effect.blocks(state)
        count = link.values.shape[1]
        for row, parameter in enumerate(link.effect.parameters()):
            step = STEP * _scale(parameter, link.values[row])
            step = np.where(link.values[row] + step > parameter.high, -step, step)
            moved = link.values.copy()
            moved[row] = moved[row] + step
            values = [moved if other == index else chain.links[other].values for other in range(len(chain.links))]
            change = chain.with_values(values).features(state) - features
            columns.append((np.nan_to_num(change) / step[blocks][:, None], blocks, first, count))
            first += count
            precision = 0.0 if np.isinf(parameter.prior) else parameter.prior**-2
            diagonal.append(np.full(count, precision))
            pull.append(precision * (parameter.neutral - link.values[row]))
    system, gradient = np.diag(np.concatenate(diagonal)), np.concatenate(pull)
    for number, (change, blocks, start, count) in enumerate(columns):
        weighted = problem.weight * change
        own = np.bincount(blocks.ravel(), np.sum(weighted * residual, axis=1).ravel(), count)
        gradient[start : start + count] += own
        for other_change, other_blocks, other_start, other_count in columns[: number + 1]:
            product = np.sum(weighted * other_change, axis=1).ravel()
            pairs = blocks.ravel() * other_count + other_blocks.ravel()
            part = np.bincount(pairs, product, count * other_count).reshape(count, other_count)
            system[start : start + count, other_start : other_start + other_count] += part
            if other_start != start:
                system[other_start : other_start + other_count, start : start + count] += part.T
    return system, gradient


def _solve(system: Array, gradient: Array, damping: float) -> Array:
    scale = np.sqrt(np.maximum(np.diag(system), 1e-12 * max(float(np.diag(system).max()), 1e-300)))
    scaled = system / np.outer(scale, scale)
    scaled[np.diag_indices_from(scaled)] += damping + 1e-9
    return np.asarray(cho_solve(cho_factor(scaled, check_finite=False), gradient / scale) / scale)


def _moved(chain: Chain, free: list[int], step: Array) -> Chain:
    links = list(chain.links)
    first = 0
    for index in free:
        link = links[index]
        values = link.values.copy()
        for row, parameter in enumerate(link.effect.parameters()):
            count = values.shape[1]
            values[row] = np.clip(values[row] + step[first : first + count], parameter.low, parameter.high)
            first += count
        links[index] = Link(link.effect, values)
    return Chain(tuple(links))


def _prior_cost(chain: Chain, free: list[int]) -> float:
    total = 0.0
    for index in free:
        link = chain.links[index]
        for row, parameter in enumerate(link.effect.parameters()):
            if np.isfinite(parameter.prior):
                total += float(np.sum((link.values[row] - parameter.neutral) ** 2)) / parameter.prior**2
    return total
