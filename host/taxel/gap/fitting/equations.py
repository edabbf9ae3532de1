"""Normal equations of least squares whose parameters hold for blocks of (cell, taxel)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from taxel.gap.fitting.state import State
from taxel.types import FloatArray


@dataclass(frozen=True, eq=False)
class Problem:
    """What is to be fitted. target: f64[C, F, n], the real features. weight: f64[C, F, n], 1 / counts^2; 0 where
    unknown or not to be used.
    """

    state: State
    target: FloatArray
    weight: FloatArray

    def cost(self, features: FloatArray) -> float:
        """Weighted sum of squares."""
        return float(np.sum(self.weight * (self.target - features) ** 2))


@dataclass(frozen=True, eq=False)
class Column:
    """How the features change with a parameter: change f64[C, F, n] a unit, block of each (cell, taxel) [C, n], and
    the number of blocks. precision: of its prior, f64[count].
    """

    change: FloatArray
    blocks: NDArray[np.intp]
    count: int
    precision: FloatArray


def system_of(problem: Problem, columns: Sequence[Column]) -> FloatArray:
    """Matrix of the normal equations over all blocks of all columns, f64[p, p]."""
    starts = _starts(columns)
    system = np.diag(np.concatenate([column.precision for column in columns]))
    for number, (column, start) in enumerate(zip(columns, starts, strict=False)):
        weighted = problem.weight * column.change
        for other, other_start in zip(columns[: number + 1], starts, strict=False):
            part = _blockwise(np.sum(weighted * other.change, axis=1), column, other)
            system[start : start + column.count, other_start : other_start + other.count] += part
            if other_start != start:
                system[other_start : other_start + other.count, start : start + column.count] += part.T
    return system


def _blockwise(product: FloatArray, one: Column, other: Column) -> FloatArray:
    """Sums of f64[C, n] over the blocks of two columns, f64[count, count]."""
    if one.blocks is other.blocks:  # each block meets itself alone
        result: FloatArray = np.zeros((one.count, one.count))
        np.fill_diagonal(result, np.bincount(one.blocks.ravel(), product.ravel(), one.count))
        return result
    pairs = one.blocks.ravel() * other.count + other.blocks.ravel()
    sums = np.asarray(np.bincount(pairs, product.ravel(), one.count * other.count), np.float64)
    return sums.reshape(one.count, other.count)


def gradient_of(problem: Problem, columns: Sequence[Column], features: FloatArray) -> FloatArray:
    """Right side of the normal equations for a step from `features`, f64[p], without priors."""
    weighted = problem.weight * (problem.target - features)
    parts = [
        np.bincount(column.blocks.ravel(), np.sum(weighted * column.change, axis=1).ravel(), column.count)
        for column in columns
    ]
    return np.concatenate(parts) if parts else np.zeros(0)


def _starts(columns: Sequence[Column]) -> list[int]:
    return [0, *accumulate(column.count for column in columns)]


class Steps:
    """Damped steps of one system; each damping is factorised once."""

    def __init__(self, system: FloatArray) -> None:
        diagonal = np.diag(system)
        self._scale = np.sqrt(np.maximum(diagonal, 1e-12 * max(float(diagonal.max()), 1e-300)))
        self._scaled = system / np.outer(self._scale, self._scale)
        self._known: dict[float, tuple[FloatArray, bool]] = {}

    def step(self, gradient: FloatArray, damping: float) -> FloatArray:
        """f64[p]."""
        if damping not in self._known:
            scaled = self._scaled.copy()
            scaled[np.diag_indices_from(scaled)] += damping + 1e-9
            self._known[damping] = cho_factor(scaled, overwrite_a=True, check_finite=False)
        return np.asarray(cho_solve(self._known[damping], gradient / self._scale, check_finite=False) / self._scale)
