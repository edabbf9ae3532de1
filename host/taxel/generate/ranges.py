"""A number that is drawn, evenly between two bounds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Range:
    """From `low` to `high`, each value as likely; both the same: a fixed number."""

    low: float
    high: float

    @property
    def fixed(self) -> bool:
        """Whether there is nothing to draw."""
        return self.low == self.high

    def draw(self, rng: np.random.Generator) -> float:
        """One value. A fixed number takes a draw too, so that the draws after it stay what they are."""
        return self.low + (self.high - self.low) * float(rng.random())

    def to_json(self) -> list[float]:
        """Both bounds."""
        return [self.low, self.high]


def fixed(value: float) -> Range:
    """A range of one number."""
    return Range(value, value)
