"""Assembly of the report from the results of a diagnosis; its schema is that of the gap report specification."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from taxel.gap.calibration.calibration import UNKNOWN
from taxel.gap.comparison.compare import Comparison
from taxel.gap.effects import catalogue
from taxel.gap.effects.catalogue import FIXED, Forms, find_unavailable_reason
from taxel.gap.experiment_design.findings import findings_of
from taxel.gap.experiment_design.ranking import rank_next_contacts
from taxel.gap.experiment_design.unrecorded import left_out
from taxel.gap.fitting.composite import CompositeModel
from taxel.gap.fitting.cores import in_copies
from taxel.gap.identifiability.confounding import classes
from taxel.gap.identifiability.identify import Similarity, identifiability
from taxel.gap.localisation.where import products, where
from taxel.gap.report.effects import effect_entry
from taxel.gap.report.page_fields import page_fields
from taxel.gap.report.posterior import draws_of
from taxel.gap.verdict.attribution import Attribution
from taxel.gap.verdict.explanation import Explanation, get_questioned
from taxel.gap.verdict.held_out import HeldOut
from taxel.gap.verdict.verdict import Verdict
from taxel.types import FloatArray

MAX_INFLUENCES: Final = 5
"""Conditions that are listed for each effect."""


@dataclass(frozen=True, eq=False)
class ReportInputs:
    """Results of a diagnosis that the report contains.

    Attributes:
        comparison: the comparison of all sets of effects.
        forms: forms of the effects that were tried, by name.
        named: the effects that the verdict names; held_out, attribution and unexplained refer to it.
        alone: fit of each effect alone, with the features f64[C, F, n].
        held_out: evaluation on sessions that were not used for the fit.
        attribution: shares of the effects in the shrink.
        verdict: status and effects.
        unexplained: field `unexplained` of the report.
        similarities, confounded: effects that these grasps do not distinguish.
        seed: of the p-values.
    """

    comparison: Comparison
    forms: Forms
    named: Explanation
    alone: Mapping[str, tuple[CompositeModel, FloatArray]]
    held_out: HeldOut
    attribution: Attribution
    verdict: Verdict
    unexplained: Mapping[str, Any]
    similarities: Sequence[Similarity]
    confounded: Mapping[str, Sequence[str]]
    seed: int


def build_report(inputs: ReportInputs) -> dict[str, Any]:
    """The report without its run time, the gap in millimetres and the thesis terms."""
    comparison, held, verdict = inputs.comparison, inputs.held_out, inputs.verdict
    judge, gap, named = comparison.judge, comparison.gap, inputs.named
    pair, layout, real, before = judge.state.pair, judge.layout, judge.sessions, judge.state.mean
    after = named.features
    excess_products = products(real, before, layout)
    confounded = _confounded_outside_verdict(inputs)
    draws = draws_of(judge, named.composite, FIXED)

    def entry(name: str) -> dict[str, Any]:
        known = identifiability(name, judge, inputs.forms, inputs.similarities, inputs.confounded)
        alone = inputs.alone.get(name)
        found = effect_entry(name, judge, named, alone, held, gap, inputs.attribution, known, draws.get(name, ()))
        reason = find_unavailable_reason(judge.state, inputs.forms[name])
        return {**found, "reason": reason} if reason else found

    composite, causes = get_questioned(comparison, named, verdict.effects, verdict.rivals)
    recommended = rank_next_contacts(
        findings_of(comparison, composite, inputs.forms, causes, confounded, held.links), left_out(judge.state)
    )
    return {
        "format": "taxel-gap-report",
        "version": 2,
        "inputs": {
            side: {"path": path, "sha256": digest}
            for side, path, digest in zip(("real", "sim"), pair.paths, pair.digests, strict=True)
        }
        | {"problems": [one.to_json() for one in pair.faults], "real_real": pair.is_real_real}
        | ({"lacking": sorted(pair.lacking)} if pair.lacking else {})
        | ({} if pair.unit is None else {"unit": {"name": pair.unit[0], "counts_per_unit": pair.unit[1]}}),
        "seed": inputs.seed,
        "runtime_s": 0.0,
        "gap": {
            "value": gap.gap.value,
            "ci95": gap.gap.ci95,
            "floor": gap.floor,
            "excess": gap.excess.value,
            "bound": float(np.sqrt(max(gap.most, 0.0))),
            "p_value": gap.p_value,
            "significant": bool(gap.p_value < 0.05),
        },
        "where": where(pair, excess_products, layout, inputs.seed),
        "verdict": {
            "status": verdict.status,
            "effects": list(verdict.effects),
            "probabilities": dict(verdict.probabilities),
            "confounded_with": confounded,
            "headline": verdict.headline,
            "one_line": _one_line(verdict, inputs.unexplained["signature"]),
            "reasons": list(verdict.reasons),
        },
        "effects": in_copies(judge.state, entry, [name for name in catalogue.all_effects() if name in inputs.forms]),
        "after": {
            "before": held.before,
            "value": held.after,
            "floor": float(np.sqrt(held.floor2)),
            "ci95": held.value.ci95,
            "predicted_shrink": float(held.predicted.mean()),
            "shrink": held.shrink.value,
            "shrink_ci95": held.shrink.ci95,
            "reducible_shrink": held.reducible,
        },
        "unexplained": dict(inputs.unexplained),
        "classes": classes(confounded),
        "likeness": [similarity.to_json() for similarity in inputs.similarities],
        "sets": _describe_sets(comparison),
        "influence": _describe_influence(inputs),
        "waterfall": inputs.attribution.waterfall(),
        "ablation": inputs.attribution.ablation() if len(inputs.attribution.names) > 1 else [],
        **page_fields(pair, layout, real, before, after),
        "next_presses": recommended.to_json(),
    }


def _confounded_outside_verdict(inputs: ReportInputs) -> dict[str, list[str]]:
    """For each effect of the verdict, and for the first rival if it names none, the confounded effects that are not in
    the verdict.
    """
    effects = inputs.verdict.effects
    asked = {**{name: list(others) for name, others in inputs.verdict.rivals.items()}, **inputs.confounded}
    others = {name: [other for other in asked[name] if other not in effects] for name in asked}
    return {name: names for name, names in others.items() if names}


def _one_line(verdict: Verdict, signature: str) -> str:
    """The sentence of the verdict, with the signature of an unknown cause."""
    if UNKNOWN not in verdict.effects or not signature:
        return verdict.one_line
    return f"{verdict.one_line} Signature of the unknown cause: {signature}."


def _describe_sets(comparison: Comparison) -> list[dict[str, Any]]:
    """The candidate sets, largest weight first, with their forms and held-out log density."""
    order = sorted(comparison.sets, key=lambda key: -comparison.weights[key])
    return [
        {
            "effects": sorted(key),
            "weight": comparison.weights[key],
            "log_density": float(comparison.sets[key].held_out.sum()),
            "forms": {
                link.effect.name: {"form": link.effect.variant, "scope": link.effect.scope}
                for link in comparison.sets[key].composite.links
            },
        }
        for key in order
    ]


def _describe_influence(inputs: ReportInputs) -> list[dict[str, Any]]:
    """For each effect of the verdict the conditions that determine the evidence, largest share first."""
    conditions = inputs.comparison.judge.state.pair.conditions
    return [
        {"effect": name, "object": conditions[index][0], "approach": conditions[index][1], "share": share}
        for name in inputs.named.names
        for index, share in inputs.comparison.compute_influence(name)[:MAX_INFLUENCES]
    ]
