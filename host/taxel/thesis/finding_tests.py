"""The tests of the findings: one for each qualitative statement of section 5.6 and of the conclusion of the thesis."""

from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import Final

import numpy as np

from taxel.thesis.cloud_names import CLEANED, FILTERED, REAL, SIM, SPREAD
from taxel.thesis.object_result import ObjectResult
from taxel.thesis.printed import FORCE_FILTER, STAGES
from taxel.thesis.printed_result import build_printed_results
from taxel.thesis.shape_counts import SINGLE_APPROACHES, WHOLE_CLOUDS
from taxel.thesis.sor_settings import Setting, find_best_setting, find_common_setting, get_setting_rows
from taxel.thesis.statement import Evidence, Outcome, Statement, Test
from taxel.thesis.tables import compute_contributions

SIGNIFICANT: Final = 2.0
"""Factor that counts as "significantly" or "much" larger. Convention of this project, not calibrated: with 1, each such
finding would require only an inequality."""

RESOLUTION_M: Final = 1e-5
"""Resolution of the printed distances, metres. A step without a visible change does not contradict a decrease."""

AFTER_SURGE: Final = 200
"""Threshold after the surge, counts: the next one that the thesis tested above 190."""

LARGEST_THRESHOLD: Final = 320
"""Largest threshold of the force filter, counts (Tables I-1 to I-3)."""

SINGLE_APPROACH_PERCENT: Final = 95.0
"""Share of single approaches that have to be identified: requirement of this project. The thesis identifies whole
clouds only."""

KEYS: Final = ("mean_m", "rms_m")


def _each(compute: Callable[[ObjectResult], Outcome]) -> Test:
    """Return a test that computes the outcome of every object on its own."""
    return lambda evidence: {result.printed_name: compute(result) for result in evidence.results}


def _decrease(before: float, after: float) -> float:
    """Compute the relative decrease from `before` to `after`, percent."""
    return 100.0 * (before - after) / before if before > 0.0 else 0.0


def _removed(result: ObjectResult, threshold: int) -> float:
    """Compute the share of the real points that the force filter removes at a threshold in counts, percent."""
    return _decrease(result.cad[REAL].points, result.force[threshold].points)


def _decline(result: ObjectResult, step: int, key: str = "mean_m") -> float:
    """Compute the decrease of the real-to-sim distance by a step of the treatment, millimetres."""
    return 1e3 * float(getattr(result.to_sim[STAGES[step]], key) - getattr(result.to_sim[STAGES[step + 1]], key))


FORCE_STEP, SOR_STEP, PROPAGATION_STEP = 0, 1, 2
"""Steps of the treatment, for `_decline`."""


def _is_denser(result: ObjectResult) -> Outcome:
    """Test whether the real cloud has more points than the simulated one."""
    ratio = result.cad[REAL].points / max(result.cad[SIM].points, 1)
    return ratio, ratio > 1.0


def _is_noisier(result: ObjectResult) -> Outcome:
    """Test whether the standard deviation of the distances to the CAD model is much larger for the real cloud."""
    ratio = result.cad[REAL].std_m / result.cad[SIM].std_m
    return ratio, ratio >= SIGNIFICANT


def _is_sim_nearer(result: ObjectResult) -> Outcome:
    """Test whether mean and RMS distance to the CAD model are significantly smaller for the simulated cloud."""
    ratio = min(getattr(result.cad[REAL], key) / getattr(result.cad[SIM], key) for key in KEYS)
    return ratio, ratio >= SIGNIFICANT


def _has_outliers(result: ObjectResult) -> Outcome:
    """Test whether the real cloud has points farther from the CAD model than any simulated point."""
    ratio = result.cad[REAL].max_m / result.cad[SIM].max_m
    return ratio, ratio > 1.0


def _list_steps(result: ObjectResult, key: str) -> dict[int, float]:
    """Return the increase of a distance by each step of the threshold, metres, by the threshold after the step."""
    thresholds = sorted(result.force)
    return {
        after: getattr(result.force[after], key) - getattr(result.force[before], key)
        for before, after in pairwise(thresholds)
    }


