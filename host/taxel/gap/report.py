"""The report as a dictionary, in the form of the gap report page."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taxel.gap.attribution import attribute
from taxel.gap.catalogue import CATALOGUE
from taxel.gap.held_out import HeldOut
from taxel.gap.judge import Judge
from taxel.gap.metric import Gap, off_diagonal
from taxel.gap.pair import Pair
from taxel.gap.report_effects import effect_entry
from taxel.gap.report_page_fields import page_fields
from taxel.gap.select import Selection
from taxel.gap.verdict import Verdict
from taxel.gap.where import Products, p_values, products, summed, where

Array = NDArray[np.float64]


def report_of(
    judge: Judge, gap: Gap, selection: Selection, held: HeldOut, verdict: Verdict, tried: Collection[str], seed: int
) -> dict[str, Any]:
    """All but run time and millimetres. tried: names of the catalogue."""
    pair, layout, real, before = judge.state.pair, judge.layout, judge.sessions, judge.state.mean
    after = selection.features
    found = products(real, before, layout)
    told = attribute(judge, selection.names, held)
    left = products(real, after, layout)
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
            "confounded_with": {name: list(rivals) for name, rivals in selection.rivals.items()},
            "one_line": verdict.one_line,
        },
        "effects": [effect_entry(name, judge, selection, held, gap, told) for name in CATALOGUE if name in tried],
        "after": {
            "before": held.before,
            "value": held.after,
            "floor": float(np.sqrt(held.floor2)),
            "ci95": held.value.ci95,
            "predicted_shrink": float(held.predicted.mean()),
            "shrink": held.shrink.value,
            "reducible_shrink": held.reducible,
        },
        "unexplained": _unexplained(pair, left, where(pair, left, layout, seed)["phases"], seed),
        "waterfall": told.waterfall(),
        "ablation": told.ablation() if len(told.names) > 1 else [],
        **page_fields(pair, layout, real, before, after, verdict),
    }


def _unexplained(pair: Pair, left: Products, phases: list[dict[str, Any]], seed: int) -> dict[str, Any]:
    """Whether anything is left, on which boards, and in which phase most of it."""
    count = len(pair.sensors.address)
    gram = summed(left.taxels, pair.groups.sensor, count)
    p_value = p_values(gram, summed(left.centred_taxels, pair.groups.sensor, count), seed)
    excess = off_diagonal(gram)
    order = [int(k) for k in np.argsort(-excess) if p_value[k] < 0.05]
    places = [
        {"address": int(pair.sensors.address[k]), "name": pair.sensors.name[k], "p_value": float(p_value[k])}
        for k in order
    ]
    words = ""
    if places:
        words = f"mostly in {phases[0]['phase']}, most of it on {pair.sensors.name[order[0]]}"
    return {"p_value": float(p_value.min(initial=1.0)), "signature": words, "where": places}
