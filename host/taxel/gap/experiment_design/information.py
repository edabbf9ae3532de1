"""What recorded presses tell of a chain's parameters, and what another press would add.

Linear in the parameters about their fit: J is the features' derivative, W what does not scatter (1 / counts^2). The
information matrix is the prior's plus J'WJ (Fisher); a press adds its own J'WJ.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, lu_factor, lu_solve

from taxel.gap.data.pair import Pair
from taxel.gap.effects.catalogue import FIXED
from taxel.gap.effects.effect import OBJECT, Effect
from taxel.gap.fitting.composite import CompositeModel
from taxel.gap.fitting.equations import Column, Problem, gradient_of, system_of
from taxel.gap.fitting.fit import start_of
from taxel.gap.fitting.judge import Judge
from taxel.gap.fitting.state import State
from taxel.types import FloatArray

LITTLE: Final = 1e-4
"""Share of a value's variance that a press must take away at least to be reckoned with."""


@dataclass(frozen=True, eq=False)
class Added:
    """What one press adds to q of the values that are known, those that it tells of.

    index: [q], which. weight: f64[F, n], 1 / counts^2. columns: of the press alone, with these values' blocks.
    """

    known: CompositeInformation
    index: NDArray[np.intp]
    weight: FloatArray
    columns: tuple[Column, ...]

    @cached_property
    def inner(self) -> FloatArray:
        """Covariance of the values so far, f64[q, q]."""
        return self.known.covariance[np.ix_(self.index, self.index)]

    @cached_property
    def system(self) -> FloatArray:
        """N = J'WJ, f64[q, q]."""
        if not self.columns:
            return np.zeros((0, 0))
        return system_of(self._problem(np.zeros_like(self.weight)), self.columns)

    def pull(self, difference: FloatArray) -> FloatArray:
        """J'Wd of a difference f64[F, n], f64[q]."""
        return gradient_of(self._problem(difference), self.columns, np.zeros((1, *difference.shape)))

    def _problem(self, target: FloatArray) -> Problem:
        """Of the press alone, f64[F, n]."""
        return Problem(self.known.judge.state, target[None], self.weight[None])

    @cached_property
    def _factors(self) -> tuple[FloatArray, NDArray[np.int32]]:
        return lu_factor(np.eye(len(self.index)) + self.system @ self.inner, check_finite=False)

    def step(self, right: FloatArray) -> FloatArray:
        """(N^-1 + C)^-1 times f64[q, ...], C being `inner`, without the inverse of N: Woodbury's identity."""
        if not len(self.index):
            return np.zeros_like(right)
        return np.asarray(lu_solve(self._factors, self.system @ right, check_finite=False))


@dataclass(frozen=True, eq=False)
class CompositeInformation:
    """What the recorded presses tell of a chain's free values.

    features: f64[C, F, n]. columns: of each parameter. covariance: f64[p, p], of all blocks of all parameters.
    """

    judge: Judge
    composite: CompositeModel
    features: FloatArray
    columns: tuple[Column, ...]
    covariance: FloatArray

    @classmethod
    def of(cls, judge: Judge, composite: CompositeModel) -> CompositeInformation:
        """chain: with fitted values; those of `FIXED` effects are not free."""
        start = start_of(judge.state, composite, FIXED)
        columns = tuple(_bounded(start.columns, composite))
        if not columns:
            return cls(judge, composite, start.features, (), np.zeros((0, 0)))
        problem = Problem(judge.state, start.features, judge.weight)
        return cls(judge, composite, start.features, columns, _inverse(system_of(problem, columns)))

    def left(self, difference: FloatArray) -> Left:
        """What these values cannot do of a difference f64[C, F, n] on the recorded presses."""
        weight = self.judge.weight
        length2 = float(np.sum(weight * difference**2))
        if not self.columns:
            return Left(self, np.zeros(0), length2)
        problem = Problem(self.judge.state, difference, weight)
        return Left(self, gradient_of(problem, self.columns, np.zeros_like(difference)), length2)

    def variance_after(self, added: Added) -> FloatArray:
        """Variances of all values once a press is added, f64[p]."""
        own = self.covariance[added.index]
        return np.asarray(np.diag(self.covariance) - np.sum(own * added.step(own), axis=0))


