"""The whole diagnosis of two datasets: read, measure, search, hold out, report."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection
from dataclasses import dataclass
from os import PathLike
from types import MappingProxyType
from typing import Any

from threadpoolctl import threadpool_limits

from taxel.gap.attribution import attribute
from taxel.gap.catalogue import DROPOUT, chosen
from taxel.gap.cloud_gap import cloud_gap
from taxel.gap.confounding import confounded_with
from taxel.gap.features import Layout, SessionMeans
from taxel.gap.held_out import HeldOut, held_out
from taxel.gap.identify import likenesses
from taxel.gap.judge import Judge
from taxel.gap.metric import Gap, measure
from taxel.gap.nameless import nameless
from taxel.gap.nested import Inside, searched_inside
from taxel.gap.pair import Pair, read_pair
from taxel.gap.prepare import prepared
from taxel.gap.priors import Priors
from taxel.gap.report.assembly import ReportInputs, build_report
from taxel.gap.select import MOST_EFFECTS, select
from taxel.gap.signature.bank import unexplained
from taxel.gap.thesis_terms import thesis_terms
from taxel.gap.trial import Selection
from taxel.gap.verdict import Verdict, judge_verdict

Show = Callable[[str, int, int], None]


def quiet(stage: str, done: int, total: int) -> None:
    """Nothing is shown."""


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """All that was worked out; `report` is the form for files."""

    pair: Pair
    layout: Layout
    real: SessionMeans
    judge: Judge
    gap: Gap
    selection: Selection
    held: HeldOut
    verdict: Verdict
    report: dict[str, Any]


def diagnose(
    real_path: str | PathLike[str],
    sim_path: str | PathLike[str],
    without: Collection[str] = (),
    seed: int = 0,
    show: Show = quiet,
    priors: Priors = MappingProxyType({}),
    nested: bool = False,
) -> Diagnosis:
    """Say where the gap between two datasets lies, which effect causes it and how far it shrinks.

    without: names of the catalogue that are not tried. seed: of the p-values' draws. priors: what is known of effects.
    nested: search without each session again, which takes as many times as long, and judge in it what that finds.
    Raises DatasetError and GapInputError of one line.
    """
    began = time.perf_counter()
    forms = chosen(without, priors)
    with threadpool_limits(limits=1):  # small products: threads would only wait for each other
        pair = read_pair(real_path, sim_path, lambda done, total: show("reading", done, total))
        judge, simulated2 = prepared(pair)
        inside = Inside(())
        if nested:
            inside = searched_inside(judge, forms, lambda number, total: show("repeated search", number, total))
        selection = select(judge, forms, lambda number, total: show("effect search", number, total))
        judge = selection.judge
        state, real, layout = judge.state, judge.sessions, judge.layout
        gap = measure(real, state.mean, layout)
        show("effect search", MOST_EFFECTS, MOST_EFFECTS)
        show("held-out evaluation", 0, 1)
        held = held_out(judge, selection.chain, inside=inside.chains)
        told = attribute(judge, selection.names, held)
        fitted = [link for link in selection.chain.links if link.effect.name != DROPOUT]
        likes = likenesses(judge, forms, fitted)
        confounded = confounded_with(selection.names, selection.rivals, likes)
        unsure = nameless(judge, selection.chain, confounded)
        left = unexplained(pair, layout, real, selection.features, judge.fold, seed)
        names = told.strongest_first
        verdict = judge_verdict(gap, selection, names, held, simulated2, unsure, pair.cells, left["bank"])
        believed = selection.only(verdict.effects)
        if believed is not selection:
            inside = inside.only(selection.names, believed.names)
            held = held_out(judge, believed.chain, inside=inside.chains)
            told = attribute(judge, believed.names, held)
            left = unexplained(pair, layout, real, believed.features, judge.fold, seed)
        report = build_report(
            ReportInputs(
                judge=judge,
                gap=gap,
                search=selection,
                named=believed,
                held_out=held,
                attribution=told,
                verdict=verdict,
                unexplained=left,
                similarities=likes,
                confounded=confounded,
                tried=forms,
                seed=seed,
            )
        )
        if nested:
            report["after"]["chosen_inside"] = inside.names
        report["gap"]["mm"] = cloud_gap(pair, real, state.mean, seed)
        report["thesis_terms"] = thesis_terms(judge, selection)
        report["notes"] = [
            f"the frames of the hand are shifted by {1e3 * state.shift_s:.0f} ms against those of the simulator"
        ]
        report["runtime_s"] = time.perf_counter() - began
        show("held-out evaluation", 1, 1)
    return Diagnosis(pair, layout, real, judge, gap, selection, held, verdict, report)
