"""Reasons for doubt in a fitted set of effects: parameters at their bounds, violated physics, faulty input."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from taxel.gap.data.simulator_faults import LEFT_OUT, SimulatorFault
from taxel.gap.effects.catalogue import FIXED
from taxel.gap.effects.effect import TAXEL
from taxel.gap.fitting.composite import CompositeModel
from taxel.gap.fitting.judge import Judge


def list_reasons(judge: Judge, composite: CompositeModel, faults: Sequence[SimulatorFault]) -> list[str]:
    """One sentence for each reason. chain: the named effects, fitted."""
    reasons = []
    kept = [one for one in faults if one.handled != LEFT_OUT]
    if kept:
        reasons.append(f"{len(kept)} grasps of the simulator violate physics, first {kept[0].grasp}: {kept[0].problem}")
    for link in composite.links:
        if link.effect.name in FIXED or link.effect.scope == TAXEL:
            continue
        for row, parameter in enumerate(link.effect.parameters()):
            values = link.values[row]
            span = parameter.high - parameter.low
            at_low, at_high = (
                bool(np.any(np.abs(values - end) < 1e-6 * span)) for end in (parameter.low, parameter.high)
            )
            bound = parameter.low if at_low else parameter.high
            if (at_low and parameter.low != parameter.neutral) or (at_high and parameter.high != parameter.neutral):
                name = f"{parameter.name} of {link.effect.name}".replace("_", " ")
                reasons.append(f"{name} is at its bound, {bound:g}")
    return reasons
