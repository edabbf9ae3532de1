"""Number of clouds whose shape is identified: whole clouds and single approaches, among three and among six models."""

from collections.abc import Callable, Sequence
from typing import Final

from taxel.cloud.match import compute_likelihoods, match
from taxel.cloud.models import get_builtin_models
from taxel.thesis.cloud_names import REAL, SIM
from taxel.thesis.matching import ObjectClouds
from taxel.thesis.shape_counts import SINGLE_APPROACHES, WHOLE_CLOUDS, ShapeCount

STEPS: Final = 2
"""Number of calls of `advance` for an object."""


def count_identified_shapes(items: Sequence[ObjectClouds], advance: Callable[[], None]) -> list[ShapeCount]:
    """Count for each object the untreated real and simulated clouds whose object is identified by its shape.

    The candidate models are the objects of the thesis, and then these with the other built-in shapes. advance: called
    after each cloud.
    """
    thesis_models = {item.name: item.mesh for item in items}
    all_models = {**get_builtin_models(), **thesis_models}
    counts = []
    for item in items:
        outcomes: dict[tuple[str, int], list[bool]] = {}
        for side in (REAL, SIM):
            cloud = item.clouds[side]
            likelihoods = compute_likelihoods(cloud, all_models)
            for approach in ("", *cloud.approaches):
                part = cloud.select_approach(approach) if approach else cloud
                for models in (thesis_models, all_models):
                    best = match(part, models, likelihoods=likelihoods, bootstrap_samples=0).best
                    group = SINGLE_APPROACHES if approach else WHOLE_CLOUDS
                    outcomes.setdefault((group, len(models)), []).append(best == item.name)
            advance()
        counts += [
            ShapeCount(group, models, item.printed_name, sum(values), len(values))
            for (group, models), values in outcomes.items()
        ]
    return counts
