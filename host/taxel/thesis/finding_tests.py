"""Tests of the thesis's qualitative statements on the results of a reproduction.

A test of one object returns a number, which is shown with the finding, and whether the statement holds. CAD: CAD model
of the object. SOR: statistical outlier filter.
"""

from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import Final

import numpy as np

from taxel.thesis.cloud_names import CLEANED, FILTERED, REAL, SIM, SPREAD
from taxel.thesis.object_result import ObjectResult
from taxel.thesis.printed import FORCE_FILTER
from taxel.thesis.sor_settings import Setting, find_best_setting, find_common_setting, get_setting_rows
from taxel.thesis.statement import Evidence, Outcome, Test

SIGNIFICANT: Final = 2.0
"""Factor from which a number is treated as "significantly" or "much" larger. Convention of this project, not
calibrated: with a factor of 1, each such finding would require only an inequality."""

RESOLUTION_M: Final = 1e-5
"""Resolution of the printed distances, metres. An increase up to this resolution does not contradict a decrease."""

AFTER_SURGE: Final = 200
"""Threshold after the surge, counts: the next one that the thesis tested above 190."""

LARGEST_THRESHOLD: Final = 320
"""Largest threshold of the force filter, counts (Tables I-1 to I-3)."""

SINGLE_APPROACH_PERCENT: Final = 95.0
"""Share of single approaches that have to be identified: requirement of this project. The thesis identifies whole
clouds only."""

KEYS: Final = ("mean_m", "rms_m")
"""Statistics of a distance that the statements compare."""


def each(compute: Callable[[ObjectResult], Outcome]) -> Test:
    """Return a test that applies `compute` to the result of every object."""
    return lambda evidence: {result.printed_name: compute(result) for result in evidence.results}


def compute_decrease(before: float, after: float) -> float:
    """Compute the relative decrease from `before` to `after`, percent."""
    return 100.0 * (before - after) / before if before > 0.0 else 0.0


def compute_removed_share(result: ObjectResult, threshold: int) -> float:
    """Compute the share of the real points that the force filter removes at a threshold in counts, percent."""
    return compute_decrease(result.cad[REAL].points, result.force[threshold].points)


def is_denser(result: ObjectResult) -> Outcome:
    """Test whether the real cloud has more points than the simulated cloud. Returned number: ratio of the points."""
    ratio = result.cad[REAL].points / max(result.cad[SIM].points, 1)
    return ratio, ratio > 1.0


def is_noisier(result: ObjectResult) -> Outcome:
    """Test whether the standard deviation of the distances to CAD is much larger for the real cloud.

    Returned number: standard deviation of the real cloud divided by that of the simulated cloud.
    """
    ratio = result.cad[REAL].std_m / result.cad[SIM].std_m
    return ratio, ratio >= SIGNIFICANT


def is_sim_nearer(result: ObjectResult) -> Outcome:
    """Test whether mean and RMS distance to CAD are significantly smaller for the simulated cloud.

    Returned number: the smaller of the two ratios of the real to the simulated distance.
    """
    ratio = min(getattr(result.cad[REAL], key) / getattr(result.cad[SIM], key) for key in KEYS)
    return ratio, ratio >= SIGNIFICANT


def has_outliers(result: ObjectResult) -> Outcome:
    """Test whether the real cloud has points farther from CAD than any simulated point.

    Returned number: largest distance of the real cloud divided by that of the simulated cloud.
    """
    ratio = result.cad[REAL].max_m / result.cad[SIM].max_m
    return ratio, ratio > 1.0


def _list_steps(result: ObjectResult, key: str) -> dict[int, float]:
    """Return by how much each step of the force filter's threshold increases a distance, metres.

    Keys: threshold after the step. key: statistic of the distance.
    """
    thresholds = sorted(result.force)
    return {
        after: getattr(result.force[after], key) - getattr(result.force[before], key)
        for before, after in pairwise(thresholds)
    }


def falls_at_first(result: ObjectResult) -> Outcome:
    """Test whether mean and RMS distance to the CAD model decrease from the first threshold to 190 counts.

    A step is one step of the threshold of the force filter; the first threshold is 150 counts. No step may increase a
    distance by more than `RESOLUTION_M`, the resolution of the printed distances.
    Returned number: decrease of the mean, percent.
    """
    first, last = result.force[min(result.force)], result.force[FORCE_FILTER]
    steps = [step for key in KEYS for threshold, step in _list_steps(result, key).items() if threshold <= FORCE_FILTER]
    falls = all(getattr(last, key) < getattr(first, key) for key in KEYS)
    return compute_decrease(first.mean_m, last.mean_m), falls and max(steps) <= RESOLUTION_M


def surges(result: ObjectResult) -> Outcome:
    """Test whether the step from 190 to 200 counts increases mean and RMS distance to the CAD model most of all steps.

    A step is one step of the threshold of the force filter.
    Returned number: increase of the mean, percent.
    """
    steps = {key: _list_steps(result, key) for key in KEYS}
    is_largest = all(step[AFTER_SURGE] > 0.0 and step[AFTER_SURGE] == max(step.values()) for step in steps.values())
    return -compute_decrease(result.force[FORCE_FILTER].mean_m, result.force[AFTER_SURGE].mean_m), is_largest


