"""Assembly of the report from the results of a diagnosis; its schema is that of the gap report specification."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from taxel.gap import catalogue
from taxel.gap.attribution import Attribution
from taxel.gap.confounding import classes
from taxel.gap.cores import in_copies
from taxel.gap.held_out import HeldOut
from taxel.gap.identify import Likeness, identifiability
from taxel.gap.judge import Judge
from taxel.gap.metric import Gap
from taxel.gap.presses.findings import findings_of
from taxel.gap.presses.ranking import next_presses
from taxel.gap.presses.unrecorded import left_out
from taxel.gap.report.effects import effect_entry
from taxel.gap.report.page_fields import page_fields
from taxel.gap.report.posterior import draws_of
from taxel.gap.rounds import FIXED, Forms
from taxel.gap.trial import Round, Selection
from taxel.gap.verdict import UNKNOWN, Verdict
from taxel.gap.where import products, where


@dataclass(frozen=True, eq=False)
class ReportInputs:
    """Results of a diagnosis that the report contains.

    Attributes:
        judge, gap: the pair of datasets and its gap.
        search: the complete search for effects.
        named: the part of the search that the verdict names; held_out, attribution and unexplained refer to it.
        held_out: evaluation on sessions that were not used for the fit.
        attribution: shares of the effects in the shrink.
        verdict: status and effects.
        unexplained: field `unexplained` of the report.
        similarities, confounded: effects that these grasps do not distinguish.
        tried: variants of the effects that were tried, by name.
        seed: of the p-values.
    """

    judge: Judge
    gap: Gap
    search: Selection
    named: Selection
    held_out: HeldOut
    attribution: Attribution
    verdict: Verdict
    unexplained: Mapping[str, Any]
    similarities: Sequence[Likeness]
    confounded: Mapping[str, Sequence[str]]
    tried: Forms
    seed: int


def build_report(inputs: ReportInputs) -> dict[str, Any]:
    """The report without its run time, the gap in millimetres and the thesis terms."""
    judge, gap, held, verdict = inputs.judge, inputs.gap, inputs.held_out, inputs.verdict
    pair, layout, real, before = judge.state.pair, judge.layout, judge.sessions, judge.state.mean
    after = inputs.named.features
    excess_products = products(real, before, layout)
    confounded = _confounded_outside_verdict(inputs)
    draws = draws_of(judge, inputs.named.chain, FIXED)

    def entry(name: str) -> dict[str, Any]:
        known = identifiability(name, judge, inputs.tried, inputs.similarities, inputs.confounded)
        return effect_entry(name, judge, inputs.named, held, gap, inputs.attribution, known, draws.get(name, ()))

    recommended = next_presses(
        findings_of(judge, inputs.search, inputs.tried, verdict.effects, confounded, held.links),
        left_out(judge.state),
    )
    return {
        "format": "taxel-gap-report",
        "version": 1,
        "inputs": {
            side: {"path": path, "sha256": digest}
            for side, path, digest in zip(("real", "sim"), pair.paths, pair.digests, strict=True)
        },
        "seed": inputs.seed,
        "runtime_s": 0.0,
        "gap": {
            "value": gap.gap.value,
            "ci95": gap.gap.ci95,
            "floor": gap.floor,
            "excess": gap.excess.value,
            "p_value": gap.p_value,
            "significant": bool(gap.p_value < 0.05),
        },
        "where": where(pair, excess_products, layout, inputs.seed),
        "verdict": {
            "status": verdict.status,
            "effects": list(verdict.effects),
            "confounded_with": confounded,
            "one_line": _one_line(verdict, inputs.unexplained["signature"]),
        },
        "effects": in_copies(judge.state, entry, [name for name in catalogue.all_effects() if name in inputs.tried]),
        "after": {
            "before": held.before,
            "value": held.after,
            "floor": float(np.sqrt(held.floor2)),
            "ci95": held.value.ci95,
            "predicted_shrink": float(held.predicted.mean()),
            "shrink": held.shrink.value,
            "reducible_shrink": held.reducible,
        },
        "unexplained": dict(inputs.unexplained),
        "classes": classes(confounded),
        "likeness": [similarity.to_json() for similarity in inputs.similarities],
        "search": [_iteration(one) for one in inputs.search.rounds],
        "waterfall": inputs.attribution.waterfall(),
        "ablation": inputs.attribution.ablation() if len(inputs.attribution.names) > 1 else [],
        **page_fields(pair, layout, real, before, after, verdict),
        "next_presses": recommended.to_json(),
    }


def _confounded_outside_verdict(inputs: ReportInputs) -> dict[str, list[str]]:
    """For each effect of the verdict the confounded effects that are not in the verdict."""
    effects = inputs.verdict.effects
    others = {
        name: [other for other in inputs.confounded[name] if other not in effects]
        for name in inputs.confounded
        if name in effects
    }
    return {name: names for name, names in others.items() if names}


def _one_line(verdict: Verdict, signature: str) -> str:
    """The sentence of the verdict, with the signature of an unknown cause."""
    if UNKNOWN not in verdict.effects or not signature:
        return verdict.one_line
    return f"{verdict.one_line} Signature of the unknown cause: {signature}."


def _iteration(one: Round) -> dict[str, Any]:
    """One iteration of the search: scores without a further effect, and with each candidate."""
    return {
        "base": one.base.value,
        "best": one.best.name if one.best is not None else None,
        "gain": one.gain,
        "p_value": one.p_value,
        "accepted": one.accepted,
        "trials": [
            {
                "name": trial.name,
                "form": trial.link.effect.variant,
                "scope": trial.link.effect.scope,
                "inside": trial.inside.value,
                "held": None if trial.held is None else trial.held.value,
            }
            for trial in one.trials
        ],
    }
