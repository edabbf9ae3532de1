"""The gap in the terms of the thesis that this project began with: how each treatment of its section 5.6.2 moves it.

The thesis filters clouds by force and by statistical outlier removal (SOR), and activates the neighbours of the
simulator's active taxels; its tables I-10 to I-12 give the distance after each. There only the hand's clouds lose
points. Here the simulator tells counts too, and both are filtered: a filter on one side makes a gap of its own.
Contact propagation is fitted. Distances are those of `cloud_gap`: each cell and session on its own, in the world,
without registration.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np
from scipy.spatial import cKDTree
from scipy.special import ndtr

from taxel.cloud.treatment import FORCE_FILTER_COUNTS, OutlierFilter, get_outlier_filter
from taxel.gap.comparison.settings import DEFAULT_SETTINGS
from taxel.gap.data.pair import Pair
from taxel.gap.effects import catalogue
from taxel.gap.features.cloud_gap import LIKELY, SOFT_COUNTS, chamfer_mm
from taxel.gap.features.features import known_mean
from taxel.gap.features.metric import terms, total
from taxel.gap.fitting.composite import CompositeModel, FittedEffect
from taxel.gap.fitting.fit import started
from taxel.gap.fitting.judge import Judge
from taxel.recording.grasp_format import ACTIVE_SIGNAL_COUNTS, Phase
from taxel.types import BoolArray, FloatArray

GRASPS: Final = 10.0
"""Points that a taxel leaves in the cloud of all grasps of an object if it is always active: the thesis made ten
grasps of nearly every approach (Table 5.1). So the number of repeats at hand does not matter."""

NEAR: Final = 32
"""Places that are looked at first for a point's neighbours."""

SAME_M: Final = 1e-9
"""Distances that differ by less are equal."""

NAME: Final = "contact_propagation"


def thesis_terms(judge: Judge, alone: Mapping[str, tuple[CompositeModel, FloatArray]]) -> list[dict[str, Any]]:
    """The report's `thesis_terms`; alone: fits of single effects.

    The steps: as they are, then the force filter, SOR and contact propagation, each added.

    step: words. gap: counts; None where a treatment changes no count. mm: as in `gap.mm`, with the filters on both
    clouds; mm_hand_only: with the filters on the hand's alone. Both None where nothing is known or a step was skipped.
    points: active taxels that are expected when every cell is grasped once. note: what was done.
    """
    pair, real, layout, before = judge.state.pair, judge.sessions, judge.layout, judge.state.mean
    hold = int(pair.clock.bins_of(Phase.HOLD)[0])
    clouds = Clouds(pair, real.value[:, :, hold])
    plain, hand = clouds.active(ACTIVE_SIGNAL_COUNTS), clouds.active(FORCE_FILTER_COUNTS)
    sim, firm = activity(before[:, hold], ACTIVE_SIGNAL_COUNTS), activity(before[:, hold], FORCE_FILTER_COUNTS)
    clean, firm_clean = clouds.without_outliers(hand), clouds.without_outliers(firm)
    steps = [
        clouds.entry("unfiltered", plain, sim, sim, f"active above a signal of {ACTIVE_SIGNAL_COUNTS:g} counts"),
        clouds.entry("force filter", hand, firm, sim, f"signal of {FORCE_FILTER_COUNTS:g} counts{_newtons(pair)}"),
        clouds.entry("+ SOR", clean, firm_clean, sim, _rules(pair)),
    ]
    steps[0]["gap"] = float(np.sqrt(total(terms(real, before, layout).gap2)))
    found = _propagation(judge, alone)
    if isinstance(found, str):
        skipped = {"step": f"contact propagation: not added, {found}", "gap": None, "mm": None, "mm_hand_only": None}
        return [*steps, {**skipped, "points": steps[-1]["points"], "note": found}]
    link, after = found
    sim, firm = activity(after[:, hold], ACTIVE_SIGNAL_COUNTS), activity(after[:, hold], FORCE_FILTER_COUNTS)
    last = clouds.entry("+ contact propagation", clean, clouds.without_outliers(firm), sim, _values(link))
    last["gap"] = float(np.sqrt(total(terms(real, after, layout).gap2)))
    return [*steps, last]


