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
from taxel.twin.statistics import QUANTITIES, Estimates, Quantity
from taxel.types import BoolArray, FloatArray

REMEMBERED: Final = 1000
"""Number of steps that are kept for the estimate of an onset: hours of use. An onset before the oldest kept step is
reported at the time of this step."""

AMPLITUDE_STEPS: Final = 41
"""Number of amplitudes at which the likelihood of a change is evaluated, between half and twice the detected
amplitude."""


@dataclass(frozen=True)
class Onset:
    """Estimated time at which a change began.

    time_s: median of the posterior, seconds on the clock of the stream. low_s, high_s: bounds of the 95 % interval.
    amplitude: amplitude of the change with the largest likelihood, in the unit of the quantity.
    """

    time_s: float
    low_s: float
    high_s: float
    amplitude: float


class StepHistory:
    """Estimates of all quantities at all places in the latest steps, kept for the estimate of an onset."""

    def __init__(self, places: Places) -> None:
        """Create an empty history."""
        self._level = places.level
        self._steps: deque[tuple[float, float, Estimates]] = deque(maxlen=REMEMBERED)

    def add(self, start_s: float, end_s: float, estimates: Estimates) -> None:
        """Add the estimates of a step; the oldest step is dropped if there are more than `REMEMBERED`."""
        single = {
            name: (_to_single_precision(value), _to_single_precision(weight))
            for name, (value, weight) in estimates.items()
        }
        self._steps.append((start_s, end_s, single))

    def localise(self, hypothesis: Hypothesis, models: NullModels, places: Places, since_s: float) -> Hypothesis:
        """Find the quantity, place and amplitude that explain the steps that end after `since_s` best.

        hypothesis: from the detector; returned unchanged if no place explains the steps better than no change. The
        score of a place is the sum of the log likelihood ratios of its taxels, each with the amplitude of the place. If
        all taxels of a board have changed, the score of the board exceeds the score of each of its taxels. If only one
        taxel has changed, the other taxels lower the score of the board below that of this taxel. Among places with the
        same score, the smallest place is returned.
        """
        best, found = 0.0, hypothesis
        for number, quantity in enumerate(QUANTITIES):
            pairs = [
                estimates[quantity.name]
                for _, end, estimates in self._steps
                if quantity.name in estimates and end > since_s
            ]
            if pairs:
                value, weight = (np.stack([pair[part] for pair in pairs]).astype(np.float64) for part in (0, 1))
                ratio, amplitude = _compute_place_ratios(quantity, value, weight, models[quantity.name], places)
                index = int(ratio.argmax())
                if ratio[index] > best:
                    best, found = float(ratio[index]), Hypothesis(number, index, float(amplitude[index]))
        return found

    def estimate_onset(self, hypothesis: Hypothesis, models: NullModels, since_s: float) -> Onset:
        """Estimate when the change of a hypothesis began.

        since_s: time of the last alarm; the change began later. The onset is `since_s` if no step has started since.
        """
        quantity = QUANTITIES[hypothesis.quantity]
        model = models[quantity.name][int(self._level[hypothesis.place])]
        chosen = [
            (start, end, *(float(part[hypothesis.place]) for part in estimates[quantity.name]))
            for start, end, estimates in self._steps
            if quantity.name in estimates and start >= since_s
        ]
        if not chosen:
            return Onset(since_s, since_s, since_s, hypothesis.amplitude)
        starts, ends, value, weight = (np.array(column) for column in zip(*chosen, strict=True))
        # A hypothesis without a fixed amplitude takes it from the latest step: such a change is clear in one step.
        latest = float(value[np.flatnonzero(weight > 0.0)[-1:]].sum())
        # The amplitude is uncertain by a factor of two: the likelihoods of a grid of amplitudes are added.
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
        # A change during a step may or may not be visible in this step: the onset lies between the end of the last
        # unchanged step and the end of the first changed step.
        # The evidence of an onset at a step is the sum of the ratios of this step and all later steps.
        evidence = np.cumsum(ratio[::-1], axis=0)[::-1]
        before = np.concatenate([[max(since_s, starts[0])], ends[:-1]])
        log_posterior = np.logaddexp.reduce(evidence, axis=1) + np.log(np.maximum(ends - before, 1e-9))
        posterior = np.exp(log_posterior - log_posterior.max())
        time_s, low_s, high_s = _find_quantiles(posterior, before, ends)
        amplitude = float(grid[int(np.argmax(evidence[int(np.argmax(log_posterior))]))])
        return Onset(time_s, low_s, high_s, amplitude)


