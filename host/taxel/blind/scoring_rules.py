"""Rules of the score: which reports are scored, and how effect models are matched."""

from collections.abc import Mapping
from typing import Any, Final

MIN_CLEAR_RATIO: Final = 2.0
"""Ratio of gap to floor from which a world counts as clear, so that its cause must be named (chosen)."""


def is_clear(report: Mapping[str, Any]) -> bool:
    """Whether the gap in a report is so far above the floor that the cause must be named; False for an error report."""
    return "gap" in report and bool(report["gap"]["value"] >= MIN_CLEAR_RATIO * report["gap"]["floor"])


def model_key(entry: Mapping[str, Any]) -> str:
    """Return the model and scope of an effect in a report, such as "kept hand"; " " for an effect without a model."""
    model = entry.get("model", {})
    return f"{model.get('form', '')} {model.get('scope', '')}"
