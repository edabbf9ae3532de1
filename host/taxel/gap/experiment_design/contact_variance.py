"""What a press that was not made would scatter, as those that were made tell it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from taxel.gap.features.features import Layout
from taxel.gap.fitting.judge import Judge, tolerance2
from taxel.gap.fitting.state import TOUCHED_COUNTS
from taxel.types import FloatArray


@dataclass(frozen=True, eq=False)
class ContactVariance:
    """What a press like the recorded ones scatters, counts^2. other: f64[F, n], of features that are no drops. still,
    share2: f64[B], the variance of untouched taxels' drops, and the relative one of touched taxels'.
    """

    layout: Layout
    other: FloatArray
    still: FloatArray
    share2: FloatArray

    @classmethod
    def of(cls, judge: Judge) -> ContactVariance:
        """As the sessions of a recording tell it."""
        layout, real = judge.layout, judge.sessions
        variance = np.nan_to_num(real.variance) / np.maximum(real.known.sum(axis=1), 1)
        signal_counts, own = judge.state.mean[:, : layout.bins], variance[:, : layout.bins]
        touched = np.abs(signal_counts) > TOUCHED_COUNTS
        quiet = np.where(touched, 0.0, own).sum(axis=(0, 2)) / np.maximum((~touched).sum(axis=(0, 2)), 1)
        above = np.where(touched, np.maximum(own - quiet[:, None], 0.0), 0.0).sum(axis=(0, 2))
        squares = np.where(touched, signal_counts**2, 0.0).sum(axis=(0, 2))
        return cls(layout, variance.mean(axis=0), quiet, above / np.maximum(squares, TOUCHED_COUNTS**2))

    def weight(self, model: FloatArray, expected: FloatArray) -> FloatArray:
        """Of presses that were not made, 1 / counts^2. model, expected: features f64[C, F, n] of the simulator, and of
        a chain.
        """
        variance = np.broadcast_to(self.other, model.shape).copy()
        signal_counts = np.maximum(np.abs(model), np.abs(expected))[:, : self.layout.bins]
        variance[:, : self.layout.bins] = self.still[:, None] + self.share2[:, None] * signal_counts**2
        return self.layout.weight[:, None] / (variance + tolerance2(self.layout, model, expected))

    def weight_again(self, judge: Judge, expected: FloatArray) -> FloatArray:
        """What a second recording of the same presses adds: their scatter is halved, an imperfect solver stays."""
        error2 = tolerance2(self.layout, judge.state.mean, expected)
        with np.errstate(divide="ignore"):
            variance = np.maximum(self.layout.weight[:, None] / judge.weight - error2, 0.0)
        twice = self.layout.weight[:, None] / (0.5 * variance + error2)
        return np.where(judge.weight > 0.0, np.maximum(twice - judge.weight, 0.0), 0.0)
