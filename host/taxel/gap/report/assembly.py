"""Assembly of the report from the results of a diagnosis; its schema is that of the gap report specification."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from taxel.gap.calibration.calibration import UNKNOWN
from taxel.gap.comparison.compare import Comparison
from taxel.gap.effects import catalogue
from taxel.gap.effects.catalogue import INSPECTED_EFFECTS, Forms, find_unavailable_reason
from taxel.gap.experiment_design.findings import collect_findings
from taxel.gap.experiment_design.ranking import rank_next_contacts
from taxel.gap.experiment_design.unrecorded_approaches import read_own_unrecorded
from taxel.gap.fitting.composite import CompositeModel
from taxel.gap.fitting.parallel import map_in_processes
from taxel.gap.identifiability.confounding import list_confounded_classes
from taxel.gap.identifiability.identify import Similarity, classify_identifiability
from taxel.gap.localisation.where import compute_products, locate_excess
from taxel.gap.report.effects import build_effect_entry
from taxel.gap.report.page_fields import build_page_fields
from taxel.gap.report.posterior import sample_posterior
from taxel.gap.verdict.attribution import Attribution
from taxel.gap.verdict.explanation import Explanation, get_leading_composite
from taxel.gap.verdict.held_out import HeldOut
from taxel.gap.verdict.verdict import Verdict
from taxel.types import FloatArray

MAX_INFLUENCES: Final = 5
"""Largest number of conditions in `influence` for each effect. Chosen: a short list."""


@dataclass(frozen=True, eq=False)
class ReportInputs:
    """Results of a diagnosis that the report contains.

    Attributes:
        comparison: the comparison of all sets of effects.
        forms: forms of the effects that were tried, by name.
        named: the effects that the verdict names; held_out, attribution and unexplained refer to it.
        alone: fit of each effect alone, with the features f64[C, F, n] (C conditions, F features, n taxels).
        held_out: evaluation on sessions that were not used for the fit.
        attribution: shares of the effects in the shrink.
        verdict: status and effects.
        unexplained: field `unexplained` of the report.
        similarities, confounded: effects that these grasps do not distinguish.
        seed: seed of the p-values' random numbers.
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
    """Build the gap report, a dictionary with the fields of `report.json`, from the results of a diagnosis.

    `taxel.gap.diagnosis` adds the run time, the gap in millimetres and the field `thesis_terms`.
    """
    comparison, held_out, verdict = inputs.comparison, inputs.held_out, inputs.verdict
    fit_data, gap, named = comparison.fit_data, comparison.gap, inputs.named
    pair, layout, real, before = fit_data.state.pair, fit_data.layout, fit_data.sessions, fit_data.state.mean
    after = named.features
    excess_products = compute_products(real, before, layout)
    confounded = _list_confounded_outside_verdict(inputs)
    samples = sample_posterior(fit_data, named.composite, INSPECTED_EFFECTS)

    def build_entry(name: str) -> dict[str, Any]:
        """Return the entry in `effects` of an effect that was tried, with the reason if the effect is unavailable."""
        status = classify_identifiability(name, fit_data, inputs.forms, inputs.similarities, inputs.confounded)
        alone = inputs.alone.get(name)
        entry = build_effect_entry(
            name, fit_data, named, alone, held_out, gap, inputs.attribution, status, samples.get(name, ())
        )
        reason = find_unavailable_reason(fit_data.state, inputs.forms[name])
        return {**entry, "reason": reason} if reason else entry

    composite, causes = get_leading_composite(comparison, named, verdict.effects, verdict.rivals)
    recommended = rank_next_contacts(
        collect_findings(comparison, composite, inputs.forms, causes, confounded, held_out.fitted_effects),
        read_own_unrecorded(fit_data.state),
    )
    return {
        "format": "taxel-gap-report",
        "version": 2,
        "inputs": {
            side: {"path": path, "sha256": digest}
            for side, path, digest in zip(("real", "sim"), pair.paths, pair.digests, strict=True)
        }
        | {"problems": [one.to_json() for one in pair.faults], "real_real": pair.is_real_real}
        | ({"lacking": sorted(pair.missing_inputs)} if pair.missing_inputs else {})
        | ({} if pair.unit is None else {"unit": {"name": pair.unit[0], "counts_per_unit": pair.unit[1]}}),
        "seed": inputs.seed,
        "runtime_s": 0.0,
        "gap": {
            "value": gap.gap.value,
            "ci95": gap.gap.ci95,
            "floor": gap.floor,
            "excess": gap.excess.value,
            "bound": float(np.sqrt(max(gap.excess_bound, 0.0))),
            "p_value": gap.p_value,
            "significant": bool(gap.p_value < 0.05),
        },
        "where": locate_excess(pair, excess_products, layout, inputs.seed),
        "verdict": {
            "status": verdict.status,
            "effects": list(verdict.effects),
            "probabilities": dict(verdict.probabilities),
            "confounded_with": confounded,
            "headline": verdict.headline,
            "one_line": _build_one_line(verdict, inputs.unexplained["signature"]),
            "reasons": list(verdict.reasons),
        },
        "effects": map_in_processes(
            fit_data.state, build_entry, [name for name in catalogue.all_effects() if name in inputs.forms]
        ),
        "after": {
            "before": held_out.before,
            "value": held_out.after,
            "floor": float(np.sqrt(held_out.floor2)),
            "ci95": held_out.after_interval.ci95,
            "predicted_shrink": float(held_out.predicted_shrink.mean()),
            "shrink": held_out.shrink.value,
            "shrink_ci95": held_out.shrink.ci95,
            "reducible_shrink": held_out.reducible_shrink,
        },
        "unexplained": dict(inputs.unexplained),
        "classes": list_confounded_classes(confounded),
        "likeness": [similarity.to_json() for similarity in inputs.similarities],
        "sets": _describe_sets(comparison),
        "influence": _describe_influence(inputs),
        "waterfall": inputs.attribution.build_waterfall(),
        "ablation": inputs.attribution.build_ablation() if len(inputs.attribution.names) > 1 else [],
        **build_page_fields(pair, layout, real, before, after),
        "next_presses": recommended.to_json(),
    }