def loses_most_at_surge(result: ObjectResult) -> Outcome:
    """Test whether the step from 190 to 200 counts removes more points than every earlier step.

    A step is one step of the threshold of the force filter.
    Returned number: share of the points that this step removes, percent.
    """
    thresholds = [threshold for threshold in sorted(result.force) if threshold <= AFTER_SURGE]
    removed = [
        compute_removed_share(result, after) - compute_removed_share(result, before)
        for before, after in pairwise(thresholds)
    ]
    return removed[-1], removed[-1] > max(removed[:-1])


def is_smallest_above(result: ObjectResult) -> Outcome:
    """Test whether mean and RMS distance to the CAD model are smallest at a threshold above 190 counts.

    Returned number: threshold with the smallest mean distance, counts.
    """
    best = {key: min(result.force, key=lambda t: getattr(result.force[t], key)) for key in KEYS}
    return float(best["mean_m"]), all(threshold > FORCE_FILTER for threshold in best.values())


def loses_majority(result: ObjectResult) -> Outcome:
    """Test whether the force filter removes the majority of the points at the largest threshold.

    Returned number: percentage of the points that the filter removes.
    """
    removed = compute_removed_share(result, LARGEST_THRESHOLD)
    return removed, removed > 50.0


def keeps_majority(result: ObjectResult) -> Outcome:
    """Test whether the majority of the points has a signal above 190 counts.

    Returned number: percentage of the points.
    """
    kept = 100.0 - compute_removed_share(result, FORCE_FILTER)
    return kept, kept > 50.0


def does_sor_improve(result: ObjectResult) -> Outcome:
    """Test whether SOR (statistical outlier removal) lowers mean and RMS distance to CAD of the force-filtered cloud.

    Returned number: decrease of the mean, percent.
    """
    before, after = result.cad[FILTERED], result.cad[CLEANED]
    return compute_decrease(before.mean_m, after.mean_m), all(
        getattr(after, key) < getattr(before, key) for key in KEYS
    )


def _get_best_settings(evidence: Evidence) -> dict[str, Setting] | None:
    """Return the best SOR setting of each object; None if an object has no results for several settings."""
    if any(not result.sor for result in evidence.results):
        return None
    return {result.printed_name: find_best_setting(result) for result in evidence.results}


def do_best_settings_vary(evidence: Evidence) -> Mapping[str, Outcome] | None:
    """Test whether the best settings of SOR (statistical outlier removal) differ between objects.

    Returned number: how many objects have other settings. Returns None if an object has no results for several
    settings.
    """
    best = _get_best_settings(evidence)
    if best is None:
        return None
    others = {name: sum(setting != best[name] for setting in best.values()) for name in best}
    return {name: (float(count), len(set(best.values())) > 1) for name, count in others.items()}


def is_prism_n_larger(evidence: Evidence) -> Mapping[str, Outcome] | None:
    """Test whether the best N is 20, the smallest, for rectangular prism and cylinder, and larger for triangular prism.

    N is the number of neighbours that SOR compares. Returns None if an object has no results for several settings.
    Returned number: N in percent of the cloud's points.
    """
    best = _get_best_settings(evidence)
    if best is None:
        return None
    return {
        result.printed_name: (
            best[result.printed_name].compute_share(result.cad[FILTERED].points),
            best[result.printed_name].is_small_n == (result.printed_name != "triangular"),
        )
        for result in evidence.results
    }


def is_box_sigma_lower(evidence: Evidence) -> Mapping[str, Outcome] | None:
    """Test whether the best nSigma of the rectangular prism is below those of the other two objects.

    nSigma is the threshold of SOR in standard deviations. Returned number: best nSigma of the object. Returns None if
    an object has no results for several settings.
    """
    best = _get_best_settings(evidence)
    if best is None:
        return None
    box = best["rectangular"].n_sigma
    others = {name: setting.n_sigma for name, setting in best.items() if name != "rectangular"}
    holds = {name: sigma > box for name, sigma in others.items()}
    holds["rectangular"] = all(holds.values())
    return {name: (setting.n_sigma, holds[name]) for name, setting in best.items()}


def is_one_setting_possible(evidence: Evidence) -> Mapping[str, Outcome] | None:
    """Test whether one setting of SOR (statistical outlier removal) lowers the RMS distance to CAD of all objects.

    Returns None if no setting is printed for all objects.
    Returned number: decrease of the RMS, percent.
    """
    common = find_common_setting(evidence.results)
    if common is None:
        return None
    outcomes = {}
    for result in evidence.results:
        decrease = compute_decrease(result.cad[FILTERED].rms_m, get_setting_rows(result)[common].rms_m)
        outcomes[result.printed_name] = decrease, decrease > 0.0
    return outcomes


