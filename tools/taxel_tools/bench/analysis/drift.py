"""Drift of an untouched board: slopes of its raw counts over time."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np

from taxel.types import CountArray, FloatArray

S_PER_MIN: Final = 60.0


@dataclass(frozen=True, eq=False)
class Drift:
    """Slopes in counts/min, and the change of the board over time.

    `board`: slope of the median taxel. `error`: standard error of `board`, including slow noise of the supply. `worst`:
    slope of the taxel with the largest deviation from the median taxel, relative to the median; `worst_taxel`: its
    index. `time_s` f64[k], `change` f64[k]: change of the median taxel in counts, in steps of about 0.5 s.
    """

    board: float
    error: float
    worst: float
    worst_taxel: int
    time_s: FloatArray
    change: FloatArray


def fit_drift(raw_counts: CountArray, time_s: FloatArray, step_s: float = 0.5) -> Drift:
    """Fit the drift of each taxel: the slope of its raw counts over time, by least squares.

    raw_counts: u16[t, taxels], t frames; time_s: f64[t]. The frames are first averaged over steps of `step_s` seconds.
    Raises ValueError if the record is shorter than four steps.
    """
    steps = int((time_s[-1] - time_s[0]) / step_s) if len(time_s) else 0
    if steps < 4:
        raise ValueError(f"expected at least {4 * step_s:g} s of frames, found {steps * step_s:g} s")
    edges = np.searchsorted(time_s, time_s[0] + step_s * np.arange(steps + 1))
    parts = [slice(first, last) for first, last in pairwise(edges) if last > first]
    means = np.array([raw_counts[part].mean(axis=0, dtype=np.float64) for part in parts])
    times = np.array([time_s[part].mean() for part in parts])
    centred = times - times.mean()
    slopes = (centred @ (means - means.mean(axis=0))) / (centred @ centred) * S_PER_MIN
    board = float(np.median(slopes))
    # The error follows from the residual of the median taxel, because slow noise of the supply is common to all taxels.
    common = np.median(means - means.mean(axis=0), axis=1)
    residual = common - centred * board / S_PER_MIN
    error = float(np.sqrt(residual @ residual / max(len(times) - 2, 1) / (centred @ centred))) * S_PER_MIN
    error *= _compute_error_factor(residual)
    worst = int(np.argmax(np.abs(slopes - board)))
    return Drift(board, error, float(slopes[worst] - board), worst, times - times[0], common - common[0])


def _compute_error_factor(residual: FloatArray) -> float:
    """Compute the factor by which autocorrelation of the residual increases the standard error of a slope.

    residual: f64[k], counts. For a first-order autoregression the factor is sqrt((1 + r) / (1 - r)) with the
    correlation r at lag one (Zwiers and von Storch, J. Climate 8, 1995); r is limited to 0 to 0.9.
    """
    power = residual @ residual
    if power <= 0.0:
        return 1.0
    r = min(max(float(residual[1:] @ residual[:-1] / power), 0.0), 0.9)
    return float(np.sqrt((1.0 + r) / (1.0 - r)))
