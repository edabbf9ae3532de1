"""Simpler diagnosers, scored beside the real one: they show how easy the worlds were."""

from __future__ import annotations

import hashlib
from typing import Final

import numpy as np

from taxel.gap.catalogue import all_effects
from taxel.gap.diagnosis import Diagnosis
from taxel.recording.grasp_format import Phase

NO_GAP: Final = "no_gap"


def simpler_answers(done: Diagnosis) -> dict[str, str]:
    """One name each: "rules" looks at the largest disagreement, "effect_blind" guesses and knows only that there is a
    gap.
    """
    if done.verdict.status == NO_GAP:
        return {"rules": NO_GAP, "effect_blind": NO_GAP}
    names = sorted(all_effects())
    digest = hashlib.sha256(done.pair.digests[0].encode()).digest()
    return {"rules": _by_rules(done), "effect_blind": names[digest[0] % len(names)]}


def _by_rules(done: Diagnosis) -> str:
    """What an engineer would check first, in the order of a check list."""
    layout, model, real = done.layout, done.judge.state.mean, np.nan_to_num(done.real.mean)
    gap2 = layout.weight[:, None] * (real - model) ** 2
    share = gap2.sum(axis=(0, 2)) / max(float(gap2.sum()), 1e-12)
    if share[layout.missing] > 0.3:
        return "dropout"
    if share[layout.noise].sum() > 0.4:
        return "noise"
    if share[layout.wander] > 0.1:
        return "baseline_drift"
    if share[layout.onset] > 0.2:
        return "latency"
    hold = done.pair.clock.bins_of(Phase.HOLD)[0]
    expected, found = model[:, hold], real[:, hold]
    pressed = expected > 150.0
    if not pressed.any():
        return "proximity"
    if (pressed & (found < 0.05 * expected)).sum() > 0.05 * pressed.sum():
        return "dropout"
    after = layout.phase[: layout.bins] == Phase.RECOVERY
    if share[: layout.bins][after].sum() > 0.15:
        return "hysteresis"
    beside = ~pressed & (np.abs(found - expected) > 20.0)
    if beside.sum() > 0.5 * pressed.sum():
        return "contact_propagation" if found[beside].mean() > expected[beside].mean() else "electrode_crosstalk"
    ratio = np.log(np.maximum(found[pressed], 1.0) / expected[pressed])
    slope = np.polyfit(np.log(expected[pressed]), ratio, 1)[0] if pressed.sum() > 2 else 0.0
    if slope < -0.3:
        return "saturation"
    if np.std(ratio) > 0.3:
        return "pose_error"
    return "gain_mismatch" if np.std(ratio) > 0.1 else "stiffness"
