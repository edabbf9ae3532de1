"""What the report's fixed names mean, in the words of the page."""

from __future__ import annotations

from collections.abc import Mapping

STATUSES: Mapping[str, str] = {
    "no_gap": "no gap",
    "explained": "explained",
    "partly_explained": "partly explained",
    "unknown": "cause unknown",
}

IDENTIFIABILITIES: Mapping[str, tuple[str, str]] = {
    "identifiable": ("identifiable", "these grasps determine it"),
    "weak": ("weak", "these grasps determine it poorly"),
    "confounded": ("confounded", "these grasps cannot tell it from another effect"),
    "not_excited": ("not excited", "these grasps hardly bring it about"),
    "unavailable": ("unavailable", "the files lack what it acts on"),
}

LACKS: Mapping[str, str] = {
    "contact_propagation": "Pressure spreads sideways through the elastic dielectric.",
    "electrode_crosstalk": "Taxels that share a TX or RX electrode disturb each other.",
    "noise": "Read-out noise, white and common to a line.",
    "gain_mismatch": "Taxels or whole boards are more or less sensitive than modelled.",
    "stiffness": "The dielectric is softer or harder than modelled.",
    "baseline_drift": "The no-contact count wanders with time or temperature.",
    "hysteresis": "Unloading does not retrace loading, and the dielectric creeps.",
    "saturation": "The count stops falling at high force.",
    "proximity": "The fringe field answers before contact.",
    "dropout": "Dead or stuck taxels, broken lines, or boards that go silent.",
    "pose_error": "The object or a bracket is not where the model has it.",
    "latency": "A board's frames lag the hand.",
    "unknown": "None of the catalogue's effects; what it looks like is below.",
}
"""What the simulator lacks when an effect is the cause; an effect that is not listed is shown by its name alone."""
