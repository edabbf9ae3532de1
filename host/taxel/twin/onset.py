"""When a change began: posterior distribution over the steps."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from taxel.twin.detector import Hypothesis
from taxel.twin.null_model import NullModel, NullModels, log_density
from taxel.twin.places import LEVELS, Places
from taxel.twin.statistics import QUANTITIES, Quantity, Scores
from taxel.types import BoolArray, FloatArray

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
        small = {name: (_shorten(value), _shorten(weight)) for name, (value, weight) in scores.items()}
        self._steps.append((start_s, end_s, small))

    def localise(self, hypothesis: Hypothesis, models: NullModels, places: Places, since_s: float) -> Hypothesis:
        """Find the quantity, place and amplitude that explain the steps since an onset best.

        hypothesis: of the detector, the result if no step has information. A place is judged by the sum of the log
        likelihood ratios of its taxels, each by itself and with the amplitude of the place: a board explains more than
        one of its taxels if all of them have changed, and less than the taxel if the others contradict. Of places with
        the same result the smallest is returned.
        """
        best, found = 0.0, hypothesis
        for number, quantity in enumerate(QUANTITIES):
            own = [scores[quantity.name] for _, end, scores in self._steps if quantity.name in scores and end > since_s]
            if own:
                value, weight = (np.stack([pair[part] for pair in own]).astype(np.float64) for part in (0, 1))
                ratio, amplitude = _judge_places(quantity, value, weight, models[quantity.name], places)
                index = int(ratio.argmax())
                if ratio[index] > best:
                    best, found = float(ratio[index]), Hypothesis(number, index, float(amplitude[index]))
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
        if not chosen:
            return Onset(since_s, since_s, since_s, hypothesis.amplitude)
        starts, ends, value, weight = (np.array(column) for column in zip(*chosen, strict=True))
        # Without a fixed amplitude, the latest step gives it: such a change is clear in one step.
        latest = float(value[np.flatnonzero(weight > 0.0)[-1:]].sum())
        found = hypothesis.amplitude if np.isfinite(hypothesis.amplitude) else latest or 1.0
        grid = found * np.geomspace(0.5, 2.0, AMPLITUDE_STEPS)
        usable = weight > 0.0
        deviation = model.compute_deviation(np.where(usable, weight, 1.0))
        ratio = np.where(
            usable[:, None],
            log_density(value[:, None] - grid, deviation[:, None], model.degrees_of_freedom)
            - log_density(value, deviation, model.degrees_of_freedom)[:, None],
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


def _shorten(values: FloatArray) -> FloatArray:
    """The values in single precision, which halves the memory of the history."""
    return np.asarray(values, np.float32)


def _judge_places(
    quantity: Quantity, value: FloatArray, weight: FloatArray, models: Mapping[int, NullModel], places: Places
) -> tuple[FloatArray, FloatArray]:
    """Log likelihood ratio of each place with its own amplitude, and the amplitude, f64[P] each.

    value, weight: f64[S, P], estimates and information of the steps. Places that are not tested have a ratio of minus
    infinity.
    """
    total = weight.sum(axis=0)
    amplitude = np.where(total > 0.0, (value * weight).sum(axis=0) / np.where(total > 0.0, total, 1.0), 0.0)
    tested = np.isin(places.level, [LEVELS.index(level) for level in quantity.levels])
    # Over many steps a change far below the smallest amplitude becomes certain; such a change raises no alarm.
    tested &= np.abs(amplitude) >= 0.5 * min(map(abs, quantity.amplitudes))
    taxel = LEVELS.index("taxel")
    if taxel not in models:  # a quantity of boards: each board by itself
        levels = [_compare(value, weight, amplitude, models[level], places.level == level) for level in models]
        return np.where(tested, np.sum(levels, axis=0), -np.inf), amplitude
    members = places.members
    place = np.repeat(np.arange(len(places)), np.diff(members.indptr))
    taxels = members.indices
    every = np.ones(len(taxels), dtype=bool)
    own = _compare(value[:, taxels], weight[:, taxels], amplitude[place], models[taxel], every)
    ratio = np.bincount(place, own, len(places))
    return np.where(tested & (total > 0.0), ratio, -np.inf), amplitude


def _compare(
    value: FloatArray, weight: FloatArray, amplitude: FloatArray, model: NullModel, rows: BoolArray
) -> FloatArray:
    """Log likelihood ratio of an amplitude against no change, summed over the steps, f64[m]; 0 outside of `rows`."""
    usable = (weight > 0.0) & rows
    deviation = model.compute_deviation(np.where(usable, weight, 1.0))
    changed = log_density(value - amplitude, deviation, model.degrees_of_freedom)
    return np.asarray(
        np.where(usable, changed - log_density(value, deviation, model.degrees_of_freedom), 0.0).sum(axis=0)
    )


def _find_quantiles(posterior: FloatArray, begin: FloatArray, end: FloatArray) -> tuple[float, float, float]:
    """Median, 2.5 % and 97.5 % quantile of a time that is uniform within each interval, seconds."""
    total = np.concatenate([[0.0], np.cumsum(posterior) / posterior.sum()])
    found = []
    for level in (0.5, 0.025, 0.975):
        number = min(int(np.searchsorted(total, level, side="right")) - 1, len(begin) - 1)
        share = (level - total[number]) / max(total[number + 1] - total[number], 1e-300)
        found.append(float(begin[number] + share * (end[number] - begin[number])))
    return found[0], found[1], found[2]
