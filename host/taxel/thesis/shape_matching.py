"""Number of clouds whose shape is identified: whole clouds and single approaches, among three and among six models."""

from collections.abc import Callable, Mapping, Sequence
from typing import Final

import numpy as np

from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.evidence import compute_evidence
from taxel.cloud.match import compute_likelihoods
from taxel.cloud.models import get_builtin_models
from taxel.thesis.cloud_names import REAL, SIM
from taxel.thesis.matching import ObjectClouds
from taxel.thesis.shape_counts import SINGLE_APPROACHES, WHOLE_CLOUDS, ShapeCount
from taxel.types import FloatArray

STEPS: Final = 2
"""Number of calls of `advance` for each object in `count_identified_shapes`."""


def count_identified_shapes(items: Sequence[ObjectClouds], advance: Callable[[], None]) -> list[ShapeCount]:
    """Count for each object the untreated clouds, real and simulated, whose shape is identified correctly.

    Whole clouds and clouds of single approaches are counted separately, with two sets of candidate models: the objects
    of the thesis alone, and together with the other built-in shapes. The best model has the largest evidence, as in
    `taxel.cloud.match`; the alignment that `match` also computes is not needed. advance: called after each whole cloud.
    """
    thesis_models = tuple(item.name for item in items)
    all_models = {**get_builtin_models(), **{item.name: item.mesh for item in items}}
    counts = []
    for item in items:
        outcomes: dict[tuple[str, int], list[bool]] = {}
        for side in (REAL, SIM):
            cloud = item.clouds[side]
            likelihoods = compute_likelihoods(cloud, all_models)
            for approach in ("", *cloud.approaches):
                part = cloud.select_approach(approach) if approach else cloud
                for models in (thesis_models, tuple(all_models)):
                    best = find_best_model(part, likelihoods, models)
                    group = SINGLE_APPROACHES if approach else WHOLE_CLOUDS
                    outcomes.setdefault((group, len(models)), []).append(best == item.name)
            advance()
        counts += [
            ShapeCount(group, models, item.printed_name, sum(values), len(values))
            for (group, models), values in outcomes.items()
        ]
    return counts


def find_best_model(cloud: ContactCloud, likelihoods: Mapping[str, FloatArray], models: Sequence[str]) -> str | None:
    """Return the name of the model with the largest evidence among `models`; None for a cloud without points.

    likelihoods: log likelihoods of the grasps by model (`compute_likelihoods`), which may include grasps that the cloud
    does not contain.
    """
    grasps = np.unique(cloud.grasp)
    if not len(grasps):
        return None
    evidence = [float(compute_evidence(likelihoods[name][grasps])[0]) for name in models]
    return models[int(np.argmax(evidence))]
