"""The parameters that best fit noise-free presses of the emulator: the truth where no definition fixes one."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from taxel.blind.asked import form_of, is_clear
from taxel.blind.hidden import Cause
from taxel.gap.align import shift_beside
from taxel.gap.catalogue import all_effects
from taxel.gap.chain import Chain, Link
from taxel.gap.effects.effect import Effect
from taxel.gap.effects.latency import is_delay
from taxel.gap.fit import started
from taxel.gap.judge import Judge
from taxel.gap.pair import read_pair
from taxel.gap.prepare import prepared
from taxel.gap.report.effects import parameters_of


def forms_to_fit(cause: Cause, report: Mapping[str, Any]) -> set[str]:
    """Forms of the cause's effect whose parameters a report tells and no definition fixes; none without a clear gap."""
    if cause.parameters or not is_clear(report):
        return set()
    named = [entry for entry in report.get("effects", []) if entry["name"] == cause.name and entry["in_verdict"]]
    return {form_of(entry) for entry in named}


def reference_parameters(real: Path, sim: Path, name: str, forms: Collection[str]) -> dict[str, dict[str, float]]:
    """Of the effect `name`, for each of `forms`: {"kept hand": {"spread_mm": 2.1, ...}, ...}.

    Empty for one that is found, not fitted. Raises DatasetError and GapInputError of one line.
    """
    with threadpool_limits(limits=1):
        pair = read_pair(real, sim)
        judge = prepared(pair).judge
        found: dict[str, dict[str, float]] = {}
        for form in all_effects()[name]:
            key = f"{form.variant} {form.scope}"
            if key not in forms or form.unavailable(judge.state):
                continue
            link = _fitted(judge, form)
            found[key] = {label: _number(entry) for label, entry in parameters_of(pair, link).items()}
    return found


def _fitted(judge: Judge, form: Effect) -> Link:
    """As a diagnosis does: frames are aligned anew once the effect is known."""
    chain = judge.in_sample(Chain((started(judge.state, form),))).chain
    if not is_delay(form):
        shift, chain = shift_beside(judge, chain, ())
        chain = judge.shifted(shift).in_sample(chain).chain
    return chain.links[0]


def _number(entry: dict[str, Any]) -> float:
    return float(np.asarray(entry["value"], dtype=np.float64))
