"""Complete diagnosis of two datasets: reading, gap, comparison of sets of effects, held-out evaluation and report."""

from __future__ import annotations

import time
from collections.abc import Collection
from dataclasses import dataclass
from os import PathLike
from types import MappingProxyType
from typing import Any

from threadpoolctl import threadpool_limits

from taxel.gap.apply.resimulation import ResimulatedSet, Resimulator, resimulate_sets
from taxel.gap.calibration.calibration import UNKNOWN
from taxel.gap.comparison.compare import Comparison, ProgressCallback, compare_sets, ignore_progress
from taxel.gap.comparison.settings import DEFAULT_SETTINGS
from taxel.gap.data.missing_inputs import GEOMETRY, POSES
from taxel.gap.data.pair import Pair, read_pair
from taxel.gap.data.prepare import prepare_pair
from taxel.gap.effects.catalogue import DROPOUT, choose_effects
from taxel.gap.features.cloud_gap import NO_CLOUD_GAP, compute_cloud_gap
from taxel.gap.features.features import FeatureLayout, SessionMeans
from taxel.gap.features.metric import Gap
from taxel.gap.fitting.composite import CompositeModel
from taxel.gap.fitting.fit_data import FitData
from taxel.gap.fitting.priors import Priors
from taxel.gap.identifiability.confounding import find_confounded_effects
from taxel.gap.identifiability.identify import compute_similarities
from taxel.gap.localisation.signature.bank import describe_unexplained
from taxel.gap.report.assembly import ReportInputs, build_report
from taxel.gap.report.thesis_terms import build_thesis_terms
from taxel.gap.verdict.attribution import compute_attribution
from taxel.gap.verdict.explanation import Explanation, fit_explanation, list_fits_alone
from taxel.gap.verdict.headlines import REAL_AND_SIMULATED, TWO_REAL
from taxel.gap.verdict.held_out import HeldOut, compute_held_out
from taxel.gap.verdict.nested import select_composites_without_session
from taxel.gap.verdict.reasons import list_reasons
from taxel.gap.verdict.verdict import Verdict, derive_verdict, list_causes, list_leading_effects


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """All results of a diagnosis.

    Attributes:
        pair: the two datasets. layout: order and weights of the features. real: features of the real sessions.
        fit_data: data and weights of the fits.
        gap: gap, floor and excess. comparison: the comparison of the sets of effects.
        explanation: the effects that the verdict names. held_out: their evaluation on sessions outside the fit.
        verdict: status, named effects and reasons.
        report: the report as a dictionary, as written to files.
    """

    pair: Pair
    layout: FeatureLayout
    real: SessionMeans
    fit_data: FitData
    gap: Gap
    comparison: Comparison
    explanation: Explanation
    held_out: HeldOut
    verdict: Verdict
    report: dict[str, Any]


def diagnose(
    real_path: str | PathLike[str],
    sim_path: str | PathLike[str],
    without: Collection[str] = (),
    seed: int = 0,
    show: ProgressCallback = ignore_progress,
    priors: Priors = MappingProxyType({}),
    nested: bool = False,
    resimulator: Resimulator | None = None,
) -> Diagnosis:
    """Return the diagnosis of the gap between two datasets: its location, its causes and its shrink.

    without: names of effects that are excluded from the catalogue. seed: seed of the bootstrap, of the p-values and of
    the random taxels in the gap in millimetres (`compute_cloud_gap`). show: called with the stage and the progress of
    the stage. priors: priors on parameters of effects. nested: if True, the comparison is repeated without each
    session, and its result is evaluated on this session; the run time grows with the number of sessions. resimulator:
    simulates with the most probable sets of effects, whose measured gaps then decide. Raises DatasetError and
    GapInputError with a one-line message.
    """
    start_s = time.perf_counter()
    forms = choose_effects(without, priors)
    with threadpool_limits(limits=1):  # threads are slower for small matrices, because they mostly wait for each other
        pair = read_pair(real_path, sim_path, lambda done, total: show("reading", done, total))
        fit_data = prepare_pair(pair)
        nested_composites: tuple[CompositeModel, ...] = ()
        if nested:
            nested_composites = select_composites_without_session(
                fit_data, forms, seed, lambda number, total: show("nested", number, total)
            )
        comparison = compare_sets(fit_data, forms, seed, DEFAULT_SETTINGS, show)
        resimulated: tuple[ResimulatedSet, ...] = ()
        if resimulator is not None:
            resimulation = resimulate_sets(comparison, resimulator, seed, show)
            comparison, resimulated = resimulation.comparison, resimulation.results
        probabilities = comparison.compute_probabilities()
        causes = list_causes(probabilities)
        show("held-out evaluation", 0, 1)
        state, real, layout, gap = fit_data.state, fit_data.sessions, fit_data.layout, comparison.gap
        named = fit_explanation(comparison, [name for name in causes if name != UNKNOWN])
        held_out = compute_held_out(fit_data, named.composite, composites_without_session=nested_composites)
        attribution = compute_attribution(fit_data, named.names, held_out)
        fitted = [one for one in named.composite.fitted_effects if one.effect.name != DROPOUT]
        similarities = compute_similarities(fit_data, forms, fitted)
        remainder = describe_unexplained(pair, layout, real, named.features, fit_data.condition_folds, seed)
        rivals = {name: comparison.list_rivals(name) for name in list_leading_effects(probabilities)}
        reasons = list_reasons(named.composite, pair.faults)
        sides = TWO_REAL if pair.is_real_real else REAL_AND_SIMULATED
        verdict = derive_verdict(gap, probabilities, held_out, rivals, reasons, sides)
        single_fits = list_fits_alone(comparison, forms)
        report = build_report(
            ReportInputs(
                comparison=comparison,
                forms=forms,
                named=named,
                alone=single_fits,
                held_out=held_out,
                attribution=attribution,
                verdict=verdict,
                unexplained=remainder,
                similarities=similarities,
                confounded=find_confounded_effects(named.names, verdict.rivals, similarities),
                seed=seed,
            )
        )
        if resimulator is not None:
            report["resimulated"] = [one.to_json() for one in resimulated]
        if nested:
            report["after"]["chosen_inside"] = [sorted(composite.names) for composite in nested_composites]
        has_clouds = not pair.missing_inputs & {GEOMETRY, POSES}
        report["gap"]["mm"] = compute_cloud_gap(pair, real, state.mean, seed) if has_clouds else dict(NO_CLOUD_GAP)
        report["thesis_terms"] = build_thesis_terms(fit_data, single_fits) if has_clouds else []
        report["notes"] = [
            f"the frames of the hand are shifted by {1e3 * state.shift_s:.0f} ms against those of the simulator"
        ]
        report["runtime_s"] = time.perf_counter() - start_s
        show("held-out evaluation", 1, 1)
    return Diagnosis(pair, layout, real, fit_data, gap, comparison, named, held_out, verdict, report)
