"""Normal equations of a least-squares problem whose parameters apply to blocks of (condition, taxel) pairs."""

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
class FitProblem:
    """Weighted least-squares problem: simulated contacts, target features and weights.

    target: f64[C, F, n] (C conditions, F features, n taxels), real features, counts. weight: f64[C, F, n], 1 /
    counts^2; 0 for unknown and for excluded features.
    """

    state: State
    target: FloatArray
    weight: FloatArray

    def cost(self, features: FloatArray) -> float:
        """Return the weighted sum of squared differences between target and predicted features f64[C, F, n] (C
        conditions, F features, n taxels).
        """
        return float(np.sum(self.weight * (self.target - features) ** 2))


@dataclass(frozen=True, eq=False)
class DerivativeColumn:
    """Derivatives of the features with respect to the values of one parameter in all its blocks.

    change: f64[C, F, n] (C conditions, F features, n taxels), change of each feature in counts per unit of the
    parameter in the block of the feature. blocks: [C, n], block of each taxel in each condition. count: number of
    blocks. precision: f64[count], 1 / variance of the prior of each value; 0 without a prior.
    """

    change: FloatArray
    blocks: NDArray[np.intp]
    count: int
    precision: FloatArray


def build_normal_matrix(problem: FitProblem, columns: Sequence[DerivativeColumn]) -> FloatArray:
    """Build the matrix of the normal equations, J^T W J plus the precisions of the priors, f64[p, p].

    p is the number of blocks of all columns, in the order of the columns.
    """
    offsets = _compute_offsets(columns)
    system = np.diag(np.concatenate([column.precision for column in columns]))
    for number, (column, offset) in enumerate(zip(columns, offsets, strict=False)):
        weighted = problem.weight * column.change
        for other, other_offset in zip(columns[: number + 1], offsets, strict=False):
            part = _sum_block_pairs(np.sum(weighted * other.change, axis=1), column, other)
            system[offset : offset + column.count, other_offset : other_offset + other.count] += part
            if other_offset != offset:
                system[other_offset : other_offset + other.count, offset : offset + column.count] += part.T
    return system


def _sum_block_pairs(product: FloatArray, one: DerivativeColumn, other: DerivativeColumn) -> FloatArray:
    """Return the sums of values f64[C, n] (C conditions, n taxels) over each pair of blocks, f64[count, count].

    Row k and column l contain the sum over the taxels and conditions in block k of column `one` and in block l of
    column `other`.
    """
    if one.blocks is other.blocks:  # equal blocks overlap only with themselves
        result: FloatArray = np.zeros((one.count, one.count))
        np.fill_diagonal(result, np.bincount(one.blocks.ravel(), product.ravel(), one.count))
        return result
    # Each pair of blocks (k, l) has the number k * other.count + l.
    pairs = one.blocks.ravel() * other.count + other.blocks.ravel()
    sums = np.asarray(np.bincount(pairs, product.ravel(), one.count * other.count), np.float64)
    return sums.reshape(one.count, other.count)


def compute_gradient(problem: FitProblem, columns: Sequence[DerivativeColumn], features: FloatArray) -> FloatArray:
    """Compute the right side of the normal equations at `features` f64[C, F, n] (C conditions, F features, n taxels),
    J^T W (target - features), f64[p] (p parameter values).

    The priors do not contribute.
    """
    weighted = problem.weight * (problem.target - features)
    sums = [
        np.bincount(column.blocks.ravel(), np.sum(weighted * column.change, axis=1).ravel(), column.count)
        for column in columns
    ]
    return np.concatenate(sums) if sums else np.zeros(0)


def _compute_offsets(columns: Sequence[DerivativeColumn]) -> list[int]:
    """Return the index of the first value of each column, and the number of all values."""
    return [0, *accumulate(column.count for column in columns)]


class DampedSolver:
    """Solver of damped normal equations (Levenberg-Marquardt) with one matrix.

    The matrix is scaled to a unit diagonal. The Cholesky factor of each damping is computed once.
    """

    def __init__(self, system: FloatArray) -> None:
        """Prepare the solver. system: f64[p, p] (p parameter values), from `build_normal_matrix`."""
        diagonal = np.diag(system)
        self._scale = np.sqrt(np.maximum(diagonal, 1e-12 * max(float(diagonal.max()), 1e-300)))
        self._scaled = system / np.outer(self._scale, self._scale)
        self._factors: dict[float, tuple[FloatArray, bool]] = {}

    def solve(self, gradient: FloatArray, damping: float) -> FloatArray:
        """Return the step of the parameters, f64[p] (p parameter values), for a right side of the normal equations
        f64[p]. damping: number that is added to the unit diagonal of the scaled matrix.
        """
        if damping not in self._factors:
            scaled = self._scaled.copy()
            scaled[np.diag_indices_from(scaled)] += damping + 1e-9
            self._factors[damping] = cho_factor(scaled, overwrite_a=True, check_finite=False)
        return np.asarray(cho_solve(self._factors[damping], gradient / self._scale, check_finite=False) / self._scale)
