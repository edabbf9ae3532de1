"""When a change began: posterior distribution over the steps."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Final

import numpy as np

from taxel.twin.detector import Hypothesis
from taxel.twin.null_model import NullModels, compute_log_ratios, log_density
from taxel.twin.places import LEVELS, Places
from taxel.twin.statistics import QUANTITIES, Scores
from taxel.types import FloatArray

REMEMBERED: Final = 1000
"""Steps that are kept for the estimate of an onset: hours of use. An earlier onset is reported as the first of them."""

AMPLITUDE_STEPS: Final = 41
"""Amplitudes at which the likelihood of a change is evaluated, between half and twice the detected one."""


@dataclass(frozen=True)
class Onset:
    """Estimate of an onset. time_s: median of the posterior. low_s, high_s: interval of 95 %. amplitude: best fit."""

    time_s: float
    low_s: float
    high_s: float
    amplitude: float


class StepHistory:
    """Estimates of the latest steps, kept for the estimate of an onset."""

    def __init__(self, places: Places) -> None:
        """Create an empty history."""
        self._level = places.level
        self._steps: deque[tuple[float, float, Scores]] = deque(maxlen=REMEMBERED)

    def add(self, start_s: float, end_s: float, scores: Scores) -> None:
        """Add the estimates and information of the places of a step, by quantity."""
        small = {
            name: (value.astype(np.float32), weight.astype(np.float32)) for name, (value, weight) in scores.items()
        }
        self._steps.append((start_s, end_s, small))

    def localise(self, hypothesis: Hypothesis, models: NullModels, places: Places, since_s: float) -> Hypothesis:
        """Find the quantity, place and amplitude that explain the steps since an onset best.

        hypothesis: of the detector, which is kept for quantities without taxels. A place is judged by the sum of the log
        likelihood ratios of its taxels, each by itself: a board explains more than one of its taxels if all of them have
        changed, and less than the taxel if the others contradict.
        """
        best, found = -np.inf, hypothesis
        taxel = LEVELS.index("taxel")
        for number, quantity in enumerate(QUANTITIES):
            own = [scores[quantity.name] for start, _, scores in self._steps if quantity.name in scores and start >= since_s]
            if not own:
                continue
            sums = sum(compute_log_ratios(quantity, pair, models[quantity.name], places.level) for pair in own)
            if taxel in models[quantity.name]:
                ratio = places.members @ np.asarray(sums)[: places.members.shape[1]]
                tested = np.isin(places.level, [LEVELS.index(level) for level in quantity.levels])
                ratio = np.where(tested[:, None], ratio, -np.inf)
            else:
                ratio = np.asarray(sums)
            index = int(ratio.argmax())  # of places with the same loaded taxels the smallest, which comes first
            if ratio.flat[index] > best:
                place, amplitude = divmod(index, ratio.shape[1])
                best, found = float(ratio.flat[index]), Hypothesis(number, place, amplitude)
        return found

    def estimate_onset(self, hypothesis: Hypothesis, models: NullModels, since_s: float) -> Onset:
        """Estimate the onset of a change.

        since_s: the change began after this time (the last alarm).
        """
        quantity = QUANTITIES[hypothesis.quantity]
        model = models[quantity.name][int(self._level[hypothesis.place])]
        chosen = [
            (start, end, *(float(part[hypothesis.place]) for part in scores[quantity.name]))
            for start, end, scores in self._steps
            if quantity.name in scores and start >= since_s
        ]
        found = quantity.amplitudes[hypothesis.amplitude]
        if not chosen:
            return Onset(since_s, since_s, since_s, found)
        starts, ends, value, weight = (np.array(column) for column in zip(*chosen, strict=True))
        grid = found * np.geomspace(0.5, 2.0, AMPLITUDE_STEPS)
        usable = weight > 0.0
        deviation = model.compute_deviation(np.where(usable, weight, 1.0))
        ratio = np.where(
            usable[:, None],
            log_density(value[:, None] - grid, deviation[:, None], model.freedom)
            - log_density(value, deviation, model.freedom)[:, None],
            0.0,
        )
        # A change during a step is visible in it or not: the onset lies between the end of the last unchanged step and
        # the end of the first changed one.
        evidence = np.cumsum(ratio[::-1], axis=0)[::-1]
        before = np.concatenate([[max(since_s, starts[0])], ends[:-1]])
        log_posterior = np.logaddexp.reduce(evidence, axis=1) + np.log(np.maximum(ends - before, 1e-9))
        posterior = np.exp(log_posterior - log_posterior.max())
        time_s, low_s, high_s = _find_quantiles(posterior, before, ends)
        amplitude = float(grid[int(np.argmax(evidence[int(np.argmax(log_posterior))]))])
        return Onset(time_s, low_s, high_s, amplitude)


def _find_quantiles(posterior: FloatArray, begin: FloatArray, end: FloatArray) -> tuple[float, float, float]:
    """Median, 2.5 % and 97.5 % quantile of a time that is uniform within each interval, seconds."""
    total = np.concatenate([[0.0], np.cumsum(posterior) / posterior.sum()])
    found = []
    for level in (0.5, 0.025, 0.975):
        number = min(int(np.searchsorted(total, level, side="right")) - 1, len(begin) - 1)
        share = (level - total[number]) / max(total[number + 1] - total[number], 1e-300)
        found.append(float(begin[number] + share * (end[number] - begin[number])))
    return found[0], found[1], found[2]
