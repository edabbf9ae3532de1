"""What the contacts of the current session add to the reference: a session differs from the reference as a whole."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from taxel.twin.schedule import Condition
from taxel.types import BoolArray, FloatArray

RELEARNED: float = 100.0
"""Variance of a changed taxel's new state relative to the variance between contacts: the first contacts determine the
new expectation (a hundred: an almost uniform prior)."""


@dataclass(eq=False)
class LiveSession:
    """Expected signals of a session, updated with every contact (normal model with known variance ratio).

    ratio: f64[BINS, n], variance between sessions relative to the variance between the contacts of a session. The mean
    of a condition in the reference has an error of its own, which all contacts of the session share: with R repeats, a
    further variance of 1 / R. Without it, the error of the mean would count as a change.
    """

    ratio: FloatArray
    _sums: dict[Condition, tuple[FloatArray, FloatArray]] = field(default_factory=dict)

    @classmethod
    def start(cls, session_ratio: FloatArray, n: int) -> LiveSession:
        """Start a session. session_ratio: f64[BINS], of the reference."""
        return cls(np.repeat(session_ratio[:, None], n, axis=1))

    def predict(self, condition: Condition, mean: FloatArray, repeats: int) -> tuple[FloatArray, FloatArray]:
        """Expected signals f64[BINS, n], and factor of their variance f64[BINS, n].

        mean: of the condition in the reference. repeats: contacts in that mean.
        """
        ratio = self.ratio + 1.0 / repeats
        if condition not in self._sums:
            return mean, 1.0 + ratio
        number, deviation = self._sums[condition]
        gain = ratio / (1.0 + number * ratio)
        return mean + gain * deviation, 1.0 + gain

    def add(self, condition: Condition, mean: FloatArray, signal: FloatArray) -> None:
        """Add the signals f64[BINS, n] of a contact; NaN: no data."""
        usable = np.isfinite(signal)
        number, deviation = self._sums.setdefault(condition, (np.zeros_like(mean), np.zeros_like(mean)))
        number += usable
        deviation += np.where(usable, signal - mean, 0.0)

    def relearn(self, taxels: BoolArray) -> None:
        """Expect nothing of the taxels bool[n] that have changed: their next contacts define the expectation."""
        self.ratio[:, taxels] = RELEARNED
        for number, deviation in self._sums.values():
            number[:, taxels] = 0.0
            deviation[:, taxels] = 0.0

    def restore(self, session_ratio: FloatArray, taxels: BoolArray) -> None:
        """Expect the reference again of the taxels bool[n], after a fault has been removed."""
        self.ratio[:, taxels] = session_ratio[:, None]
        for number, deviation in self._sums.values():
            number[:, taxels] = 0.0
            deviation[:, taxels] = 0.0
