"""Of which reports an answer is asked, and of which of their models."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

CLEAR: Final = 2.0
"""Gap over floor from which on an answer is asked for."""


def is_clear(report: Mapping[str, Any]) -> bool:
    """Whether a report's gap is; False for one that is an error."""
    return "gap" in report and bool(report["gap"]["value"] >= CLEAR * report["gap"]["floor"])


def form_of(entry: Mapping[str, Any]) -> str:
    """Form and scope of an effect in a report, such as "kept hand"; " " for one that was found, not fitted."""
    model = entry.get("model", {})
    return f"{model.get('form', '')} {model.get('scope', '')}"
