"""The gap in the terms of the thesis of this skin: the distance of the contact clouds after each treatment of 5.6.2.

The thesis filters clouds by force and by statistical outlier removal (SOR), and activates the neighbours of the active
taxels of the simulator; its tables I-10 to I-12 contain the distance after each treatment. The thesis filters only the
clouds of the hand. Here the simulator provides counts, and the clouds of both sides are filtered: a filter on one side
alone would produce a gap. Contact propagation is fitted. Distances are those of `cloud_gap`: for each condition and
session, in world coordinates, without registration.
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
from taxel.gap.features.cloud_gap import MIN_PROBABILITY, THRESHOLD_WIDTH_COUNTS, compute_chamfer_mm
from taxel.gap.features.features import compute_known_mean
from taxel.gap.features.metric import compute_terms, sum_terms
from taxel.gap.fitting.composite import CompositeModel, FittedEffect
from taxel.gap.fitting.fit import start_effect
from taxel.gap.fitting.fit_data import FitData
from taxel.recording.grasp_format import ACTIVE_SIGNAL_COUNTS, Phase
from taxel.types import BoolArray, FloatArray

GRASPS_PER_APPROACH: Final = 10.0
"""Points of a taxel that is always active in the cloud of all grasps of an object, for each approach. The thesis made
ten grasps of nearly every approach (Table 5.1). With this constant the result does not depend on the number of
recorded repeats."""

INITIAL_NEIGHBOURS: Final = 32
"""Number of nearest positions in the first search for neighbours; the search is repeated with four times as many for
positions whose neighbours have too few points. Affects the run time only."""

DISTANCE_TOLERANCE_M: Final = 1e-9
"""Mean distances that differ by less are treated as equal, metres, so that a regular grid has no outlier."""

PROPAGATION: Final = "contact_propagation"
"""Name of the effect of the last step."""


def build_thesis_terms(
    fit_data: FitData, alone: Mapping[str, tuple[CompositeModel, FloatArray]]
) -> list[dict[str, Any]]:
    """Return the report field `thesis_terms`: the gap after each treatment of the contact clouds, as in the thesis.

    A contact cloud contains the positions of the active taxels. There is one entry for each treatment, in the order of
    application: unfiltered, force filter, then statistical outlier removal (SOR) in addition, then contact propagation
    in addition.

    Fields of an entry: `step`, name of the treatment; `gap`, counts, None for a treatment that changes no count; `mm`,
    distance as in `gap.mm` with the filters on both clouds, millimetres; `mm_hand_only`, distance with the filters on
    the clouds of the hand only (both None without data, or for a skipped treatment); `points`, expected number of
    active taxels if every condition is grasped once; `note`, settings of the treatment.

    alone: fits of single effects by name, with features f64[C, F, n] (C conditions, F features, n taxels).
    """
    pair, real, layout, before = fit_data.state.pair, fit_data.sessions, fit_data.layout, fit_data.state.mean
    hold = int(pair.time_grid.find_bins(Phase.HOLD)[0])
    clouds = HandClouds(pair, real.value[:, :, hold])
    active, forceful = clouds.compute_activity(ACTIVE_SIGNAL_COUNTS), clouds.compute_activity(FORCE_FILTER_COUNTS)
    sim, sim_forceful = (
        compute_activity(before[:, hold], ACTIVE_SIGNAL_COUNTS),
        compute_activity(before[:, hold], FORCE_FILTER_COUNTS),
    )
    filtered, sim_filtered = clouds.remove_outliers(forceful), clouds.remove_outliers(sim_forceful)
    steps = [
        clouds.build_entry("unfiltered", active, sim, sim, f"active above a signal of {ACTIVE_SIGNAL_COUNTS:g} counts"),
        clouds.build_entry(
            "force filter",
            forceful,
            sim_forceful,
            sim,
            f"signal of {FORCE_FILTER_COUNTS:g} counts{_describe_force_filter(pair)}",
        ),
        clouds.build_entry("+ SOR", filtered, sim_filtered, sim, _describe_outlier_filters(pair)),
    ]
    steps[0]["gap"] = float(np.sqrt(sum_terms(compute_terms(real, before, layout).gap2)))
    found = _fit_propagation(fit_data, alone)
    if isinstance(found, str):
        skipped = {"step": f"contact propagation: not added, {found}", "gap": None, "mm": None, "mm_hand_only": None}
        return [*steps, {**skipped, "points": steps[-1]["points"], "note": found}]
    fitted_effect, after = found
    sim, sim_forceful = (
        compute_activity(after[:, hold], ACTIVE_SIGNAL_COUNTS),
        compute_activity(after[:, hold], FORCE_FILTER_COUNTS),
    )
    last = clouds.build_entry(
        "+ contact propagation",
        filtered,
        clouds.remove_outliers(sim_forceful),
        sim,
        _describe_propagation(fitted_effect),
    )
    last["gap"] = float(np.sqrt(sum_terms(compute_terms(real, after, layout).gap2)))
    return [*steps, last]


def compute_activity(signal_counts: FloatArray, threshold: float) -> FloatArray:
    """Compute the probability that a taxel is active in a repeat, in the shape of the signal; 0 for an unknown signal.

    signal_counts, threshold: counts. The probability is the normal distribution function of (signal - threshold) /
    `THRESHOLD_WIDTH_COUNTS`.
    """
    return np.where(np.isfinite(signal_counts), ndtr((signal_counts - threshold) / THRESHOLD_WIDTH_COUNTS), 0.0)


@dataclass(frozen=True, eq=False)
class HandClouds:
    """Contact clouds of the hand, their filters, and their distances to clouds of the simulator.

    A cloud is stored as the probability that each taxel is active. signal_counts: signal of the hand in hold, counts,
    f64[C, S, n] (C conditions, S sessions, n taxels).
    """

    pair: Pair
    signal_counts: FloatArray

    def compute_activity(self, threshold: float) -> FloatArray:
        """Compute the probability of activity of each taxel of the hand, f64[C, S, n] (C conditions, S sessions, n
        taxels). threshold: counts.
        """
        return compute_activity(self.signal_counts, threshold)

    @cached_property
    def has_data(self) -> BoolArray:
        """Whether a session contains data of a condition, bool[C, S] (C conditions)."""
        return np.asarray(np.isfinite(self.signal_counts).any(axis=2))

    @cached_property
    def positions(self) -> FloatArray:
        """Positions of the taxels in the frame of the grasped object, metres, f64[C, n, 3] (C conditions, n taxels)."""
        pose = self.pair.sensor_poses[:, self.pair.groups.sensor]
        world = np.einsum("cnij,nj->cni", pose[..., :3, :3], self.pair.taxels.position) + pose[..., :3, 3]
        poses = self.pair.object_poses
        return np.asarray(np.einsum("cji,cnj->cni", poses[:, :3, :3], world - poses[:, None, :3, 3]))

    def average_sessions(self, cloud: FloatArray) -> FloatArray:
        """Compute the mean of a cloud over the sessions with data of each condition, f64[C, n] (C conditions, n
        taxels); 0 without data.

        cloud: probabilities that a taxel is active, f64[C, S, n] (S sessions); a cloud f64[C, n] of the simulator is
        returned unchanged.
        """
        if cloud.ndim == 2:
            return cloud
        return np.nan_to_num(compute_known_mean(np.where(self.has_data[..., None], cloud, np.nan), 1))

    def remove_outliers(self, cloud: FloatArray) -> FloatArray:
        """Return a cloud, f64[C, S, n] (C conditions, S sessions, n taxels) or f64[C, n], in which the probability of
        outliers is 0.

        A point is an outlier with respect to the cloud of all grasps of the same object, see `find_outliers`.
        """
        mean = self.average_sessions(cloud)
        outlier = np.zeros(mean.shape, bool)
        names = np.array([item for item, _ in self.pair.conditions])
        for name in dict.fromkeys(names.tolist()):
            rows = names == name
            found = find_outliers(self.positions[rows].reshape(-1, 3), mean[rows].ravel(), get_outlier_filter(name))
            outlier[rows] = found.reshape(-1, mean.shape[1])
        return np.where(outlier[:, None] if cloud.ndim == 3 else outlier, 0.0, cloud)

    def compute_distance_mm(self, real: FloatArray, sim: FloatArray) -> float | None:
        """Compute the mean Chamfer distance between the contact clouds of hand and simulator, millimetres.

        The distance is averaged over the conditions of each session, then over the sessions; None without data. real,
        sim: probabilities that a taxel is active, f64[C, S, n] (C conditions, S sessions, n taxels) and f64[C, n].
        """
        distance_mm = np.full(self.has_data.shape, np.nan)
        for condition, session in np.argwhere(self.has_data):
            distance_mm[condition, session] = compute_chamfer_mm(
                self.positions[condition], real[condition, session], sim[condition]
            )
        mean_mm = float(compute_known_mean(compute_known_mean(distance_mm, 0), 0))
        return mean_mm if np.isfinite(mean_mm) else None

    def build_entry(
        self, step: str, real: FloatArray, sim: FloatArray, unfiltered: FloatArray, note: str
    ) -> dict[str, Any]:
        """Return the report entry of a treatment, with `gap` None.

        step: name of the treatment. real: treated cloud of the hand, f64[C, S, n] (C conditions, S sessions, n taxels).
        sim, unfiltered: clouds of the simulator with and without the filters, f64[C, n]. note: settings of the
        treatment.
        """
        mm = self.compute_distance_mm(real, sim)
        return {
            "step": step,
            "gap": None,
            "mm": mm,
            "mm_hand_only": mm if unfiltered is sim else self.compute_distance_mm(real, unfiltered),
            "points": {"real": float(self.average_sessions(real).sum()), "sim": float(sim.sum())},
            "note": note,
        }


def find_outliers(positions: FloatArray, probability: FloatArray, rule: OutlierFilter) -> BoolArray:
    """Return which points are statistical outliers (Rusu et al. 2008), bool[m].

    A point is an outlier if its mean distance to its nearest neighbours exceeds the mean over the cloud by more than
    `rule.deviations` standard deviations. The point itself is one of its neighbours, as in `taxel.cloud.filters`. A
    point with fewer than `rule.neighbours` neighbours is not an outlier.

    positions: positions of the taxels in all approaches of an object, f64[m, 3], metres. probability: f64[m],
    probability that each taxel is active; the number of points at a position is `GRASPS_PER_APPROACH` times this
    probability.
    """
    result = np.zeros(len(positions), bool)
    active = np.flatnonzero(probability > MIN_PROBABILITY)
    if len(active) < 2:
        return result
    points = GRASPS_PER_APPROACH * probability[active]
    # Without a stated number, a quarter of the points of the cloud are the neighbours. The point itself is one of them.
    wanted = rule.neighbours if rule.neighbours is not None else 0.25 * float(points.sum())
    mean = _compute_mean_distance(positions[active], points, max(wanted - 1.0, 1.0))
    known = np.isfinite(mean)
    if not known.any():
        return result
    cloud_mean = float(np.average(mean[known], weights=points[known]))
    deviation = float(np.sqrt(np.average((mean[known] - cloud_mean) ** 2, weights=points[known])))
    result[active[known & (mean > cloud_mean + rule.deviations * deviation + DISTANCE_TOLERANCE_M)]] = True
    return result


def _compute_mean_distance(positions: FloatArray, points: FloatArray, wanted: float) -> FloatArray:
    """Return the mean distance, metres, of each position to its nearest other points, f64[m]; NaN with fewer than
    `wanted` points.

    points: f64[m], number of points at each position, not necessarily an integer. wanted: number of nearest points.
    """
    tree, number = cKDTree(positions), len(positions)
    result = np.full(number, np.nan)
    rows, near = np.arange(number), min(INITIAL_NEIGHBOURS, number)
    while len(rows):
        remaining = []
        # parts of about a million pairs of positions, which limit the memory
        for part in np.array_split(rows, max(1, len(rows) * near // 1_000_000)):
            distance, index = (np.reshape(found, (len(part), near)) for found in tree.query(positions[part], near))
            # The points at one position are neighbours of each other, but no point is its own neighbour here.
            others = np.where(index == part[:, None], np.maximum(points[index] - 1.0, 0.0), points[index])
            taken = np.diff(np.minimum(np.cumsum(others, axis=1), wanted), axis=1, prepend=0.0)
            is_complete = taken.sum(axis=1) >= wanted * (1.0 - 1e-9)
            result[part[is_complete]] = (taken * distance)[is_complete].sum(axis=1) / wanted
            remaining.append(part[~is_complete])
        if near == number:
            break
        rows, near = np.concatenate(remaining), min(4 * near, number)
    return result


def _fit_propagation(
    fit_data: FitData, alone: Mapping[str, tuple[CompositeModel, FloatArray]]
) -> tuple[FittedEffect, FloatArray] | str:
    """Fit contact propagation alone; return the effect and the features f64[C, F, n] (C conditions, F features, n
    taxels), or a string with the reason if it is unavailable.

    alone: existing fits of single effects, which are used if they contain contact propagation.
    """
    state = fit_data.state
    reasons = [form.find_unavailable_reason(state) for form in catalogue.all_effects()[PROPAGATION]]
    if all(reasons):
        return reasons[0]
    if PROPAGATION in alone:
        composite = alone[PROPAGATION][0]
        return composite.fitted_effects[0], composite.predict_features(state)
    forms = catalogue.all_effects()[PROPAGATION]
    fits = [
        fit_data.fit_in_sample(
            CompositeModel((start_effect(state, form),)), iterations=DEFAULT_SETTINGS.coarse_iterations
        )
        for form in forms
    ]
    best = min(fits, key=lambda fit: fit.cost)
    return best.composite.fitted_effects[0], best.features


def _describe_force_filter(pair: Pair) -> str:
    """Return the end of a sentence that states the threshold of the force filter in newtons, by the sensor model of the
    simulator.
    """
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


def _describe_outlier_filters(pair: Pair) -> str:
    """Describe the settings of the outlier filter for each object."""
    names = dict.fromkeys(item for item, _ in pair.conditions)
    used = ", ".join(f"{name} {get_outlier_filter(name).description}" for name in names)
    return f"neighbours / standard deviations: {used}"


def _describe_propagation(fitted_effect: FittedEffect) -> str:
    """Describe form and values of contact propagation."""
    spread, strength, *shape = fitted_effect.values[:, 0].tolist()
    kernel = "".join(f", shape {value:.2g}" for value in shape)
    form = fitted_effect.effect.variant
    return f"fitted alone: variant {form}, spread {spread:.3g} mm, strength {strength:.2g}{kernel}"