def propagation_adds_points(result: ObjectResult) -> Outcome:
    """Test whether contact propagation brings the number of simulated points nearer to that of the real points.

    Returned number: simulated points after propagation divided by unfiltered real points.
    """
    real, before, after = (result.cad[name].points for name in (REAL, SIM, SPREAD))
    distance = [abs(float(np.log(max(points, 1) / max(real, 1)))) for points in (before, after)]
    return after / max(real, 1), after > before and distance[1] < distance[0]


def propagation_worsens(result: ObjectResult) -> Outcome:
    """Test whether contact propagation increases mean and RMS distance of the simulated cloud to the CAD model.

    Returned number: mean after propagation divided by mean before.
    """
    before, after = result.cad[SIM], result.cad[SPREAD]
    return after.mean_m / before.mean_m, all(getattr(after, key) > getattr(before, key) for key in KEYS)


def propagation_nears_reality(result: ObjectResult) -> Outcome:
    """Test whether contact propagation brings the distances of the simulated cloud nearer to those of the real cloud.

    Mean and RMS distance of the simulated cloud to the CAD model are compared with those of the treated real cloud.
    Returned number: mean of the treated real cloud divided by that of the simulated cloud after propagation.
    """
    real, before, after = (result.cad[name] for name in (CLEANED, SIM, SPREAD))
    holds = all(
        abs(np.log(getattr(real, key) / getattr(after, key))) < abs(np.log(getattr(real, key) / getattr(before, key)))
        for key in KEYS
    )
    return real.mean_m / after.mean_m, holds


def loses_outliers(result: ObjectResult) -> Outcome:
    """Test whether both filters together lower the largest distance to CAD. Returned number: decrease, percent."""
    decrease = compute_decrease(result.cad[REAL].max_m, result.cad[CLEANED].max_m)
    return decrease, decrease > 0.0


def is_propagation_prevalent(evidence: Evidence) -> Mapping[str, Outcome] | None:
    """Test whether contact propagation changes more grasps than each filter.

    Returned number: percentage of changed grasps. Returns None for results without prevalence.
    """
    if any(not result.prevalence for result in evidence.results):
        return None
    return {
        result.printed_name: (
            100.0 * result.prevalence[SPREAD],
            result.prevalence[SPREAD] > max(result.prevalence[FILTERED], result.prevalence[CLEANED]),
        )
        for result in evidence.results
    }


def are_outliers_on_lines(evidence: Evidence) -> Mapping[str, Outcome] | None:
    """Test whether points removed by SOR share electrode lines with contacts more often than inactive taxels do.

    Returned number: ratio of the two shares; 0 if it is undefined. Returns None for results without line shares.
    """
    if any(result.line_shares is None for result in evidence.results):
        return None
    ratios = {result.printed_name: result.line_shares.ratio for result in evidence.results if result.line_shares}
    return {name: (ratio or 0.0, (ratio or 0.0) > 1.0) for name, ratio in ratios.items()}


def is_smallest_for_prism(compute: Callable[[ObjectResult], float]) -> Test:
    """Return a test of whether a number is smaller for the triangular prism than for the other objects.

    compute: computes the number of one object.
    """

    def test(evidence: Evidence) -> Mapping[str, Outcome]:
        """Compare the numbers; for another object, the statement holds if its number exceeds that of the prism."""
        values = {result.printed_name: compute(result) for result in evidence.results}
        prism = values["triangular"]
        holds = {name: prism < value for name, value in values.items() if name != "triangular"}
        holds["triangular"] = all(holds.values())
        return {name: (value, holds[name]) for name, value in values.items()}

    return test


def has_own_model_nearest(result: ObjectResult) -> Outcome:
    """Test whether mean and RMS of the treated real and simulated clouds are smallest for the object's own CAD model.

    Returned number: smallest distance to another model divided by that to the own model, smallest over clouds and
    statistics.
    """
    margins = []
    for side in (REAL, SIM):
        by_mesh = {mesh: stats for (cloud, mesh), stats in result.cross.items() if cloud == side}
        own_model = by_mesh.pop(result.printed_name)
        margins += [min(getattr(stats, key) for stats in by_mesh.values()) / getattr(own_model, key) for key in KEYS]
    return min(margins), min(margins) > 1.0


def are_shapes_identified(group: str, percent: float) -> Test:
    """Return a test of whether at least `percent` of the clouds of all objects together are identified correctly.

    group: `WHOLE_CLOUDS` or `SINGLE_APPROACHES`. The candidate models are the three objects. Returned number:
    percentage of the object's clouds that are identified.
    """

    def test(evidence: Evidence) -> Mapping[str, Outcome] | None:
        """Return the outcome by object: its own percentage, and whether the percentage of all objects is sufficient.

        Only identifications with all objects as candidate models are used. None without such identifications.
        """
        counts = [count for count in evidence.shapes if count.group == group and count.models == len(evidence.results)]
        if not counts:
            return None
        total = 100.0 * sum(count.identified for count in counts) / max(sum(count.total for count in counts), 1)
        return {count.object: (100.0 * count.identified / max(count.total, 1), total >= percent) for count in counts}

    return test
