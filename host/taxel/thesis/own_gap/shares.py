"""Shares of the real-to-simulation distance that the effects explain, with intervals over seeds."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import stdtrit

from taxel.cloud.contact_cloud import ContactCloud
from taxel.cloud.errors import CloudError
from taxel.cloud.registration import PointTarget
from taxel.thesis.matching import measure_to_points
from taxel.thesis.own_gap.clouds import Points
from taxel.thesis.own_gap.effects import NO_EFFECTS, OwnEffects, combine, switch

Distances = dict[str, float]
"""Mean distance from the real to the simulated points by name of the object, metres; NaN if a side has too few
points."""

ALL_OBJECTS: Final = "mean"
"""Key under which the mean over the objects is stored."""

CONFIDENCE: Final = 0.95
"""Confidence level of the intervals over seeds."""

TOGETHER: Final = "together"
"""Key under which the shares of all effects together are stored."""


@dataclass(frozen=True)
class Shares:
    """Shares of one effect in the real-to-simulation distance, by name of the object.

    alone: distance with only this effect minus distance without effects. removed: distance with all effects minus
    distance with all effects but this one. Both are divided by the distance with all effects.
    """

    alone: Mapping[str, float]
    removed: Mapping[str, float]


@dataclass(frozen=True)
class Interval:
    """Mean of a value over seeds, and half the width of its confidence interval (NaN for a single seed)."""

    mean: float
    half_width: float


def compute_distances(real: Points, sim: Points) -> Distances:
    """Compute the mean distance from the real to the simulated points of each object, after alignment (thesis, 5.6.1).

    The distance is NaN for an object that cannot be aligned or has no simulated points.
    """
    return {name: _measure_mean(points, sim.get(name, np.empty((0, 3))), name) for name, points in real.items()}


def _measure_mean(real: np.ndarray, sim: np.ndarray, name: str) -> float:
    """Measure the mean distance of two clouds of an object, metres; NaN if they cannot be aligned."""
    try:
        return measure_to_points(ContactCloud.from_points(real, name=name), PointTarget(sim, name)).mean_m
    except CloudError:
        return float("nan")


def compute_shares(
    groups: tuple[str, ...], measure: Callable[[OwnEffects], Distances]
) -> tuple[Distances, Distances, dict[str, Shares]]:
    """Compute the distances without and with all effects, and the shares of each effect by name of its group.

    An effect has two shares: the change of the distance by this effect alone, and the change when only this effect is
    missing. Both are divided by the distance with all effects.

    groups: names of groups in `effects.GROUPS`. measure: computes the distances with a combination of effects. The
    shares of all effects together have the key `TOGETHER`. Distances and shares contain the mean over the objects under
    `ALL_OBJECTS`, without objects whose distance is NaN in a combination.
    """
    everything = combine(groups)
    combinations = {
        NO_EFFECTS,
        everything,
        *(switch(NO_EFFECTS, group, True) for group in groups),
        *(switch(everything, group, False) for group in groups),
    }
    distances = _add_mean({effects: measure(effects) for effects in combinations})
    none, full = distances[NO_EFFECTS], distances[everything]
    shares = {}
    for group in groups:
        alone, without = distances[switch(NO_EFFECTS, group, True)], distances[switch(everything, group, False)]
        shares[group] = Shares(_relative_difference(alone, none, full), _relative_difference(full, without, full))
    shares[TOGETHER] = Shares(_relative_difference(full, none, full), _relative_difference(full, none, full))
    return none, full, shares


def _add_mean(distances: Mapping[OwnEffects, Distances]) -> dict[OwnEffects, Distances]:
    """Add the mean over the objects that have a distance in every combination, under `ALL_OBJECTS`."""
    names = next(iter(distances.values()))
    measured = [name for name in names if all(np.isfinite(row[name]) for row in distances.values())]
    return {
        effects: {**row, ALL_OBJECTS: float(np.mean([row[name] for name in measured])) if measured else float("nan")}
        for effects, row in distances.items()
    }


def _relative_difference(minuend: Distances, subtrahend: Distances, full: Distances) -> Distances:
    """Return the difference of two distances divided by `full`, the distance with all effects, by object."""
    return {name: (minuend[name] - subtrahend[name]) / full[name] for name in full}


def compute_interval(values: Sequence[float]) -> Interval:
    """Compute the mean of values (one for each seed) and the half width of its 95 % interval (Student's t)."""
    n = len(values)
    if n < 2:
        return Interval(float(np.mean(values)), float("nan"))
    quantile = float(stdtrit(n - 1, 0.5 + CONFIDENCE / 2))
    return Interval(float(np.mean(values)), quantile * float(np.std(values, ddof=1)) / np.sqrt(n))