def activity(signal_counts: FloatArray, threshold: float) -> FloatArray:
    """Probability that a repeat's drop lies above a threshold, of the drop's shape; 0 where it is unknown."""
    return np.where(np.isfinite(signal_counts), ndtr((signal_counts - threshold) / SOFT_COUNTS), 0.0)


@dataclass(frozen=True, eq=False)
class Clouds:
    """The hand's clouds, and what is done to clouds. drop: f64[C, S, n], of the hand in hold."""

    pair: Pair
    signal_counts: FloatArray

    def active(self, threshold: float) -> FloatArray:
        """The hand's probabilities, f64[C, S, n]."""
        return activity(self.signal_counts, threshold)

    @cached_property
    def made(self) -> BoolArray:
        """Sessions that tell something of a cell, bool[C, S]."""
        return np.asarray(np.isfinite(self.signal_counts).any(axis=2))

    @cached_property
    def places(self) -> FloatArray:
        """Taxels as the grasped object sees them, f64[C, n, 3]: distances are those in the world."""
        pose = self.pair.sensor_poses[:, self.pair.groups.sensor]
        world = np.einsum("cnij,nj->cni", pose[..., :3, :3], self.pair.taxels.position) + pose[..., :3, 3]
        own = self.pair.object_poses
        return np.asarray(np.einsum("cji,cnj->cni", own[:, :3, :3], world - own[:, None, :3, 3]))

    def mean(self, cloud: FloatArray) -> FloatArray:
        """Over the sessions that made a cell, f64[C, n]. cloud: f64[C, S, n], or f64[C, n] of the simulator."""
        if cloud.ndim == 2:
            return cloud
        return np.nan_to_num(known_mean(np.where(self.made[..., None], cloud, np.nan), 1))

    def without_outliers(self, cloud: FloatArray) -> FloatArray:
        """A cloud less the outliers of each object's cloud of all grasps; of the same shape."""
        mean = self.mean(cloud)
        outlier = np.zeros(mean.shape, bool)
        names = np.array([item for item, _ in self.pair.conditions])
        for name in dict.fromkeys(names.tolist()):
            own = names == name
            found = outliers(self.places[own].reshape(-1, 3), mean[own].ravel(), get_outlier_filter(name))
            outlier[own] = found.reshape(-1, mean.shape[1])
        return np.where(outlier[:, None] if cloud.ndim == 3 else outlier, 0.0, cloud)

    def distance_mm(self, real: FloatArray, sim: FloatArray) -> float | None:
        """Mean over cells, then sessions; None if no session tells anything. real: f64[C, S, n], sim: f64[C, n]."""
        apart = np.full(self.made.shape, np.nan)
        for condition, session in np.argwhere(self.made):
            apart[condition, session] = chamfer_mm(self.places[condition], real[condition, session], sim[condition])
        whole = float(known_mean(known_mean(apart, 0), 0))
        return whole if np.isfinite(whole) else None

    def entry(self, step: str, real: FloatArray, sim: FloatArray, unfiltered: FloatArray, note: str) -> dict[str, Any]:
        """One step. real: f64[C, S, n]; sim, unfiltered: of the simulator with filters and without, f64[C, n]."""
        mm = self.distance_mm(real, sim)
        return {
            "step": step,
            "gap": None,
            "mm": mm,
            "mm_hand_only": mm if unfiltered is sim else self.distance_mm(real, unfiltered),
            "points": {"real": float(self.mean(real).sum()), "sim": float(sim.sum())},
            "note": note,
        }


