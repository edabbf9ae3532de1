"""Sequential detection of a change with a guaranteed rate of false alarms.

For each hypothesis h (quantity, place, amplitude) the detector sums, over all possible onsets, the likelihood ratio of
the steps since the onset, weighted by the prior of the hypothesis and by the time between two steps divided by T:

    M_h <- (M_h + prior_h dt / T) exp(log ratio of the step)

This is the statistic of Shiryaev and Roberts. Without a change, and if the models of `null_model.py` hold, the sum of
all M_h minus elapsed time / T is a martingale, whatever the correlation between hypotheses. An alarm at a sum of 1 then
has a mean time to a false alarm of at least T (optional stopping; Pollak, Ann. Stat. 13 (1985) 206; as e-detectors:
Shin, Ramdas and Rinaldo, 2022).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from taxel.twin.null_model import count_alternatives
from taxel.twin.places import LEVELS, Places
from taxel.twin.statistics import QUANTITIES, Quantity
from taxel.types import FloatArray

LARGEST: Final = 1e200
"""Bound of a statistic, far above the alarm level of 1."""


@dataclass(frozen=True)
class Hypothesis:
    """A possible change of one quantity at one place.

    quantity: index in `QUANTITIES`. place: index in `Places`. amplitude: size of the change in the unit of the
    quantity; NaN for an alternative without a fixed amplitude.
    """

    quantity: int
    place: int
    amplitude: float


class ChangeDetector:
    """Detector of changes of all quantities at all places of a skin (statistic: see the top of this file)."""

    def __init__(self, places: Places, hours_per_false_alarm: float) -> None:
        """Create a detector without evidence.

        places: the places of the skin, from which the prior of each quantity follows. hours_per_false_alarm: mean time
        to a false alarm, hours (T in the formula of `update`).
        """
        self._period_s = 3600.0 * hours_per_false_alarm
        self._prior = {quantity.name: _make_prior(quantity, places) for quantity in QUANTITIES}
        self.reset()

    def reset(self) -> None:
        """Set the evidence for all hypotheses to 0."""
        self.evidence = {name: np.zeros_like(prior) for name, prior in self._prior.items()}

    def update(self, elapsed_s: float, log_ratios: dict[str, FloatArray]) -> float:
        """Add a step; return the sum of the statistics of all hypotheses. A sum of at least 1 is an alarm.

        Statistic of Shiryaev and Roberts: (old value + prior * elapsed / T) * likelihood ratio of the step. elapsed_s:
        time since the step before. log_ratios: log likelihood ratios of the step, f64[P, G] (P places, G alternatives),
        by quantity. The step does not change the evidence for a quantity that it does not contain, apart from the
        elapsed time.
        """
        share = elapsed_s / self._period_s
        total = 0.0
        for name, evidence in self.evidence.items():
            evidence += self._prior[name] * share
            if name in log_ratios:
                evidence *= np.exp(np.minimum(log_ratios[name], 400.0))  # the limit avoids an overflow
                np.minimum(evidence, LARGEST, out=evidence)
            total += float(evidence.sum())
        return total

    def find_largest(self) -> Hypothesis:
        """Return the hypothesis with the largest ratio of evidence to prior; of equal hypotheses, the first.

        Its amplitude is NaN for an alternative without a fixed amplitude.
        """
        best, found = -1.0, Hypothesis(0, 0, float("nan"))
        for number, quantity in enumerate(QUANTITIES):
            prior = self._prior[quantity.name]
            evidence = np.where(prior > 0.0, self.evidence[quantity.name] / np.where(prior > 0.0, prior, 1.0), 0.0)
            index = int(evidence.argmax())
            if evidence.flat[index] > best:
                place, column = divmod(index, evidence.shape[1])
                fixed = quantity.amplitudes
                amplitude = fixed[column] if column < len(fixed) else float("nan")
                best, found = float(evidence.flat[index]), Hypothesis(number, place, amplitude)
        return found


def _make_prior(quantity: Quantity, places: Places) -> FloatArray:
    """Return the prior probability of each hypothesis of a quantity, f64[P, G] (P places, G alternatives).

    All quantities have equal probability, as have all tested levels of a quantity, all places of a level and all
    alternatives. The probability is 0 for places at which the quantity is not tested.
    """
    tested = np.isin(places.level, [LEVELS.index(level) for level in quantity.levels])
    prior = np.where(tested, places.prior, 0.0)
    prior = prior / prior.sum() if prior.sum() else prior
    alternatives = count_alternatives(quantity)
    return np.repeat(prior[:, None] / (len(QUANTITIES) * alternatives), alternatives, axis=1)
