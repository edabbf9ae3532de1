"""How a board's counts change by themselves."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

S_PER_MIN: Final = 60.0


@dataclass(frozen=True, eq=False)
class Drift:
    """Counts a minute: `board` of the median taxel, `worst` of the taxel that goes its own way most, `worst_taxel`
    which one, `error` the standard error of `board` (slow noise of the supply included); `change` f64[k], `time_s`
    f64[k]: of the median taxel, in steps of half a second or so.
    """

    board: float
    error: float
    worst: float
    worst_taxel: int
    time_s: NDArray[np.float64]
    change: NDArray[np.float64]


def drift_of(raw_counts: NDArray[np.uint16], time_s: NDArray[np.float64], step_s: float = 0.5) -> Drift:
    """Slopes of means over steps, by least squares. raw_counts: u16[t, taxels]. Raises ValueError under four steps."""
    steps = int((time_s[-1] - time_s[0]) / step_s) if len(time_s) else 0
    if steps < 4:
        raise ValueError(f"expected at least {4 * step_s:g} s of frames, found {steps * step_s:g} s")
    edges = np.searchsorted(time_s, time_s[0] + step_s * np.arange(steps + 1))
    kept = [slice(first, last) for first, last in pairwise(edges) if last > first]
    means = np.array([raw_counts[part].mean(axis=0, dtype=np.float64) for part in kept])
    times = np.array([time_s[part].mean() for part in kept])
    centred = times - times.mean()
    slopes = (centred @ (means - means.mean(axis=0))) / (centred @ centred) * S_PER_MIN
    board = float(np.median(slopes))
    common = np.median(means - means.mean(axis=0), axis=1)
    residual = common - centred * board / S_PER_MIN
    error = float(np.sqrt(residual @ residual / max(len(times) - 2, 1) / (centred @ centred))) * S_PER_MIN
    error *= _inflation(residual)
    worst = int(np.argmax(np.abs(slopes - board)))
    return Drift(board, error, float(slopes[worst] - board), worst, times - times[0], common - common[0])


def _inflation(residual: NDArray[np.float64]) -> float:
    """How much larger the error of a slope is because neighbours of the residual are alike.

    Of a first-order autoregression, sqrt((1 + r) / (1 - r)) with r its correlation at lag one (Zwiers and von Storch,
    J. Climate 8, 1995): slow noise has slopes of its own.
    """
    power = residual @ residual
    if power <= 0.0:
        return 1.0
    r = min(max(float(residual[1:] @ residual[:-1] / power), 0.0), 0.9)
    return float(np.sqrt((1.0 + r) / (1.0 - r)))