@dataclass(frozen=True, eq=False)
class Left:
    """A difference between two models, as far as the values of one of them are known. pull: f64[p], J'Wd. length2:
    d'Wd on the recorded presses.
    """

    known: CompositeInformation
    pull: FloatArray
    length2: float

    @cached_property
    def _moved(self) -> FloatArray:
        return np.asarray(self.known.covariance @ self.pull)

    @property
    def value(self) -> float:
        """Squared length of what stays when the values give way, in units of what scatters."""
        return max(self.length2 - float(self.pull @ self._moved), 0.0)

    def after(self, added: Added, difference: FloatArray) -> float:
        """The same with one more press, where the two differ by f64[F, n] (the criterion T of Atkinson and Fedorov
        1975, linear about the fit).
        """
        index, pull = added.index, added.pull(difference)
        moved = self._moved[index] + added.inner @ pull
        whole = float(self.pull @ self._moved + pull @ (self._moved[index] + moved))
        length2 = self.length2 + float(np.sum(added.weight * difference**2))
        return max(length2 - whole + float(moved @ added.step(moved)), 0.0)


@dataclass(frozen=True, eq=False)
class Felt:
    """A chain on presses that could be made. features: f64[C, F, n]. numbers: of each column, which of the p values
    each block is; -1 for none.
    """

    known: CompositeInformation
    features: FloatArray
    columns: tuple[Column, ...]
    numbers: tuple[NDArray[np.intp], ...]

    @classmethod
    def of(cls, known: CompositeInformation, state: State) -> Felt:
        """state: of the same hand; objects that the recorded presses lack have neutral values."""
        old = known.judge.state.pair
        composite = carried(known.composite, old, state)
        start = start_of(state, composite, FIXED)
        numbers, first = [], 0
        effects = [link.effect for link in composite.links if link.effect.name not in FIXED]
        owners = [effect for effect in effects for _ in effect.parameters()]
        for effect, column in zip(owners, known.columns, strict=True):
            block = block_numbers(effect, old, state.pair)
            numbers.append(np.where(block >= 0, first + block, -1))
            first += column.count
        return cls(known, start.features, start.columns, tuple(numbers))

    def added(self, contact: int, weight: FloatArray) -> Added:
        """What press `press` adds. weight: f64[C, F, n]."""
        w, variance = weight[contact], np.diag(self.known.covariance)
        index: list[NDArray[np.intp]] = []
        columns = []
        for column, number in zip(self.columns, self.numbers, strict=True):
            blocks = column.blocks[contact]
            told = np.bincount(blocks, np.sum(w * column.change[contact] ** 2, axis=0), column.count)
            active = np.flatnonzero((number >= 0) & (told * variance[np.maximum(number, 0)] > LITTLE))
            if not len(active):
                continue
            place = np.full(column.count, -1)
            place[active] = np.arange(len(active))
            own = place[blocks]
            change = np.where(own >= 0, column.change[contact], 0.0)[None]
            columns.append(Column(change, np.maximum(own, 0)[None], len(active), np.zeros(len(active))))
            index.append(number[active])
        numbers = np.concatenate(index) if index else np.zeros(0, np.intp)
        return Added(self.known, numbers, w, tuple(columns))


def carried(composite: CompositeModel, old: Pair, state: State) -> CompositeModel:
    """A chain with its values in the blocks of another state's presses."""
    values = []
    for link in composite.links:
        new = link.values
        if link.effect.scope == OBJECT:
            number = block_numbers(link.effect, old, state.pair)
            new = link.effect.neutral(state)
            new[:, number >= 0] = link.values[:, number[number >= 0]]
        values.append(new)
    return composite.with_values(values)


def block_numbers(effect: Effect, old: Pair, new: Pair) -> NDArray[np.intp]:
    """Of each block on a pair's presses its number on another's, -1 for an object that it lacks."""
    if effect.scope != OBJECT:
        return np.arange(int(effect.blocks_of(new).max()) + 1)
    names = [pair.object_names for pair in (old, new)]
    return np.array([names[0].index(name) if name in names[0] else -1 for name in names[1]], dtype=np.intp)


def _bounded(columns: Sequence[Column], composite: CompositeModel) -> list[Column]:
    """With what the bounds tell of each value: it is anywhere between them."""
    free = [link for link in composite.links if link.effect.name not in FIXED]
    parameters = [parameter for link in free for parameter in link.effect.parameters()]
    return [
        replace(column, precision=column.precision + 12.0 / (parameter.high - parameter.low) ** 2)
        for column, parameter in zip(columns, parameters, strict=True)
    ]


def _inverse(system: FloatArray) -> FloatArray:
    scale = 1.0 / np.sqrt(np.diag(system))
    scaled = system * np.outer(scale, scale)
    scaled[np.diag_indices_from(scaled)] += 1e-9
    inverse = cho_solve(cho_factor(scaled, check_finite=False), np.eye(len(scaled)))
    return np.asarray(inverse * np.outer(scale, scale))
