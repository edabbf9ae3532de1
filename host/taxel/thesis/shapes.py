"""Which shapes are told right: each object's clouds, whole and of single approaches, among three models and six."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

from taxel.cloud.match import compute_likelihoods, match
from taxel.cloud.models import get_builtin_models
from taxel.thesis.findings import Other
from taxel.thesis.matching import REAL, SIM, ObjectClouds

PARTS: Final = 2
"""How often `shapes_told` calls `show` for an object."""

PRINTED: Final = {"whole clouds": "2 of 2 each, among 3", "single approaches": "not told"}
"""What the thesis says of it (Tables I-13 to I-18)."""


def shapes_told(items: Sequence[ObjectClouds], show: Callable[[], None]) -> list[Other]:
    """How many clouds of the hand and the simulator, untreated, are told to be of their object, and how many of single
    approaches: among the thesis's objects, and among these and the further built-in shapes.
    """
    thesis = {item.name: item.mesh for item in items}
    everything = {**get_builtin_models(), **thesis}
    told: dict[tuple[str, int], dict[str, str]] = {}
    for item in items:
        right: dict[tuple[str, int], list[bool]] = {}
        for side in (REAL, SIM):
            cloud = item.clouds[side]
            likelihoods = compute_likelihoods(cloud, everything)
            for approach in ("", *cloud.approaches):
                part = cloud.select_approach(approach) if approach else cloud
                for known in (thesis, everything):
                    best = match(part, known, likelihoods=likelihoods, bootstrap_samples=0).best
                    what = "single approaches" if approach else "whole clouds"
                    right.setdefault((what, len(known)), []).append(best == item.name)
            show()
        for key, answers in right.items():
            told.setdefault(key, {})[item.thesis] = f"{sum(answers)} of {len(answers)}"
    return [
        Other(f"shapes told right among {shapes} models: {what} of both sides", numbers, PRINTED[what])
        for (what, shapes), numbers in told.items()
    ]
