"""Where the gap lies: shares of the excess by sensor, line, taxel, phase, object and approach, with p-values.

The null: what the real sessions scatter about their mean, with a random sign and size for each session (wild
bootstrap). All places of one kind are looked at together, so p-values are corrected by the step-down largest statistic
(Westfall and Young 1993).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from taxel.gap.data.lacking import LINES
from taxel.gap.data.pair import Pair
from taxel.gap.features.features import Layout, SessionMeans, known_mean
from taxel.gap.features.metric import off_diagonal
from taxel.recording.grasp_format import Phase
from taxel.types import FloatArray

DRAWS: Final = 4000
PHASES: Final = {
    Phase.BASELINE: "baseline",
    Phase.CLOSING: "closing",
    Phase.HOLD: "hold",
    Phase.RELEASE: "release",
    Phase.RECOVERY: "recovery",
}


@dataclass(frozen=True, eq=False)
class Products:
    """Products of the sessions' residuals: f64[C, F, S, S] summed over taxels, f64[n, S, S] over cells and features.

    centred_*: the same of the residuals about their mean over sessions.
    """

    conditions: FloatArray
    taxels: FloatArray
    centred_conditions: FloatArray
    centred_taxels: FloatArray


def products(real: SessionMeans, model: FloatArray, layout: Layout) -> Products:
    """model: f64[C, F, n], counts."""
    scale = np.sqrt(layout.scale(real.value.shape[0], real.value.shape[3]) * real.pairing)[:, None]
    residual = real.residual(model)
    centred = np.where(real.known, residual - known_mean(np.where(real.known, residual, np.nan), 1)[:, None], 0.0)
    parts = []
    for value in (residual, centred):
        scaled = value * scale
        parts.append(np.einsum("csfn,ctfn->cfst", scaled, scaled, optimize=True))
        parts.append(np.einsum("csfn,ctfn->nst", scaled, scaled, optimize=True))
    return Products(parts[0], parts[1], parts[2], parts[3])


def p_values(gram: FloatArray, centred: FloatArray, seed: int) -> FloatArray:
    """Corrected p-values of G places, f64[G]. gram, centred: f64[G, S, S]."""
    groups, sessions = gram.shape[0], gram.shape[-1]
    if sessions < 2:
        return np.ones(groups)
    draws = np.random.default_rng(seed).normal(size=(DRAWS, sessions)) * np.sqrt(sessions / (sessions - 1.0))
    pairs = np.einsum("bs,bt->bst", draws, draws)
    pairs[:, np.arange(sessions), np.arange(sessions)] = 0.0
    null = (pairs.reshape(DRAWS, -1) @ centred.reshape(groups, -1).T) / (sessions * (sessions - 1))
    scale = null.std(axis=0)
    scale = np.maximum(scale, 1e-3 * scale.max(initial=0.0) + 1e-12)
    statistic, null = off_diagonal(gram) / scale, null / scale
    order = np.argsort(-statistic)
    # The largest of a place and of all with a smaller statistic.
    largest = np.maximum.accumulate(null[:, order[::-1]], axis=1)[:, ::-1]
    raw = (1.0 + (largest >= statistic[order]).sum(axis=0)) / (DRAWS + 1.0)
    result = np.empty(groups)
    result[order] = np.maximum.accumulate(raw)
    return result


def shares(excess: FloatArray) -> FloatArray:
    """Shares that add to 1; what is below 0 has none."""
    positive = np.maximum(excess, 0.0)
    total = positive.sum()
    return np.asarray(positive / total if total > 0 else np.full(len(excess), 1.0 / max(len(excess), 1)))


def summed(gram: FloatArray, index: NDArray[np.intp], count: int) -> FloatArray:
    """Sums of f64[k, S, S] over the groups that index [k] tells, f64[count, S, S]."""
    result = np.zeros((count, *gram.shape[1:]))
    np.add.at(result, index, gram)
    return result


def where(pair: Pair, found: Products, layout: Layout, seed: int) -> dict[str, Any]:
    """The report's `where`."""
    sensors = pair.sensors
    taxel_share, taxel_p = _judged(found.taxels, found.centred_taxels, seed)
    by_taxel = [
        {"index": int(k), "share": float(taxel_share[k]), "p_value": float(taxel_p[k])}
        for k in np.argsort(-taxel_share, kind="stable")
    ]
    count = len(sensors.address)
    index = pair.groups.sensor
    names = [{"address": int(a), "name": n} for a, n in zip(sensors.address, sensors.name, strict=True)]
    flat, flat_centred = (part.sum(axis=0) for part in (found.conditions, found.centred_conditions))
    phases = [phase for phase in PHASES if (layout.phase == phase).any()]
    row = np.array([phases.index(Phase(int(phase))) for phase in layout.phase], dtype=np.intp)
    conditions, conditions_centred = found.conditions.sum(axis=1), found.centred_conditions.sum(axis=1)
    objects = pair.object_names
    of_object = np.array([objects.index(item) for item, _ in pair.conditions], dtype=np.intp)

    def table(labels: list[dict[str, Any]], gram: FloatArray, centred: FloatArray) -> list[dict[str, Any]]:
        share, p = _judged(gram, centred, seed)
        rows = [{**label, "share": float(share[k]), "p_value": float(p[k])} for k, label in enumerate(labels)]
        return sorted(rows, key=lambda one: -one["share"])

    def grouped(group: NDArray[np.intp], number: int) -> tuple[FloatArray, FloatArray]:
        return summed(found.taxels, group, number), summed(found.centred_taxels, group, number)

    lines: list[dict[str, Any]] = []
    axes = (("tx", pair.groups.tx, pair.taxels.tx), ("rx", pair.groups.rx, pair.taxels.rx))
    for axis, group, electrode in () if LINES in pair.lacking else axes:
        number = int(group.max()) + 1
        first = [int(np.flatnonzero(group == k)[0]) for k in range(number)]
        labels = [{"address": int(pair.taxels.sensor[k]), "axis": axis, "index": int(electrode[k])} for k in first]
        lines += table(labels, *grouped(group, number))
    return {
        "sensors": table(names, *grouped(index, count)),
        "lines": sorted(lines, key=lambda one: -one["share"]),
        "taxels": by_taxel,
        "phases": table(
            [{"phase": PHASES[phase]} for phase in phases],
            summed(flat, row, len(phases)),
            summed(flat_centred, row, len(phases)),
        ),
        "objects": table(
            [{"name": name} for name in objects],
            summed(conditions, of_object, len(objects)),
            summed(conditions_centred, of_object, len(objects)),
        ),
        "approaches": table(
            [{"object": item, "approach": name} for item, name in pair.conditions], conditions, conditions_centred
        ),
    }


def _judged(gram: FloatArray, centred: FloatArray, seed: int) -> tuple[FloatArray, FloatArray]:
    return shares(off_diagonal(gram)), p_values(gram, centred, seed)
