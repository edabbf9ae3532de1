"""Optional data that datasets of any sensor may lack, and the consequences for the diagnosis."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

LINES, GEOMETRY, MESHES, POSES, FORCES, PHASES = "lines", "geometry", "meshes", "poses", "forces", "phases"
"""Keys of the optional data; the list `inputs.lacking` of the report contains the keys that apply."""

REASONS: Final[Mapping[str, str]] = {
    LINES: "the datasets have no electrode lines (tx, rx)",
    GEOMETRY: "the datasets have no positions of the taxels",
    MESHES: "the datasets have no meshes of the objects",
    POSES: "the datasets have no poses",
    FORCES: "the simulation has no contact force",
    PHASES: "the datasets do not state the phases",
}
"""Sentence for each kind of missing data, which states why an effect is unavailable."""

LOSSES: Final[Mapping[str, str]] = {
    LINES: "effects of electrode lines are unavailable, and a gap is not located on lines",
    GEOMETRY: "a spread to neighbouring taxels is unavailable",
    MESHES: "displaced objects are unavailable",
    POSES: "displaced objects and the gap in millimetres are unavailable",
    PHASES: "the phases are detected from the values, so that a delay of the whole sensor is not observable",
}
"""Consequence of each kind of missing data. `taxel.gap.data.losses` states the consequence of missing forces."""
