"""The gap in millimetres: how far the active taxels of hand and simulator lie apart in the world.

Symmetric Chamfer distance between clouds whose points are there with a probability: a taxel near the threshold is
active in some repeats and not in others. No registration. The placebo is the simulator's cloud with as many further
taxels, drawn at random from the touched boards, as the hand has more: a denser cloud alone brings distances down.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist
from scipy.special import ndtr

from taxel.gap.data.pair import Pair
from taxel.gap.features.features import SessionMeans, known_mean
from taxel.gap.features.metric import jackknife
from taxel.recording.grasp_format import ACTIVE_SIGNAL_COUNTS, Phase
from taxel.types import FloatArray

SOFT_COUNTS: Final = 20.0
"""Width of the threshold: a repeat whose drop lies this far above it is active in five of six cases."""

FARTHEST_MM: Final = 100.0
"""Distance to a cloud without points."""

PLACEBO_DRAWS: Final = 5
NO_CLOUDS: Final = {"value": None, "ci95": None, "floor": None, "placebo": None}
"""The field `gap.mm` of a report on datasets without positions or poses."""

LIKELY: Final = 0.02
"""Taxels that are active in fewer repeats are left out of a cloud."""


def cloud_gap(pair: Pair, real: SessionMeans, model: FloatArray, seed: int) -> dict[str, Any]:
    """The report's `gap.mm`; a floor that nobody knows is 0, as in counts. model: of the simulator, f64[C, F, n]."""
    hold = int(pair.clock.bins_of(Phase.HOLD)[0])
    sessions = real.value.shape[1]
    rng = np.random.default_rng(seed)
    distance, floor, placebo = [], [], []
    for condition in range(len(pair.conditions)):
        places = _world(pair, condition)
        drops = real.value[condition, :, hold]
        made: NDArray[np.bool_] = np.any(np.isfinite(drops), axis=1)
        active = np.where(np.isfinite(drops), ndtr((drops - ACTIVE_SIGNAL_COUNTS) / SOFT_COUNTS), 0.0)
        simulated = ndtr((model[condition, hold] - ACTIVE_SIGNAL_COUNTS) / SOFT_COUNTS)
        row = [chamfer_mm(places, one, simulated) if there else np.nan for one, there in zip(active, made, strict=True)]
        distance.append(row)
        if not made.any():
            continue
        mean = active[made].mean(axis=0)
        if made.sum() > 1:
            others = [(active[made].sum(axis=0) - one) / (made.sum() - 1) for one in active[made]]
            floor.append([chamfer_mm(places, one, other) for one, other in zip(active[made], others, strict=True)])
        for _ in range(PLACEBO_DRAWS):
            placebo.append(chamfer_mm(places, mean, _denser(simulated, mean, pair.groups.sensor, rng)))
    per_session = known_mean(np.array(distance), 0)
    whole = float(np.nanmean(per_session))
    left = np.array([np.nanmean(np.delete(per_session, s)) for s in range(sessions)]) if sessions > 2 else np.zeros(0)
    return {
        "value": whole,
        "ci95": jackknife(left, whole).positive.ci95,
        "floor": float(np.mean([value for row in floor for value in row])) if floor else 0.0,
        "placebo": float(np.mean(placebo)),
    }


def chamfer_mm(places: FloatArray, first: FloatArray, second: FloatArray) -> float:
    """Mean of both directions' mean distance, millimetres. places: f64[n, 3]; first, second: f64[n], probabilities."""
    a, b = np.flatnonzero(first > LIKELY), np.flatnonzero(second > LIKELY)
    if not len(a) and not len(b):
        return 0.0
    if not len(a) or not len(b):
        return FARTHEST_MM
    apart = 1e3 * cdist(places[a], places[b])
    there = _nearest(apart, second[b])
    back = _nearest(apart.T, first[a])
    return 0.5 * float(np.average(there, weights=first[a]) + np.average(back, weights=second[b]))


def _nearest(apart: FloatArray, probability: FloatArray) -> FloatArray:
    """Expected distance to the nearest point that is there, f64[rows]."""
    order = np.argsort(apart, axis=1)
    ordered, chance = np.take_along_axis(apart, order, axis=1), probability[order]
    none_before = np.cumprod(np.column_stack([np.ones(len(apart)), 1.0 - chance]), axis=1)
    return np.asarray((ordered * chance * none_before[:, :-1]).sum(axis=1) + FARTHEST_MM * none_before[:, -1])


def _denser(simulated: FloatArray, real: FloatArray, sensor: NDArray[np.intp], rng: np.random.Generator) -> FloatArray:
    """The simulator's cloud with taxels at random until it has as many as the hand's."""
    missing = round(float(real.sum() - simulated.sum()))
    touched = np.isin(sensor, np.unique(sensor[(simulated > 0.5) | (real > 0.5)]))
    free = np.flatnonzero(touched & (simulated < 0.5))
    result = simulated.copy()
    if missing > 0 and len(free):
        result[rng.choice(free, min(missing, len(free)), replace=False)] = 1.0
    return result


def _world(pair: Pair, condition: int) -> FloatArray:
    pose = pair.sensor_poses[condition][pair.groups.sensor]
    return np.asarray(np.einsum("nij,nj->ni", pose[:, :3, :3], pair.taxels.position) + pose[:, :3, 3])
