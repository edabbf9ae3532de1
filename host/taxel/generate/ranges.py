"""A range from which a number is sampled uniformly."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Range:
    """Uniform distribution from `low` to `high`; equal bounds are a fixed number."""

    low: float
    high: float

    @property
    def is_fixed(self) -> bool:
        """Whether the range is a fixed number, with equal bounds."""
        return self.low == self.high

    def sample(self, rng: np.random.Generator) -> float:
        """Sample one value, uniform between the bounds.

        A range with equal bounds (a fixed number) also consumes a random number. The later samples of a grasp are
        therefore the same, whether this quantity is fixed or sampled.
        """
        return self.low + (self.high - self.low) * float(rng.random())

    def to_json(self) -> list[float]:
        """Return both bounds of the range as a list."""
        return [self.low, self.high]


def fixed(value: float) -> Range:
    """Make the range of a fixed number: both bounds are equal."""
    return Range(value, value)
