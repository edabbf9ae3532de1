"""Test whether the fault of an alarm has been removed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from taxel.twin.detector import LARGEST, Hypothesis
from taxel.twin.events import Alarm
from taxel.twin.null_model import NullModels, log_density
from taxel.twin.schedule import Condition
from taxel.twin.statistics import QUANTITIES, Scores
from taxel.types import IntArray


@dataclass(eq=False)
class ClearedTest:
    """Sequential test of the reference value against the changed value of an alarm (see `detector.py`).

    period_s: mean time to a wrong result, seconds. condition: of the contact that raised the alarm, or None. The
    signals during a contact, unlike relative changes, are compared in this condition only.
    """

    alarm: Alarm
    hypothesis: Hypothesis
    period_s: float
    condition: Condition | None = None
    evidence: float = 0.0

    def update(self, estimates: Scores, models: NullModels, level: IntArray, elapsed_s: float) -> bool:
        """Add the estimates of a step relative to the reference; return whether the fault has been removed."""
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
