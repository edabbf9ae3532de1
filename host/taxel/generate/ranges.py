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
        """Whether both bounds are equal."""
        return self.low == self.high

    def sample(self, rng: np.random.Generator) -> float:
        """One value. A fixed number also consumes a random number, so that later samples do not change."""
        return self.low + (self.high - self.low) * float(rng.random())

    def to_json(self) -> list[float]:
        """Both bounds."""
        return [self.low, self.high]


def fixed(value: float) -> Range:
    """A range with equal bounds."""
    return Range(value, value)
