"""Test whether the fault of an alarm has been removed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from taxel.twin.detector import LARGEST, Hypothesis
from taxel.twin.events import Alarm
from taxel.twin.null_model import NullModels, log_density
from taxel.twin.schedule import Condition
from taxel.twin.statistics import QUANTITIES, Estimates
from taxel.types import IntArray


@dataclass(eq=False)
class ClearedTest:
    """Sequential test of the reference value against the changed value of an alarm (see `detector.py`).

    hypothesis: the change that the alarm reports. period_s: mean time to a wrong result, seconds. condition: condition
    of the contact that raised the alarm, or None; an alarm of a quantity of `OF_CONDITIONS` is tested in this condition
    only. evidence: statistic of the test; the fault has been removed at 1.
    """

    alarm: Alarm
    hypothesis: Hypothesis
    period_s: float
    condition: Condition | None = None
    evidence: float = 0.0

    def update(self, estimates: Estimates, models: NullModels, level: IntArray, elapsed_s: float) -> bool:
        """Add the estimates of a step relative to the reference; return whether the fault has been removed.

        level: i64[P], level of each place. elapsed_s: seconds since the step before. The result is False for a step
        without information on the quantity and place of the alarm. Method: statistic of Shiryaev and Roberts (see
        `detector.py`) of the usual value against the changed value. At a statistic of 1 or more, the fault counts as
        removed.
        """
        quantity = QUANTITIES[self.hypothesis.quantity]
        if quantity.name not in estimates:
            return False
        value, information = (float(part[self.hypothesis.place]) for part in estimates[quantity.name])
        if information <= 0.0:
            return False
        model = models[quantity.name][int(level[self.hypothesis.place])]
        deviation = model.compute_deviation(np.array([information]))
        pair = np.array([value, value - self.alarm.amplitude])
        usual, changed = log_density(pair, deviation, model.degrees_of_freedom).tolist()
        self.evidence = min((self.evidence + elapsed_s / self.period_s) * float(np.exp(usual - changed)), LARGEST)
        return self.evidence >= 1.0
