"""Texts of the page for the fixed names of the report."""

from collections.abc import Mapping

STATUSES: Mapping[str, str] = {
    "no_gap": "no gap",
    "explained": "explained",
    "partly_explained": "partly explained",
    "unknown": "unknown cause",
}

IDENTIFIABILITIES: Mapping[str, tuple[str, str]] = {
    "identifiable": ("identifiable", "determined by these grasps"),
    "weak": ("weak", "poorly determined by these grasps"),
    "confounded": ("confounded", "not distinguishable from another effect in these grasps"),
    "not_excited": ("not excited", "hardly occurs in these grasps"),
    "unavailable": ("unavailable", "the files lack the data that the effect needs"),
}

DESCRIPTIONS: Mapping[str, str] = {
    "contact_propagation": "Pressure spreads sideways through the elastic dielectric.",
    "electrode_crosstalk": "Taxels that share a TX or RX electrode influence each other.",
    "noise": "Read-out noise, white and common to a line.",
    "gain_mismatch": "Taxels or whole boards are more or less sensitive than modelled.",
    "stiffness": "The dielectric is softer or harder than modelled.",
    "nonlinearity": "The signal depends on the load by another curve.",
    "baseline_drift": "The count without contact drifts with time or temperature.",
    "hysteresis": "The unloading curve differs from the loading curve, and the dielectric creeps.",
    "saturation": "The count stops decreasing at high force.",
    "proximity": "The fringe field produces a signal before contact.",
    "dropout": "Dead or stuck taxels, broken lines, or boards that stop sending.",
    "pose_error": "The object or a bracket is not where the model places it.",
    "latency": "The frames of a board lag behind the hand.",
    "unknown": "No effect of the catalogue; its signature is stated below.",
}
"""Description of an effect as a cause; an effect without an entry is shown by its name only."""
