"""The report as a dictionary, in the form of the gap report page."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
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


def report_of(
    judge: Judge,
    gap: Gap,
    selection: Selection,
    believed: Selection,
    held: HeldOut,
    told: Attribution,
    verdict: Verdict,
    left: Mapping[str, Any],
    likes: Sequence[Likeness],
    confounded: Mapping[str, Sequence[str]],
    tried: Forms,
    seed: int,
) -> dict[str, Any]:
    """All but run time and millimetres. believed: of the selection what the verdict names; held, told, left: of it.
    likes, confounded: what these presses cannot tell apart. tried: what of the catalogue.
    """
    pair, layout, real, before = judge.state.pair, judge.layout, judge.sessions, judge.state.mean
    after = believed.features
    found = products(real, before, layout)
    named = {
        name: [other for other in others if other not in verdict.effects]
        for name, others in confounded.items()
        if name in verdict.effects
    }
    named = {name: others for name, others in named.items() if others}
    draws = draws_of(judge, believed.chain, FIXED)

    def entry(name: str) -> dict[str, Any]:
        known = identifiability(name, judge, tried, likes, confounded)
        return effect_entry(name, judge, believed, held, gap, told, known, draws.get(name, ()))

    return {
        "format": "taxel-gap-report",
        "version": 1,
        "inputs": {
            side: {"path": path, "sha256": digest}
            for side, path, digest in zip(("real", "sim"), pair.paths, pair.digests, strict=True)
        },
        "seed": seed,
        "runtime_s": 0.0,
        "gap": {
            "value": gap.gap.value,
            "ci95": gap.gap.ci95,
            "floor": gap.floor,
            "excess": gap.excess.value,
            "p_value": gap.p_value,
            "significant": bool(gap.p_value < 0.05),
        },
        "where": where(pair, found, layout, seed),
        "verdict": {
            "status": verdict.status,
            "effects": list(verdict.effects),
            "confounded_with": named,
            "one_line": _one_line(verdict, left["signature"]),
        },
        "effects": in_copies(judge.state, entry, [name for name in catalogue.all_effects() if name in tried]),
        "after": {
            "before": held.before,
            "value": held.after,
            "floor": float(np.sqrt(held.floor2)),
            "ci95": held.value.ci95,
            "predicted_shrink": float(held.predicted.mean()),
            "shrink": held.shrink.value,
            "reducible_shrink": held.reducible,
        },
        "unexplained": dict(left),
        "classes": classes(named),
        "likeness": [one.to_json() for one in likes],
        "search": [_round(one) for one in selection.rounds],
        "waterfall": told.waterfall(),
        "ablation": told.ablation() if len(told.names) > 1 else [],
        **page_fields(pair, layout, real, before, after, verdict),
        "next_presses": next_presses(
            findings_of(judge, selection, tried, verdict.effects, named, held.links), left_out(judge.state)
        ).to_json(),
    }


def _one_line(verdict: Verdict, signature: str) -> str:
    """The verdict's, and what an unknown cause looks like."""
    if UNKNOWN not in verdict.effects or not signature:
        return verdict.one_line
    return f"{verdict.one_line} What is left: {signature}."


def _round(one: Round) -> dict[str, Any]:
    """How one effect was chosen: scores without it, and with each form where it was fitted and on left-out cells."""
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