def outliers(places: FloatArray, probability: FloatArray, rule: OutlierFilter) -> BoolArray:
    """Which points are statistical outliers (Rusu et al. 2008), bool[m].

    A point whose mean distance to its nearest neighbours lies more than some standard deviations above the cloud's mean
    of that; it counts as one of its neighbours, see `taxel.cloud.filters`. Points with fewer neighbours than asked for
    are none. places: f64[m, 3], metres, of taxels in all approaches of an object. probability: f64[m], of being active;
    a place holds `GRASPS` times as many points.
    """
    result = np.zeros(len(places), bool)
    there = np.flatnonzero(probability > LIKELY)
    if len(there) < 2:
        return result
    points = GRASPS * probability[there]
    wanted = rule.neighbours if rule.neighbours is not None else 0.25 * float(points.sum())
    mean = _mean_distance(places[there], points, max(wanted - 1.0, 1.0))
    known = np.isfinite(mean)
    if not known.any():
        return result
    middle = float(np.average(mean[known], weights=points[known]))
    deviation = float(np.sqrt(np.average((mean[known] - middle) ** 2, weights=points[known])))
    result[there[known & (mean > middle + rule.deviations * deviation + SAME_M)]] = True
    return result


def _mean_distance(places: FloatArray, points: FloatArray, wanted: float) -> FloatArray:
    """Mean distance of each place's points to their `wanted` nearest others, f64[m]; NaN where there are fewer."""
    tree, number = cKDTree(places), len(places)
    result = np.full(number, np.nan)
    rows, near = np.arange(number), min(NEAR, number)
    while len(rows):
        short = []
        for part in np.array_split(rows, max(1, len(rows) * near // 1_000_000)):
            apart, index = (np.reshape(found, (len(part), near)) for found in tree.query(places[part], near))
            # A place's own points are each other's neighbours; one is not its own.
            others = np.where(index == part[:, None], np.maximum(points[index] - 1.0, 0.0), points[index])
            taken = np.diff(np.minimum(np.cumsum(others, axis=1), wanted), axis=1, prepend=0.0)
            full = taken.sum(axis=1) >= wanted * (1.0 - 1e-9)
            result[part[full]] = (taken * apart)[full].sum(axis=1) / wanted
            short.append(part[~full])
        if near == number:
            break
        rows, near = np.concatenate(short), min(4 * near, number)
    return result


def _propagation(
    judge: Judge, alone: Mapping[str, tuple[CompositeModel, FloatArray]]
) -> tuple[FittedEffect, FloatArray] | str:
    """Contact propagation fitted alone and the features with it, f64[C, F, n]; or why not."""
    state = judge.state
    reasons = [form.unavailable(state) for form in catalogue.all_effects()[NAME]]
    if all(reasons):
        return reasons[0]
    if NAME in alone:
        composite = alone[NAME][0]
        return composite.links[0], composite.features(state)
    forms = catalogue.all_effects()[NAME]
    fits = [
        judge.in_sample(CompositeModel((started(state, form),)), iterations=DEFAULT_SETTINGS.coarse_iterations)
        for form in forms
    ]
    best = min(fits, key=lambda fit: fit.cost)
    return best.composite.links[0], best.features


def _newtons(pair: Pair) -> str:
    """The force filter in newtons, by the simulator's sensor model."""
    model = pair.sensor_model
    if model is None:
        return "; the simulation has no sensor model"
    if model.full_scale_drop_counts <= FORCE_FILTER_COUNTS:
        return "; not reached by any force in the simulator's sensor model"
    force = (
        float(np.median(model.half_force_n))
        * FORCE_FILTER_COUNTS
        / (model.full_scale_drop_counts - FORCE_FILTER_COUNTS)
    )
    return f", {force:.3g} N in the simulator's sensor model"


def _rules(pair: Pair) -> str:
    names = dict.fromkeys(item for item, _ in pair.conditions)
    used = ", ".join(f"{name} {get_outlier_filter(name).description}" for name in names)
    return f"neighbours / standard deviations: {used}"


def _values(link: FittedEffect) -> str:
    """Form and values of contact propagation."""
    spread, strength = link.values[:, 0]
    return f"fitted alone: variant {link.effect.variant}, spread {spread:.3g} mm, strength {strength:.2g}"
