"""Values at which a reported parameter changes nothing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from taxel.gap.fitting.composite import FittedEffect

SHAPES: Final = frozenset(
    {"contact_propagation.spread_mm", "hysteresis.seconds", "proximity.range_mm", "pose_error.held_n_per_mm"}
)
"""Parameters that only give the shape of an effect: none of their values alone switches the effect off."""

DERIVED: Final[Mapping[str, float]] = {
    "gain_mismatch.log_std": 0.0,
    "gain_mismatch.scale": 1.0,
    "baseline_drift.counts": 0.0,
    "pose_error.translation_mm": 0.0,
    "pose_error.rotation_deg": 0.0,
    "hysteresis.fraction": 0.0,
}
"""Neutral values of quantities that the report computes from the parameters of an effect."""


def find_neutral(link: FittedEffect, label: str) -> float | None:
    """The value of a parameter that changes nothing; None for one that only gives a shape.

    label: name of the parameter, with or without "@" and its board or object.
    """
    name = label.partition("@")[0]
    key = f"{link.effect.name}.{name}"
    if key in SHAPES:
        return None
    own = {parameter.name: parameter.neutral for parameter in link.effect.parameters()}
    return own.get(name, DERIVED.get(key))
