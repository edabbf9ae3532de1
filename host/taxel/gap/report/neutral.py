"""Neutral values of reported parameters: at its neutral value a parameter changes nothing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from taxel.gap.fitting.composite import FittedEffect

SHAPE_PARAMETERS: Final = frozenset(
    {
        "contact_propagation.spread_mm",
        "contact_propagation.shape",
        "hysteresis.seconds",
        "saturation.sharpness",
        "proximity.range_mm",
        "proximity.shape",
        "pose_error.held_n_per_mm",
    }
)
"""Parameters of the shape of an effect: no value of such a parameter alone switches the effect off."""

DERIVED_NEUTRAL_VALUES: Final[Mapping[str, float]] = {
    "gain_mismatch.log_std": 0.0,
    "gain_mismatch.scale": 1.0,
    "baseline_drift.counts": 0.0,
    "pose_error.translation_mm": 0.0,
    "pose_error.rotation_deg": 0.0,
    "hysteresis.fraction": 0.0,
}
"""Neutral values of quantities that the report computes from the parameters of an effect."""


def find_neutral(fitted_effect: FittedEffect, label: str) -> float | None:
    """Return the neutral value of a reported parameter, in its unit.

    The result is None for a parameter of `SHAPE_PARAMETERS`, and for a label without a known neutral value. label: name
    of the parameter, with or without "@" and the name of the block.
    """
    name = label.partition("@")[0]
    key = f"{fitted_effect.effect.name}.{name}"
    if key in SHAPE_PARAMETERS:
        return None
    neutral_values = {parameter.name: parameter.neutral for parameter in fitted_effect.effect.parameters()}
    return neutral_values.get(name, DERIVED_NEUTRAL_VALUES.get(key))
