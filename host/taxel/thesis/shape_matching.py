"""Number of clouds whose shape is identified: whole clouds and single approaches, among three and among six models."""

from collections.abc import Callable, Sequence
from typing import Final

from taxel.cloud.match import compute_likelihoods, match
from taxel.cloud.models import get_builtin_models
from taxel.thesis.findings import FurtherResult
from taxel.thesis.matching import REAL, SIM, ObjectClouds

STEPS: Final = 2
"""Number of calls of `advance` for an object."""

PRINTED: Final = {"whole clouds": "2 of 2 each, among 3", "single approaches": "not stated"}
"""Corresponding numbers of the thesis (Tables I-13 to I-18)."""


def count_identified_shapes(items: Sequence[ObjectClouds], advance: Callable[[], None]) -> list[FurtherResult]:
    """Count for each object the untreated real and simulated clouds whose object is identified by its shape.

    The candidate models are the objects of the thesis, and then these with the other built-in shapes. advance: called
    after each cloud.
    """
    thesis_models = {item.name: item.mesh for item in items}
    all_models = {**get_builtin_models(), **thesis_models}
    counts: dict[tuple[str, int], dict[str, str]] = {}
    for item in items:
        outcomes: dict[tuple[str, int], list[bool]] = {}
        for side in (REAL, SIM):
            cloud = item.clouds[side]
            likelihoods = compute_likelihoods(cloud, all_models)
            for approach in ("", *cloud.approaches):
                part = cloud.select_approach(approach) if approach else cloud
                for models in (thesis_models, all_models):
                    best = match(part, models, likelihoods=likelihoods, bootstrap_samples=0).best
                    group = "single approaches" if approach else "whole clouds"
                    outcomes.setdefault((group, len(models)), []).append(best == item.name)
            advance()
        for key, values in outcomes.items():
            counts.setdefault(key, {})[item.printed_name] = f"{sum(values)} of {len(values)}"
    return [
        FurtherResult(f"shapes identified among {models} models: {group}, real and simulated", numbers, PRINTED[group])
        for (group, models), numbers in counts.items()
    ]