def _falls_at_first(result: ObjectResult) -> Outcome:
    """Test whether mean and RMS fall from 150 to 190 counts, without an increase in any step."""
    first, last = result.force[min(result.force)], result.force[FORCE_FILTER]
    steps = [step for key in KEYS for threshold, step in _list_steps(result, key).items() if threshold <= FORCE_FILTER]
    falls = all(getattr(last, key) < getattr(first, key) for key in KEYS)
    return _decrease(first.mean_m, last.mean_m), falls and max(steps) <= RESOLUTION_M


def _surges(result: ObjectResult) -> Outcome:
    """Test whether the step from 190 to 200 counts increases mean and RMS, more than any other step does."""
    steps = {key: _list_steps(result, key) for key in KEYS}
    is_largest = all(step[AFTER_SURGE] > 0.0 and step[AFTER_SURGE] == max(step.values()) for step in steps.values())
    return -_decrease(result.force[FORCE_FILTER].mean_m, result.force[AFTER_SURGE].mean_m), is_largest


def _loses_most_at_surge(result: ObjectResult) -> Outcome:
    """Test whether the step from 190 to 200 counts removes more points than every earlier step of 10 counts."""
    thresholds = [threshold for threshold in sorted(result.force) if threshold <= AFTER_SURGE]
    removed = [_removed(result, after) - _removed(result, before) for before, after in pairwise(thresholds)]
    return removed[-1], removed[-1] > max(removed[:-1])


def _is_smallest_above(result: ObjectResult) -> Outcome:
    """Test whether mean and RMS are smallest at a threshold above 190 counts."""
    best = {key: min(result.force, key=lambda t: getattr(result.force[t], key)) for key in KEYS}
    return float(best["mean_m"]), all(threshold > FORCE_FILTER for threshold in best.values())


def _loses_majority(result: ObjectResult) -> Outcome:
    """Test whether the force filter removes the majority of the points at the largest threshold."""
    removed = _removed(result, LARGEST_THRESHOLD)
    return removed, removed > 50.0


def _keeps_majority(result: ObjectResult) -> Outcome:
    """Test whether the majority of the points has a signal above the selected threshold."""
    kept = 100.0 - _removed(result, FORCE_FILTER)
    return kept, kept > 50.0


def _does_sor_improve(result: ObjectResult) -> Outcome:
    """Test whether the outlier filter lowers mean and RMS of the force-filtered cloud."""
    before, after = result.cad[FILTERED], result.cad[CLEANED]
    return _decrease(before.mean_m, after.mean_m), all(getattr(after, key) < getattr(before, key) for key in KEYS)


def _get_best_settings(evidence: Evidence) -> dict[str, Setting] | None:
    """Return the best outlier filter of each object; None without the sweep."""
    if any(not result.sor for result in evidence.results):
        return None
    return {result.printed_name: find_best_setting(result) for result in evidence.results}


def _do_best_settings_vary(evidence: Evidence) -> Mapping[str, Outcome] | None:
    """Test whether the best settings of the outlier filter differ. Number: objects with other settings."""
    best = _get_best_settings(evidence)
    if best is None:
        return None
    others = {name: sum(setting != best[name] for setting in best.values()) for name in best}
    return {name: (float(count), len(set(best.values())) > 1) for name, count in others.items()}


