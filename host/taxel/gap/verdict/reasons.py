"""Reasons for doubt in a fitted set of effects: parameters at their bounds, violated physics, faulty input."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from taxel.gap.data.simulator_faults import HANDLING_EXCLUDED, SimulatorFault
from taxel.gap.effects.catalogue import INSPECTED_EFFECTS
from taxel.gap.effects.effect import TAXEL
from taxel.gap.fitting.composite import CompositeModel


def list_reasons(composite: CompositeModel, faults: Sequence[SimulatorFault]) -> list[str]:
    """Return one sentence for each reason for doubt.

    The reasons are faulty grasps of the simulator that were kept, and parameters at a bound of their range other than
    the neutral value. Effects that are found by inspection and effects of single taxels are not checked.

    composite: the named effects, fitted. faults: faults of the simulator's grasps.
    """
    reasons = []
    kept = [fault for fault in faults if fault.handled != HANDLING_EXCLUDED]
    if kept:
        reasons.append(f"{len(kept)} grasps of the simulator violate physics, first {kept[0].grasp}: {kept[0].problem}")
    for fitted in composite.fitted_effects:
        if fitted.effect.name in INSPECTED_EFFECTS or fitted.effect.scope == TAXEL:
            continue
        for row, parameter in enumerate(fitted.effect.parameters()):
            values = fitted.values[row]
            span = parameter.high - parameter.low
            name = f"{parameter.name} of {fitted.effect.name}".replace("_", " ")
            for bound in (parameter.low, parameter.high):
                if bound != parameter.neutral and np.any(np.abs(values - bound) < 1e-6 * span):
                    reasons.append(f"{name} is at its bound, {bound:g}")
    return reasons