def _to_single_precision(values: FloatArray) -> FloatArray:
    """Convert to 32-bit floats, which halves the memory of the history."""
    return np.asarray(values, np.float32)


def _compute_place_ratios(
    quantity: Quantity, value: FloatArray, weight: FloatArray, models: Mapping[int, NullModel], places: Places
) -> tuple[FloatArray, FloatArray]:
    """Compute each place's log likelihood ratio of a change against no change, and the fitted amplitude, f64[P] each.

    value, weight: f64[S, P] (S steps, P places), estimates of the amplitude and their information (inverse variance).
    The fitted amplitude of a place is the weighted mean of its estimates. The ratio of a place is the sum of the ratios
    of its taxels, each for the amplitude of the place. A quantity without a null model of taxels is a quantity of
    boards: its ratio follows from the place's own estimates. The ratio is minus infinity for places at which the
    quantity is not tested, and for amplitudes below half of the quantity's smallest amplitude.
    """
    total = weight.sum(axis=0)
    amplitude = np.where(total > 0.0, (value * weight).sum(axis=0) / np.where(total > 0.0, total, 1.0), 0.0)
    tested = np.isin(places.level, [LEVELS.index(level) for level in quantity.levels])
    # Over many steps a change far below the smallest amplitude becomes certain; such a change raises no alarm.
    tested &= np.abs(amplitude) >= 0.5 * min(map(abs, quantity.amplitudes))
    taxel_level = LEVELS.index("taxel")
    if taxel_level not in models:  # a quantity of boards: use the own estimates of each place
        levels = [
            _sum_log_likelihood_ratios(value, weight, amplitude, models[level], places.level == level)
            for level in models
        ]
        return np.where(tested, np.sum(levels, axis=0), -np.inf), amplitude
    members = places.members
    place = np.repeat(np.arange(len(places)), np.diff(members.indptr))
    taxels = members.indices
    all_included = np.ones(len(taxels), dtype=bool)
    member_ratio = _sum_log_likelihood_ratios(
        value[:, taxels], weight[:, taxels], amplitude[place], models[taxel_level], all_included
    )
    ratio = np.bincount(place, member_ratio, len(places))
    return np.where(tested & (total > 0.0), ratio, -np.inf), amplitude


def _sum_log_likelihood_ratios(
    value: FloatArray, weight: FloatArray, amplitude: FloatArray, model: NullModel, included: BoolArray
) -> FloatArray:
    """Sum the log likelihood ratios of `amplitude` against no change over the steps, f64[m] for m places.

    value, weight: f64[S, m] (S steps), estimates of the amplitude and their information; estimates with information 0
    contribute nothing. amplitude: f64[m]. included: bool[m]; the sum is 0 for the other places.
    """
    usable = (weight > 0.0) & included
    deviation = model.compute_deviation(np.where(usable, weight, 1.0))
    changed = log_density(value - amplitude, deviation, model.degrees_of_freedom)
    return np.asarray(
        np.where(usable, changed - log_density(value, deviation, model.degrees_of_freedom), 0.0).sum(axis=0)
    )


def _find_quantiles(posterior: FloatArray, begin: FloatArray, end: FloatArray) -> tuple[float, float, float]:
    """Return the median, the 2.5 % quantile and the 97.5 % quantile of a time, seconds.

    posterior: f64[S], probability of each of S consecutive time intervals, not normalised. begin, end: f64[S], bounds
    of the intervals. The time is uniformly distributed within an interval.
    """
    total = np.concatenate([[0.0], np.cumsum(posterior) / posterior.sum()])
    found = []
    for level in (0.5, 0.025, 0.975):
        number = min(int(np.searchsorted(total, level, side="right")) - 1, len(begin) - 1)
        share = (level - total[number]) / max(total[number + 1] - total[number], 1e-300)
        found.append(float(begin[number] + share * (end[number] - begin[number])))
    return found[0], found[1], found[2]
