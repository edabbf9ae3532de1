"""Noise of each taxel without contact, estimated from the squared differences of consecutive frames."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from taxel.types import BoolArray, FloatArray, IntArray

ROUNDING: float = 1.0 / 12.0
"""Variance that rounding to whole counts adds, counts^2."""

PAIRS_PER_SQUARE: float = 3.0
"""The logarithm of a variance that is estimated from m differences of white noise has about the variance 3 / m, exactly
(3 m - 1) / m^2, because neighbouring differences share a sample (von Neumann et al., Ann. Math. Stat. 12 (1941)
153)."""


@dataclass(eq=False)
class NoiseLevel:
    """Sums over all steps so far, from which the usual noise of each of n taxels follows.

    squares: f64[n], sum of the squared differences of consecutive frames, counts^2. pairs: f64[n], number of
    differences.
    """

    squares: FloatArray
    pairs: FloatArray

    def copy(self) -> NoiseLevel:
        """Return an independent copy."""
        return NoiseLevel(self.squares.copy(), self.pairs.copy())

    @property
    def variance(self) -> FloatArray:
        """Noise variance of one frame, f64[n], counts^2."""
        return _compute_variance(self.squares, self.pairs)

    def compare(self, squares: IntArray, pairs: IntArray, skip: BoolArray) -> tuple[FloatArray, FloatArray]:
        """Return ln(noise variance of a step / usual noise variance) and its information (inverse variance), f64[n]
        each.

        squares, pairs: i64[n], sums of the step. skip: bool[n], taxels that are not compared. Both values are 0 for
        these taxels and for taxels with too few differences.
        """
        usable = ~skip & (pairs > PAIRS_PER_SQUARE) & (self.pairs > PAIRS_PER_SQUARE)
        ratio = np.log(_compute_variance(squares, pairs) / self.variance)
        # The log of a variance estimated from m differences has the variance PAIRS_PER_SQUARE / m.
        error = PAIRS_PER_SQUARE / np.maximum(pairs, 1) + PAIRS_PER_SQUARE / np.maximum(self.pairs, 1)
        return np.where(usable, ratio, 0.0), np.where(usable, 1.0 / error, 0.0)

    def add(self, squares: IntArray, pairs: IntArray, skip: BoolArray) -> None:
        """Add the sums of a step, i64[n] each, without the taxels `skip` bool[n]."""
        self.squares += np.where(skip, 0, squares)
        self.pairs += np.where(skip, 0, pairs)

    def forget(self, taxels: BoolArray) -> None:
        """Discard the usual noise of the taxels bool[n]: their next steps define it anew."""
        self.squares[taxels] = 0.0
        self.pairs[taxels] = 0.0


def _compute_variance(squares: FloatArray | IntArray, pairs: FloatArray | IntArray) -> FloatArray:
    return np.asarray(squares / np.maximum(2 * pairs, 1) + ROUNDING)
