"""Simple reference diagnosers, scored like the diagnosis: their scores show how difficult the worlds are."""

import hashlib
from typing import Final

import numpy as np

from taxel.gap.diagnosis import Diagnosis
from taxel.gap.effects.catalogue import all_effects
from taxel.recording.grasp_format import Phase

NO_GAP: Final = "no_gap"


def compute_baseline_verdicts(diagnosis: Diagnosis) -> dict[str, str]:
    """Compute the verdicts of two simple reference diagnosers, to compare them with the verdict of the diagnosis.

    Returns one effect name, or "no_gap", for each diagnoser. "rules": a check list that starts with the largest
    disagreement. "effect_blind": a pseudo-random effect, chosen by the digest of the dataset. Both use the finding of
    the diagnosis that there is a gap.
    """
    if diagnosis.verdict.status == NO_GAP:
        return {"rules": NO_GAP, "effect_blind": NO_GAP}
    names = sorted(all_effects())
    digest = hashlib.sha256(diagnosis.pair.digests[0].encode()).digest()
    return {"rules": _apply_rules(diagnosis), "effect_blind": names[digest[0] % len(names)]}


def _apply_rules(diagnosis: Diagnosis) -> str:
    """Name the effect of the first matching rule of an engineer's check list; a simple reference for the diagnosis.

    The first rules use the share of groups of features (missing frames, noise, slow changes, onset) in the squared
    difference of the real and the simulated signals. The other rules compare the signals in the hold phase, counts, of
    loaded taxels (simulated signal above 150 counts) and of unloaded taxels. The thresholds are chosen by hand.
    """
    layout, model, real = diagnosis.layout, diagnosis.fit_data.state.mean, np.nan_to_num(diagnosis.real.mean)
    gap2 = layout.weight[:, None] * (real - model) ** 2
    share = gap2.sum(axis=(0, 2)) / max(float(gap2.sum()), 1e-12)
    if share[layout.missing] > 0.3:
        return "dropout"
    if share[layout.noise].sum() > 0.4:
        return "noise"
    if share[layout.drift_residual] > 0.1:
        return "baseline_drift"
    if share[layout.onset] > 0.2:
        return "latency"
    hold = diagnosis.pair.time_grid.find_bins(Phase.HOLD)[0]
    simulated, measured = model[:, hold], real[:, hold]
    loaded = simulated > 150.0
    if not loaded.any():
        return "proximity"
    if (loaded & (measured < 0.05 * simulated)).sum() > 0.05 * loaded.sum():
        return "dropout"
    recovery = layout.phase[: layout.bins] == Phase.RECOVERY
    if share[: layout.bins][recovery].sum() > 0.15:
        return "hysteresis"
    unloaded = ~loaded & (np.abs(measured - simulated) > 20.0)
    if unloaded.sum() > 0.5 * loaded.sum():
        is_larger = measured[unloaded].mean() > simulated[unloaded].mean()
        return "contact_propagation" if is_larger else "electrode_crosstalk"
    log_ratio = np.log(np.maximum(measured[loaded], 1.0) / simulated[loaded])
    slope = np.polyfit(np.log(simulated[loaded]), log_ratio, 1)[0] if loaded.sum() > 2 else 0.0
    if slope < -0.3:
        return "saturation"
    if np.std(log_ratio) > 0.3:
        return "pose_error"
    return "gain_mismatch" if np.std(log_ratio) > 0.1 else "stiffness"