def _is_prism_n_larger(evidence: Evidence) -> Mapping[str, Outcome] | None:
    """Test whether the best N is the smallest one for the two simpler objects, and larger for the triangular prism.

    Number: N in percent of the cloud.
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


def _is_box_sigma_lower(evidence: Evidence) -> Mapping[str, Outcome] | None:
    """Test whether the best nSigma of the rectangular prism is below those of the other two objects."""
    best = _get_best_settings(evidence)
    if best is None:
        return None
    box = best["rectangular"].n_sigma
    others = {name: setting.n_sigma for name, setting in best.items() if name != "rectangular"}
    holds = {name: sigma > box for name, sigma in others.items()}
    holds["rectangular"] = all(holds.values())
    return {name: (setting.n_sigma, holds[name]) for name, setting in best.items()}


def _is_one_setting_possible(evidence: Evidence) -> Mapping[str, Outcome] | None:
    """Test whether one setting of the outlier filter lowers the RMS of all objects. Number: decrease of the RMS."""
    common = find_common_setting(evidence.results)
    if common is None:
        return None
    outcomes = {}
    for result in evidence.results:
        decrease = _decrease(result.cad[FILTERED].rms_m, get_setting_rows(result)[common].rms_m)
        outcomes[result.printed_name] = decrease, decrease > 0.0
    return outcomes


def _propagation_adds_points(result: ObjectResult) -> Outcome:
    """Test whether propagation brings the number of simulated points nearer to that of real points.

    Number: simulated points after propagation over unfiltered real points.
    """
    real, before, after = (result.cad[name].points for name in (REAL, SIM, SPREAD))
    distance = [abs(float(np.log(max(points, 1) / max(real, 1)))) for points in (before, after)]
    return after / max(real, 1), after > before and distance[1] < distance[0]


def _propagation_worsens(result: ObjectResult) -> Outcome:
    """Test whether propagation raises mean and RMS of the simulated cloud to its CAD model."""
    before, after = result.cad[SIM], result.cad[SPREAD]
    return after.mean_m / before.mean_m, all(getattr(after, key) > getattr(before, key) for key in KEYS)


def _propagation_nears_reality(result: ObjectResult) -> Outcome:
    """Test whether mean and RMS to the CAD model of the simulated cloud come nearer to those of the treated real one.

    Number: mean of the treated real cloud over that of the simulated cloud after propagation.
    """
    real, before, after = (result.cad[name] for name in (CLEANED, SIM, SPREAD))
    holds = all(
        abs(np.log(getattr(real, key) / getattr(after, key))) < abs(np.log(getattr(real, key) / getattr(before, key)))
        for key in KEYS
    )
    return real.mean_m / after.mean_m, holds


def _loses_outliers(result: ObjectResult) -> Outcome:
    """Test whether both filters lower the largest distance to the CAD model. Number: decrease."""
    decrease = _decrease(result.cad[REAL].max_m, result.cad[CLEANED].max_m)
    return decrease, decrease > 0.0


def _sor_removes_farther_points(result: ObjectResult) -> Outcome:
    """Test whether SOR lowers the largest real-to-sim distance more than the force filter. Number: decrease by SOR."""
    largest = [result.to_sim[stage].max_m for stage in STAGES]
    by_force, by_sor = _decrease(largest[0], largest[1]), _decrease(largest[1], largest[2])
    return by_sor, by_sor > by_force


def _decreases_continuously(result: ObjectResult) -> Outcome:
    """Test whether mean and RMS fall at every step. Number: total decrease of the mean."""
    holds = all(_decline(result, step, key) > 0.0 for step in range(3) for key in KEYS)
    return _decrease(result.to_sim[STAGES[0]].mean_m, result.to_sim[STAGES[-1]].mean_m), holds


def _get_shares(result: ObjectResult, key: str) -> list[float]:
    """Return the share of each step in the decrease of a real-to-sim distance, percent."""
    return compute_contributions({stage: getattr(result.to_sim[stage], key) for stage in STAGES})


def _has_same_trend(result: ObjectResult) -> Outcome:
    """Test whether the three steps have the same order by mean and by RMS. Number: largest difference of shares."""
    declines = [[_decline(result, step, key) for step in range(3)] for key in KEYS]
    mean, rms = (_get_shares(result, key) for key in KEYS)
    difference = max(abs(first - second) for first, second in zip(mean, rms, strict=True))
    return difference, bool(np.array_equal(np.argsort(declines[0]), np.argsort(declines[1])))


def _compare_sor_and_force(evidence: Evidence) -> Mapping[str, Outcome]:
    """Test whether the larger one of the contributions of SOR and force filter is the same as in Tables I-10 to I-12.

    Number: decrease of the mean by SOR minus that by the force filter, mm.
    """

    def compare(result: ObjectResult) -> float:
        return _decline(result, SOR_STEP) - _decline(result, FORCE_STEP)

    printed = {result.printed_name: compare(result) for result in build_printed_results()}
    return {
        result.printed_name: (compare(result), (compare(result) > 0.0) == (printed[result.printed_name] > 0.0))
        for result in evidence.results
    }


def _is_propagation_largest(result: ObjectResult) -> Outcome:
    """Test whether propagation contributes most, by mean and by RMS. Number: share of the mean."""
    declines = [[_decline(result, step, key) for step in range(3)] for key in KEYS]
    return _get_shares(result, KEYS[0])[-1], all(steps[-1] > max(0.0, *steps[:-1]) for steps in declines)


def _is_propagation_prevalent(evidence: Evidence) -> Mapping[str, Outcome] | None:
    """Test whether propagation changes more grasps than each filter does. Number: share of grasps it changes."""
    if any(not result.prevalence for result in evidence.results):
        return None
    return {
        result.printed_name: (
            100.0 * result.prevalence[SPREAD],
            result.prevalence[SPREAD] > max(result.prevalence[FILTERED], result.prevalence[CLEANED]),
        )
        for result in evidence.results
    }


def _are_outliers_on_lines(evidence: Evidence) -> Mapping[str, Outcome] | None:
    """Test whether points removed by SOR share lines with contacts more often than inactive taxels do.

    Number: ratio of the shares; 0 if it is undefined.
    """
    if any(result.line_shares is None for result in evidence.results):
        return None
    ratios = {result.printed_name: result.line_shares.ratio for result in evidence.results if result.line_shares}
    return {name: (ratio or 0.0, (ratio or 0.0) > 1.0) for name, ratio in ratios.items()}


def _is_prism_force_step_small(evidence: Evidence) -> Mapping[str, Outcome]:
    """Test whether the force filter lowers the mean much less for the triangular prism. Number: decrease, mm."""
    declines = {result.printed_name: _decline(result, FORCE_STEP) for result in evidence.results}
    prism = declines["triangular"]
    holds = {name: SIGNIFICANT * prism <= value for name, value in declines.items() if name != "triangular"}
    holds["triangular"] = all(holds.values())
    return {name: (value, holds[name]) for name, value in declines.items()}


def _is_smallest_for_prism(compute: Callable[[ObjectResult], float]) -> Test:
    """Return a test of whether a number is smaller for the triangular prism than for the other objects."""

    def test(evidence: Evidence) -> Mapping[str, Outcome]:
        values = {result.printed_name: compute(result) for result in evidence.results}
        prism = values["triangular"]
        holds = {name: prism < value for name, value in values.items() if name != "triangular"}
        holds["triangular"] = all(holds.values())
        return {name: (value, holds[name]) for name, value in values.items()}

    return test


def _has_own_model_nearest(result: ObjectResult) -> Outcome:
    """Test whether mean and RMS of both treated clouds are smallest at the own model. Number: smallest margin."""
    margins = []
    for side in (REAL, SIM):
        by_mesh = {mesh: stats for (cloud, mesh), stats in result.cross.items() if cloud == side}
        own = by_mesh.pop(result.printed_name)
        margins += [min(getattr(stats, key) for stats in by_mesh.values()) / getattr(own, key) for key in KEYS]
    return min(margins), min(margins) > 1.0


def _are_shapes_identified(group: str, percent: float) -> Test:
    """Return a test of the share of identified clouds among the three objects, over all objects together.

    group: of clouds. percent: required share. Number: share of each object.
    """

    def test(evidence: Evidence) -> Mapping[str, Outcome] | None:
        counts = [count for count in evidence.shapes if count.group == group and count.models == len(evidence.results)]
        if not counts:
            return None
        total = 100.0 * sum(count.identified for count in counts) / max(sum(count.total for count in counts), 1)
        return {count.object: (100.0 * count.identified / max(count.total, 1), total >= percent) for count in counts}

    return test


STATEMENTS: Final = (
    Statement(
        "denser",
        "The real clouds are denser than the simulated ones.",
        "5.6.2, paragraph 1, sentence 2",
        "real over simulated points above 1",
        "1",
        _each(_is_denser),
    ),
    Statement(
        "noisier",
        "The real clouds are noisy; in simulation the noise is much less significant.",
        "5.6.2, paragraph 1, sentence 1",
        "real over simulated standard deviation of the distances to CAD at least 2",
        "1",
        _each(_is_noisier),
    ),
    Statement(
        "simulation_nearer",
        "RMS and mean to CAD are significantly lower for the simulated clouds, for the three shapes.",
        "5.6.2, paragraph 1, sentence 3, and paragraph 2; Table 5.3",
        "real over simulated, the smaller of mean and RMS, at least 2",
        "1",
        _each(_is_sim_nearer),
    ),
    Statement(
        "outliers",
        "The real cloud presents extra outlier points.",
        "5.6.2, paragraph 13, sentence 1; Figure 5.11",
        "largest distance to CAD, real over simulated, above 1",
        "1",
        _each(_has_outliers),
    ),
    Statement(
        "force_filter_falls",
        "At the beginning both RMS and mean decrease with the threshold of the force filter.",
        "5.6.2, paragraph 6, sentence 2; Figure 5.10",
        "mean and RMS to CAD fall from 150 to 190 counts, no step up (number: decrease of the mean)",
        "%",
        _each(_falls_at_first),
    ),
    Statement(
        "surge",
        "A sudden surge follows at 190, the value that the author selected.",
        "5.6.2, paragraph 6, sentences 2, 3 and 6; Figure 5.10",
        "the step from 190 to 200 counts raises mean and RMS, more than any other step (number: rise of the mean)",
        "%",
        _each(_surges),
    ),
    Statement(
        "surge_removes_data",
        "The surge is explained by the removal of semantic data, which becomes more evident there.",
        "5.6.2, paragraph 6, sentence 3; Tables I-1 to I-3",
        "the step from 190 to 200 counts removes more points than each earlier one (number: share removed)",
        "%",
        _each(_loses_most_at_surge),
    ),
    Statement(
        "smallest_above_190",
        "The smallest distances are reached at a threshold much higher than 190.",
        "5.6.2, paragraph 6, sentence 4",
        "mean and RMS to CAD are smallest above 190 counts (number: threshold of the smallest mean)",
        "counts",
        _each(_is_smallest_above),
    ),
    Statement(
        "high_threshold_not_semantic",
        "At such thresholds the clouds do not depict the shape although their distances are low.",
        "5.6.2, paragraph 6, sentence 4; 5.6.1, paragraph 5",
        "the force filter at 320 counts removes the majority of the points (number: share removed)",
        "%",
        _each(_loses_majority),
    ),
    Statement(
        "majority_above_190",
        "The majority of the contact points has forces above the selected threshold.",
        "5.6.2, paragraph 18, sentence 3",
        "share of the points above 190 counts over 50 %",
        "%",
        _each(_keeps_majority),
    ),
    Statement(
        "sor_improves",
        "SOR further improves the real clouds after the force filter.",
        "5.6.2, paragraph 7, sentences 2 and 6; Tables I-4 to I-6",
        "mean and RMS to CAD fall with the settings of Table 5.4 (number: decrease of the mean)",
        "%",
        _each(_does_sor_improve),
    ),
    Statement(
        "sor_settings_vary",
        "The best SOR settings vary from one shape to another.",
        "5.6.2, paragraph 8, sentence 1; Table 5.4",
        "the settings with the smallest mean are not the same for the three objects (number: objects with others)",
        "1",
        _do_best_settings_vary,
    ),
    Statement(
        "sor_n_of_prism",
        "The best N is larger for the triangular prism than for the other two shapes.",
        "5.6.2, paragraph 9, sentences 1 and 2; Table 5.4",
        "best N: 20 for rectangular prism and cylinder, larger for the triangular prism (number: N over the cloud)",
        "%",
        _is_prism_n_larger,
    ),
    Statement(
        "sor_sigma_of_box",
        "The best nSigma is lower for the rectangular prism than for the other two shapes.",
        "5.6.2, paragraph 9, sentence 3; Table 5.4",
        "best nSigma of the rectangular prism below those of the others (number: nSigma)",
        "1",
        _is_box_sigma_lower,
    ),
    Statement(
        "one_sor_setting",
        "One set of SOR settings can be selected for all the shapes.",
        "5.6.2, paragraph 10",
        "a printed setting lowers the RMS to CAD of all three objects (number: decrease of the RMS)",
        "%",
        _is_one_setting_possible,
    ),
    Statement(
        "propagation_densifies",
        "Contact propagation increases the density of the simulated clouds, towards the real one.",
        "5.6.2, paragraph 11, sentence 1, and paragraph 13, sentence 3",
        "more simulated points, and their number nearer to that of unfiltered real points (number: ratio to it)",
        "1",
        _each(_propagation_adds_points),
    ),
    Statement(
        "propagation_worsens",
        "Contact propagation decreases the CAD matching quality of the simulated clouds.",
        "5.6.2, paragraph 11, sentence 4; Table 5.5",
        "mean and RMS to CAD rise (number: mean after over before)",
        "1",
        _each(_propagation_worsens),
    ),
    Statement(
        "propagation_nears_reality",
        "By that it brings them closer to reality.",
        "5.6.2, paragraph 11, sentence 5",
        "mean and RMS to CAD come nearer to those of the treated real cloud (number: real over simulated mean)",
        "1",
        _each(_propagation_nears_reality),
    ),
    Statement(
        "treatment_removes_outliers",
        "The treated real data have little to no outliers.",
        "5.6.2, paragraph 13, sentence 3",
        "both filters lower the largest distance to CAD (number: decrease)",
        "%",
        _each(_loses_outliers),
    ),
    Statement(
        "sor_removes_outliers",
        "Outliers are left by the force filter; SOR eliminates most of them.",
        "5.6.2, paragraph 18, sentences 3, 4 and 6",
        "SOR lowers the largest real-to-sim distance more than the force filter (number: decrease by SOR)",
        "%",
        _each(_sor_removes_farther_points),
    ),
    Statement(
        "continuous_decrease",
        "RMS and mean between real and simulated cloud decrease continuously for all shapes.",
        "5.6.2, paragraph 15; Figure 5.12",
        "both fall at each of the three steps (number: total decrease of the mean)",
        "%",
        _each(_decreases_continuously),
    ),
    Statement(
        "same_trend",
        "By RMS the contributions of the steps have the same trend as by mean.",
        "5.6.2, paragraph 17, sentences 1 and 2; Figures I-4 to I-6",
        "the three steps have the same order (number: largest difference of shares)",
        "%",
        _each(_has_same_trend),
    ),
    Statement(
        "sor_against_force",
        "SOR contributes more than the force filter (by Table I-11 less, for the cylinder).",
        "5.6.2, paragraph 18, sentences 1 and 2; Tables I-10 to I-12",
        "the larger contribution of each shape is that of its table (number: SOR minus force filter)",
        "mm",
        _compare_sor_and_force,
    ),
    Statement(
        "propagation_largest",
        "Contact propagation has the highest contribution.",
        "5.6.2, paragraph 19, sentence 1, and paragraph 20, sentence 1; Figure 5.13",
        "it lowers mean and RMS more than each filter (number: its share of the decrease of the mean)",
        "%",
        _each(_is_propagation_largest),
    ),
    Statement(
        "propagation_prevalent",
        "Contact propagation occurs across all grasps; the noise that the filters remove is more localised.",
        "5.6.2, paragraph 20, sentence 1",
        "it changes more grasps than each filter (number: share of the grasps)",
        "%",
        _is_propagation_prevalent,
    ),
    Statement(
        "crosstalk",
        "Isolated points come from crosstalk: taxels that share an electrode with the contact are activated.",
        "5.6.2, paragraph 18, sentences 4 to 6",
        "points removed by SOR share a line with a contact more often than inactive taxels (number: ratio)",
        "1",
        _are_outliers_on_lines,
    ),
    Statement(
        "prism_force_step",
        "The contribution of the force filter is much lower for the triangular prism.",
        "5.6.2, paragraph 21, sentence 1; Figure 5.13",
        "decrease of the mean at most half of that of the others (number: decrease)",
        "mm",
        _is_prism_force_step_small,
    ),
    Statement(
        "prism_forces_higher",
        "The forces on the triangular prism are higher, so that little is left to remove.",
        "5.6.2, paragraph 21, sentences 2 and 3",
        "the force filter at 190 counts removes the smallest share of the triangular prism (number: share)",
        "%",
        _is_smallest_for_prism(lambda result: _removed(result, FORCE_FILTER)),
    ),
    Statement(
        "prism_propagation_step",
        "The contribution of contact propagation is lowest for the triangular prism.",
        "5.6.2, paragraph 21, sentence 4; Figure 5.13",
        "decrease of the mean below that of the others (number: decrease)",
        "mm",
        _is_smallest_for_prism(lambda result: _decline(result, PROPAGATION_STEP)),
    ),
    Statement(
        "prism_points",
        "The triangular prism has fewer contact points.",
        "5.6.2, paragraph 21, sentence 4; Table 5.2",
        "real points for each grasp below those of the others",
        "points",
        _is_smallest_for_prism(lambda result: result.cad[REAL].points / max(result.grasps, 1)),
    ),
    Statement(
        "own_model_nearest",
        "RMS and mean of treated real and simulated clouds are smallest with the CAD model of their own shape.",
        "5.6.2, paragraphs 22 and 23; Figure 5.14",
        "smallest ratio of another model to the own one, of both clouds and both measures, above 1",
        "1",
        _each(_has_own_model_nearest),
    ),
    Statement(
        "shape_of_whole_clouds",
        "The clouds accurately identify the shape that was grasped.",
        "5.6.2, paragraph 23, sentence 2; conclusion, paragraph 6, sentence 1",
        "all whole clouds, real and simulated, are identified among the three models (number: share)",
        "%",
        _are_shapes_identified(WHOLE_CLOUDS, 100.0),
    ),
    Statement(
        "shape_of_single_approaches",
        "The shape is identified; here from the grasps of a single approach.",
        "conclusion, paragraph 6, sentence 1; the extension to single approaches is a requirement of this project",
        "at least 95 % of the clouds of single approaches, all objects together (number: share)",
        "%",
        _are_shapes_identified(SINGLE_APPROACHES, SINGLE_APPROACH_PERCENT),
    ),
)
"""All statements that are tested, in the order of the text as far as possible."""

NOT_TESTED: Final = (
    (
        "5.6.2, paragraph 17, sentences 3 and 4",
        "An SOR filter on the raw cloud contributes differently than one after the force filter.",
        "true of almost any data; the thesis prints no number",
    ),
    (
        "5.6.2, paragraph 19, sentences 2 to 6",
        "SOR may remove genuine points that only a few grasps have.",
        "stated as a possibility",
    ),
    ("5.6.1, paragraph 4", "Visualization complements the metrics.", "a judgement by eye; see the figures"),
    (
        "5.6.2, paragraph 8, sentences 2 and 3",
        "Causes of the different SOR settings (hand, number of points, complexity of the surface).",
        "an explanation without a measurement",
    ),
)
"""Qualitative statements without a test: source, statement, reason."""
