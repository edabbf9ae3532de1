"""Gap in millimetres: distance between the active taxels of hand and simulator in world coordinates.

The distance is the symmetric Chamfer distance between two clouds whose points are present with a probability, because a
taxel near the threshold is active in some repeats only. There is no registration. The placebo is the distance of the
simulated cloud with as many additional random taxels of the loaded boards as the cloud of the hand has more, because a
denser cloud alone reduces distances.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist
from scipy.special import ndtr

from taxel.gap.data.pair import Pair
from taxel.gap.features.features import SessionMeans, compute_known_mean
from taxel.gap.features.metric import compute_jackknife_interval
from taxel.recording.grasp_format import ACTIVE_SIGNAL_COUNTS, Phase
from taxel.types import FloatArray

THRESHOLD_WIDTH_COUNTS: Final = 20.0
"""Width of the threshold of an active taxel, counts. The probability of an active taxel is the normal distribution
function of (signal - threshold) / width: 5/6 at one width above the threshold."""

EMPTY_CLOUD_MM: Final = 100.0
"""Distance of a point to a cloud without points, millimetres."""

PLACEBO_SAMPLES: Final = 5
"""Number of random clouds for each condition, over which the placebo is averaged."""

NO_CLOUD_GAP: Final = {"value": None, "ci95": None, "floor": None, "placebo": None}
"""The field `gap.mm` of a report on datasets without positions or poses."""

MIN_PROBABILITY: Final = 0.02
"""Smallest probability of a point of a cloud; taxels with a smaller one are omitted."""


def compute_cloud_gap(pair: Pair, real: SessionMeans, model: FloatArray, seed: int) -> dict[str, Any]:
    """Return the field `gap.mm` of the report, millimetres: value, 95 % interval, floor and placebo.

    A cloud consists of the positions of the active taxels during the hold; each point is weighted by the probability
    that its taxel is active. The value is the Chamfer distance between the real and the simulated cloud, averaged over
    conditions and sessions; its interval is a jackknife over the sessions. The floor is the mean distance between the
    real cloud of each session and that of the other sessions; it is 0 if no condition has two sessions. The placebo is
    the mean distance after random taxels were added to the simulated cloud until it has as many points as the real one.

    model: features of the simulator, f64[C, F, n] (C conditions, F features, n taxels), counts; the first features are
    the signals in the time bins. seed: seed of the random taxels of the placebo.
    """
    hold = int(pair.time_grid.find_bins(Phase.HOLD)[0])
    sessions = real.value.shape[1]
    rng = np.random.default_rng(seed)
    distance, floor, placebo = [], [], []
    for condition in range(len(pair.conditions)):
        places = _compute_world_positions(pair, condition)
        signal_counts = real.value[condition, :, hold]
        has_data: NDArray[np.bool_] = np.any(np.isfinite(signal_counts), axis=1)
        # probability that a taxel is active, of each session and of the simulator
        active = np.where(
            np.isfinite(signal_counts), ndtr((signal_counts - ACTIVE_SIGNAL_COUNTS) / THRESHOLD_WIDTH_COUNTS), 0.0
        )
        simulated = ndtr((model[condition, hold] - ACTIVE_SIGNAL_COUNTS) / THRESHOLD_WIDTH_COUNTS)
        row = [
            compute_chamfer_mm(places, one, simulated) if present else np.nan
            for one, present in zip(active, has_data, strict=True)
        ]
        distance.append(row)
        if not has_data.any():
            continue
        mean = active[has_data].mean(axis=0)
        if has_data.sum() > 1:
            others = [(active[has_data].sum(axis=0) - one) / (has_data.sum() - 1) for one in active[has_data]]
            floor.append(
                [compute_chamfer_mm(places, one, other) for one, other in zip(active[has_data], others, strict=True)]
            )
        for _ in range(PLACEBO_SAMPLES):
            placebo.append(
                compute_chamfer_mm(places, mean, _add_random_taxels(simulated, mean, pair.groups.sensor, rng))
            )
    per_session = compute_known_mean(np.array(distance), 0)
    whole = float(np.nanmean(per_session))
    replicates = (
        np.array([np.nanmean(np.delete(per_session, s)) for s in range(sessions)]) if sessions > 2 else np.zeros(0)
    )
    return {
        "value": whole,
        "ci95": compute_jackknife_interval(replicates, whole).non_negative.ci95,
        "floor": float(np.mean([value for row in floor for value in row])) if floor else 0.0,
        "placebo": float(np.mean(placebo)),
    }


def compute_chamfer_mm(places: FloatArray, first: FloatArray, second: FloatArray) -> float:
    """Return the symmetric Chamfer distance of two clouds, millimetres: the mean of both directed mean distances.

    places: f64[n, 3] (n taxels), metres, positions of the taxels. first, second: f64[n], probability that a taxel is a
    point of the first and of the second cloud. The distance is 0 if both clouds are empty, and `EMPTY_CLOUD_MM` if only
    one is empty.
    """
    a, b = np.flatnonzero(first > MIN_PROBABILITY), np.flatnonzero(second > MIN_PROBABILITY)
    if not len(a) and not len(b):
        return 0.0
    if not len(a) or not len(b):
        return EMPTY_CLOUD_MM
    distance = 1e3 * cdist(places[a], places[b])
    first_to_second = _compute_nearest_distance(distance, second[b])
    second_to_first = _compute_nearest_distance(distance.T, first[a])
    return 0.5 * float(np.average(first_to_second, weights=first[a]) + np.average(second_to_first, weights=second[b]))


def _compute_nearest_distance(distance: FloatArray, probability: FloatArray) -> FloatArray:
    """Return for each row the expected distance to the nearest present point, millimetres, f64[rows].

    distance: f64[rows, columns], distances to the points of the other cloud, millimetres. probability: f64[columns],
    probability that each of these points is present. If no point is present, the distance is `EMPTY_CLOUD_MM`.
    """
    order = np.argsort(distance, axis=1)
    ordered, present = np.take_along_axis(distance, order, axis=1), probability[order]
    # Probability that none of the nearer points is present; the last column refers to all points.
    none_before = np.cumprod(np.column_stack([np.ones(len(distance)), 1.0 - present]), axis=1)
    return np.asarray((ordered * present * none_before[:, :-1]).sum(axis=1) + EMPTY_CLOUD_MM * none_before[:, -1])


def _add_random_taxels(
    simulated: FloatArray, real: FloatArray, sensor: NDArray[np.intp], rng: np.random.Generator
) -> FloatArray:
    """Return the simulated cloud with random additional taxels of loaded boards, f64[n] (n taxels), probabilities.

    simulated, real: f64[n], probability that each taxel is active. Taxels are added until the expected number of points
    equals that of the real cloud, as far as there are enough inactive taxels.
    """
    missing = round(float(real.sum() - simulated.sum()))
    is_loaded = np.isin(sensor, np.unique(sensor[(simulated > 0.5) | (real > 0.5)]))
    free = np.flatnonzero(is_loaded & (simulated < 0.5))
    result = simulated.copy()
    if missing > 0 and len(free):
        result[rng.choice(free, min(missing, len(free)), replace=False)] = 1.0
    return result


def _compute_world_positions(pair: Pair, condition: int) -> FloatArray:
    """Return the positions of the taxels in world coordinates in a condition, metres, f64[n, 3] (n taxels)."""
    pose = pair.sensor_poses[condition][pair.groups.sensor]
    return np.asarray(np.einsum("nij,nj->ni", pose[:, :3, :3], pair.taxels.position) + pose[:, :3, 3])
