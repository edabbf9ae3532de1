"""Exponential tracking, the usual baseline of touch controllers, for the comparison."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from taxel.signal import ACTIVATION_THRESHOLD_COUNTS
from taxel.types import CountArray, FloatArray

TIME_CONSTANT_S = 60.0
"""Time constant of the tracking (chosen: slower than a grasp of ten seconds, faster than the drift)."""


@dataclass(eq=False)
class ExponentialBaseline:
    """Baseline b that follows the raw count y by db/dt = (y - b) / tau. mean: f64[n], counts.

    freezes: a taxel whose signal exceeds the activation threshold is not followed.
    """

    mean: FloatArray
    freezes: bool
    _last_s: float | None = None

    def update(self, time_s: float, raw_counts: CountArray) -> None:
        """Update the exponentially averaged baseline with the frame `raw_counts` u16[n] of the time `time_s`, seconds.

        With `freezes`, the baseline of an active taxel does not change. Contact lowers the raw count, so a taxel is
        active if its count is more than the activation threshold below the baseline.
        """
        if self._last_s is not None:
            share = -np.expm1(-(time_s - self._last_s) / TIME_CONSTANT_S)
            change = share * (raw_counts - self.mean)
            if self.freezes:
                change[self.mean - raw_counts > ACTIVATION_THRESHOLD_COUNTS] = 0.0
            self.mean = self.mean + change
        self._last_s = time_s
