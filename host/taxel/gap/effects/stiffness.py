"""The dielectric is softer or harder than modelled."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from taxel.gap.effects.effect import TAXEL, Effect, Parameter
from taxel.gap.effects.geometry import changed, geometry_of, with_change
from taxel.gap.fitting.state import Signal, State
from taxel.types import FloatArray

TAXEL_PRIOR = 0.35
"""Expected scatter of single taxels about 1."""


class Stiffness(Effect):
    """The force of half the drop is `half_force_scale` times the modelled one; below 1: softer."""

    name = "stiffness"
    order = 40
    needs_force: ClassVar[bool] = True
    is_load_independent: ClassVar[bool] = True

    def __init__(self, scope: str = "hand") -> None:
        self.scope = scope

    def own_parameters(self) -> tuple[Parameter, ...]:
        """The scale."""
        prior = TAXEL_PRIOR if self.scope == TAXEL else np.inf
        return (Parameter("half_force_scale", "1", 0.1, 10.0, 1.0, 1.0, prior),)

    def apply(self, state: State, signal: Signal, values: FloatArray) -> Signal:
        """See `Effect`."""
        if (values == 1.0).all() or signal.signal_counts is not None:
            return signal
        (scale,) = self.spread_out(state, values)
        return replace(signal, law_scale=signal.law_scale * scale)


class Sinking(Stiffness):
    """The same, and boards are pressed anew: into a softer layer an object sinks deeper at the same net force, so that
    more taxels bear.
    """

    order = 12  # before what spreads the force, as a displacement is
    variant = "sinking"

    def apply(self, state: State, signal: Signal, values: FloatArray) -> Signal:
        """See `Effect`."""
        if (values == 1.0).all() or signal.force is None or signal.signal_counts is not None:
            return signal
        geometry, blocks = geometry_of(state), self.blocks(state)
        scales = {
            number: float(values[0, blocks[contact.condition, contact.taxels[0]]])
            for number, contact in enumerate(geometry.contacts)
        }
        change = changed(state, geometry.sunk({number: scale for number, scale in scales.items() if scale != 1.0}))
        return super().apply(state, with_change(state, signal, change), values)
