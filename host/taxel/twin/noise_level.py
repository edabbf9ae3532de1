"""Noise of each taxel without contact, estimated from the squared differences of consecutive frames."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from taxel.types import BoolArray, FloatArray, IntArray

ROUNDING: float = 1.0 / 12.0
"""Variance of the rounding to whole counts."""

PAIRS_PER_SQUARE: float = 3.0
"""Variance of the logarithm of a variance from m differences of white noise, times m: (3 m - 1) / m^2, because
neighbouring differences share a sample (von Neumann et al., Ann. Math. Stat. 12 (1941) 153)."""


@dataclass(eq=False)
class NoiseLevel:
    """Sums over all steps so far. squares: f64[n], of squared differences, counts^2. pairs: f64[n], their number."""

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
        """Log ratio of a step's variance to the usual one, and its information, f64[n] each; 0 without information."""
        usable = ~skip & (pairs > PAIRS_PER_SQUARE) & (self.pairs > PAIRS_PER_SQUARE)
        ratio = np.log(_compute_variance(squares, pairs) / self.variance)
        error = PAIRS_PER_SQUARE / np.maximum(pairs, 1) + PAIRS_PER_SQUARE / np.maximum(self.pairs, 1)
        return np.where(usable, ratio, 0.0), np.where(usable, 1.0 / error, 0.0)

    def add(self, squares: IntArray, pairs: IntArray, skip: BoolArray) -> None:
        """Add a step."""
        self.squares += np.where(skip, 0, squares)
        self.pairs += np.where(skip, 0, pairs)

    def forget(self, taxels: BoolArray) -> None:
        """Expect nothing of the taxels bool[n]: their next steps define the usual noise."""
        self.squares[taxels] = 0.0
        self.pairs[taxels] = 0.0


def _compute_variance(squares: FloatArray | IntArray, pairs: FloatArray | IntArray) -> FloatArray:
    return np.asarray(squares / np.maximum(2 * pairs, 1) + ROUNDING)
