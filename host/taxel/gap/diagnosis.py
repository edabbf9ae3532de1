"""The whole diagnosis of two datasets: read, measure, compare sets of effects, hold out, report."""

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
from taxel.gap.comparison.compare import Comparison, Show, compare_sets, ignore_progress
from taxel.gap.comparison.settings import DEFAULT_SETTINGS
from taxel.gap.data.lacking import GEOMETRY, POSES
from taxel.gap.data.pair import Pair, read_pair
from taxel.gap.data.prepare import prepared
from taxel.gap.effects.catalogue import DROPOUT, chosen
from taxel.gap.features.cloud_gap import NO_CLOUDS, cloud_gap
from taxel.gap.features.features import Layout, SessionMeans
from taxel.gap.features.metric import Gap
from taxel.gap.fitting.composite import CompositeModel
from taxel.gap.fitting.judge import Judge
from taxel.gap.fitting.priors import Priors
from taxel.gap.identifiability.confounding import confounded_with
from taxel.gap.identifiability.identify import compute_similarities
from taxel.gap.localisation.signature.bank import unexplained
from taxel.gap.report.assembly import ReportInputs, build_report
from taxel.gap.report.thesis_terms import thesis_terms
from taxel.gap.verdict.attribution import attribute
from taxel.gap.verdict.explanation import Explanation, explain, list_fits_alone
from taxel.gap.verdict.headlines import REAL_AND_SIMULATED, TWO_REAL
from taxel.gap.verdict.held_out import HeldOut, compute_held_out
from taxel.gap.verdict.nested import choose_without_sessions
from taxel.gap.verdict.reasons import list_reasons
from taxel.gap.verdict.verdict import Verdict, judge_verdict, list_causes, list_questioned


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """All results of a diagnosis; `report` is the form for files."""

    pair: Pair
    layout: Layout
    real: SessionMeans
    judge: Judge
    gap: Gap
    comparison: Comparison
    explanation: Explanation
    held: HeldOut
    verdict: Verdict
    report: dict[str, Any]


def diagnose(
    real_path: str | PathLike[str],
    sim_path: str | PathLike[str],
    without: Collection[str] = (),
    seed: int = 0,
    show: Show = ignore_progress,
    priors: Priors = MappingProxyType({}),
    nested: bool = False,
    resimulator: Resimulator | None = None,
) -> Diagnosis:
    """Say where the gap between two datasets lies, which effect causes it and how far it shrinks.

    without: names of the catalogue that are not tried. seed: of the bootstrap and of the p-values. priors: of the
    parameters of effects. nested: repeat the comparison without each session, and evaluate its choice there; this takes
    as many times as long. resimulator: simulates the most probable sets of effects, whose measured gaps then decide.
    Raises DatasetError and GapInputError with one line.
    """
    began = time.perf_counter()
    forms = chosen(without, priors)
    with threadpool_limits(limits=1):  # the matrices are small: threads would wait for each other
        pair = read_pair(real_path, sim_path, lambda done, total: show("reading", done, total))
        judge = prepared(pair)
        in_sample: tuple[CompositeModel, ...] = ()
        if nested:
            in_sample = choose_without_sessions(judge, forms, seed, lambda number, total: show("nested", number, total))
        comparison = compare_sets(judge, forms, seed, DEFAULT_SETTINGS, show)
        resimulated: tuple[ResimulatedSet, ...] = ()
        if resimulator is not None:
            resimulation = resimulate_sets(comparison, resimulator, seed, show)
            comparison, resimulated = resimulation.comparison, resimulation.results
        probabilities = comparison.compute_probabilities()
        causes = list_causes(probabilities)
        show("held-out evaluation", 0, 1)
        state, real, layout, gap = judge.state, judge.sessions, judge.layout, comparison.gap
        named = explain(comparison, [name for name in causes if name != UNKNOWN])
        held = compute_held_out(judge, named.composite, in_sample=in_sample)
        told = attribute(judge, named.names, held)
        fitted = [link for link in named.composite.links if link.effect.name != DROPOUT]
        likes = compute_similarities(judge, forms, fitted)
        left = unexplained(pair, layout, real, named.features, judge.fold, seed)
        rivals = {name: comparison.list_rivals(name) for name in list_questioned(probabilities)}
        doubts = list_reasons(judge, named.composite, pair.faults)
        sides = TWO_REAL if pair.is_real_real else REAL_AND_SIMULATED
        verdict = judge_verdict(gap, probabilities, held, rivals, doubts, sides)
        alone = list_fits_alone(comparison, forms)
        report = build_report(
            ReportInputs(
                comparison=comparison,
                forms=forms,
                named=named,
                alone=alone,
                held_out=held,
                attribution=told,
                verdict=verdict,
                unexplained=left,
                similarities=likes,
                confounded=confounded_with(named.names, verdict.rivals, likes),
                seed=seed,
            )
        )
        if resimulator is not None:
            report["resimulated"] = [one.to_json() for one in resimulated]
        if nested:
            report["after"]["chosen_inside"] = [sorted(composite.names) for composite in in_sample]
        has_clouds = not pair.lacking & {GEOMETRY, POSES}
        report["gap"]["mm"] = cloud_gap(pair, real, state.mean, seed) if has_clouds else dict(NO_CLOUDS)
        report["thesis_terms"] = thesis_terms(judge, alone) if has_clouds else []
        report["notes"] = [
            f"the frames of the hand are shifted by {1e3 * state.shift_s:.0f} ms against those of the simulator"
        ]
        report["runtime_s"] = time.perf_counter() - began
        show("held-out evaluation", 1, 1)
    return Diagnosis(pair, layout, real, judge, gap, comparison, named, held, verdict, report)
