"""Stiffness: the dielectric is softer or harder than in the simulator."""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

import numpy as np

from taxel.gap.effects.effect import TAXEL, Effect, Parameter
from taxel.gap.effects.force_changes import apply_change, assemble_change
from taxel.gap.effects.geometry import compute_geometry
from taxel.gap.fitting.state import Signal, State
from taxel.types import FloatArray

TAXEL_PRIOR_STD = 0.35
"""Prior standard deviation of the scale of single taxels about 1. Chosen: the
expected variation between the taxels of a sensor."""

EXPONENT_STD = 0.2
"""Prior standard deviation of the exponent about 1. Chosen: the curves of soft layers of one type are similar."""


class Stiffness(Effect):
    """Scale of the force at which the signal is half the full scale; a scale below 1 is a softer layer."""

    name = "stiffness"
    order = 40
    needs_force: ClassVar[bool] = True
    is_load_independent: ClassVar[bool] = True

    def __init__(self, scope: str = "hand") -> None:
        self.scope = scope

    def own_parameters(self) -> tuple[Parameter, ...]:
        """Return the parameter: the scale of the half force."""
        prior = TAXEL_PRIOR_STD if self.scope == TAXEL else np.inf
        return (Parameter("half_force_scale", "1", 0.1, 10.0, 1.0, 1.0, prior),)

    def apply(self, state: State, signal: Signal, values: FloatArray) -> Signal:
        """Return the signal with the force law scaled; `signal` itself if all scales are 1, or if the forces are
        already converted to counts. values: f64[1, G], factor on the force at half the full scale for each of G blocks
        (the hand, or each board, object or taxel).
        """
        if (values == 1.0).all() or signal.signal_counts is not None:
            return signal
        scale = self.spread_out(state, values)[0]
        return replace(signal, law_scale=signal.law_scale * scale)


class CurvedStiffness(Stiffness):
    """Stiffness of a layer with another curve: the force F acts like h (F / h)^`exponent`.

    h is the scaled force at half the full scale, at which the exponent has no influence. An exponent below 1 is a layer
    that becomes stiffer when it is compressed.
    """

    variant = "curved"

    def own_parameters(self) -> tuple[Parameter, ...]:
        """Return the parameters: the scale of the half force, and the exponent."""
        return *super().own_parameters(), Parameter("exponent", "1", 0.4, 2.5, 1.0, 1.0, EXPONENT_STD)

    def apply(self, state: State, signal: Signal, values: FloatArray) -> Signal:
        """Return the signal with the force law scaled and curved; `signal` itself if all values are 1, without contact
        forces, or if the forces are already converted to counts. values: f64[2, G], factor on the force at half the
        full scale and exponent for each of G blocks (the hand, or each board, object or taxel).
        """
        if (values == 1.0).all() or signal.force is None or signal.signal_counts is not None:
            return signal
        scaled = super().apply(state, signal, values[:1])
        _, exponent = self.spread_out(state, values)
        half = state.sensor_model.half_force_n * scaled.law_scale
        return scaled.with_force(half * (np.maximum(signal.force, 0.0) / half) ** exponent)


class Sinking(Stiffness):
    """Stiffness with contacts that are computed again: at the same net force of each board, an object sinks deeper into
    a softer layer and loads more taxels.
    """

    order = 12  # before the propagation of force, like a displacement
    variant = "sinking"

    def apply(self, state: State, signal: Signal, values: FloatArray) -> Signal:
        """Return the signal with new contact forces and a scaled force law; `signal` itself if all scales are 1,
        without contact forces, or if the forces are already converted to counts. values: f64[1, G], factor on the force
        at half the full scale for each of G blocks (the hand, or each board, object or taxel).
        """
        if (values == 1.0).all() or signal.force is None or signal.signal_counts is not None:
            return signal
        geometry, blocks = compute_geometry(state), self.find_blocks(state)
        scales = {
            number: float(values[0, blocks[contact.condition, contact.taxels[0]]])
            for number, contact in enumerate(geometry.contacts)
        }
        change = assemble_change(
            state,
            geometry.contacts,
            geometry.compute_stiffness_changes({number: scale for number, scale in scales.items() if scale != 1.0}),
        )
        return super().apply(state, apply_change(state, signal, change), values)