def _list_confounded_outside_verdict(inputs: ReportInputs) -> dict[str, list[str]]:
    """List for each effect the confounded effects and rivals that the verdict does not name.

    The keys are the effects of the verdict, or the most probable effect with rivals if the verdict names no effect.
    Effects without such others are omitted.
    """
    effects = inputs.verdict.effects
    confounded = {**{name: list(others) for name, others in inputs.verdict.rivals.items()}, **inputs.confounded}
    others = {name: [other for other in confounded[name] if other not in effects] for name in confounded}
    return {name: names for name, names in others.items() if names}


def _build_one_line(verdict: Verdict, signature: str) -> str:
    """Return the sentence of the verdict; if the verdict contains an unknown cause, with the description of its
    signature.
    """
    if UNKNOWN not in verdict.effects or not signature:
        return verdict.one_line
    return f"{verdict.one_line} Signature of the unknown cause: {signature}."


def _describe_sets(comparison: Comparison) -> list[dict[str, Any]]:
    """Return a report entry for each compared set of effects, largest weight first.

    An entry contains the names of the effects, the form (model variant) and scope of each effect, the weight of the
    set, and the log density of the held-out features that the set predicts.
    """
    order = sorted(comparison.sets, key=lambda key: -comparison.weights[key])
    return [
        {
            "effects": sorted(key),
            "weight": comparison.weights[key],
            "log_density": float(comparison.sets[key].held_out.sum()),
            "forms": {
                fitted_effect.effect.name: {"form": fitted_effect.effect.variant, "scope": fitted_effect.effect.scope}
                for fitted_effect in comparison.sets[key].composite.fitted_effects
            },
        }
        for key in order
    ]


def _describe_influence(inputs: ReportInputs) -> list[dict[str, Any]]:
    """List for each effect of the verdict the conditions with the largest shares in the evidence, largest first."""
    conditions = inputs.comparison.fit_data.state.pair.conditions
    return [
        {"effect": name, "object": conditions[index][0], "approach": conditions[index][1], "share": share}
        for name in inputs.named.names
        for index, share in inputs.comparison.compute_influence(name)[:MAX_INFLUENCES]
    ]
