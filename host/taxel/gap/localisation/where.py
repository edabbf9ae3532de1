"""Location of the gap: shares of the excess by sensor, line, taxel, phase, object and approach, with p-values.

The null distribution is a wild bootstrap: the deviations of the real sessions from their mean are multiplied by normal
random numbers, one for each session. The p-values are corrected for the number of locations of one kind by the
step-down maximum statistic (Westfall and Young 1993).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from taxel.gap.data.missing_inputs import LINES
from taxel.gap.data.pair import Pair
from taxel.gap.features.features import FeatureLayout, SessionMeans, compute_known_mean
from taxel.gap.features.metric import compute_off_diagonal_mean
from taxel.recording.grasp_format import Phase
from taxel.types import FloatArray

BOOTSTRAP_SAMPLES: Final = 4000
"""Samples of the wild bootstrap. Chosen: the smallest possible p-value is 1 / 4001."""

PHASES: Final = {
    Phase.BASELINE: "baseline",
    Phase.CLOSING: "closing",
    Phase.HOLD: "hold",
    Phase.RELEASE: "release",
    Phase.RECOVERY: "recovery",
}
"""Name of each phase in the report."""


@dataclass(frozen=True, eq=False)
class ResidualProducts:
    """Products of the weighted residuals (real minus predicted features) of each pair of sessions, counts^2.

    Attributes:
        conditions: f64[C, F, S, S] (C conditions, F features), summed over the taxels.
        taxels: f64[n, S, S] (n taxels), summed over conditions and features.
        centred_conditions, centred_taxels: the same for the residuals minus their mean over the sessions.
    """

    conditions: FloatArray
    taxels: FloatArray
    centred_conditions: FloatArray
    centred_taxels: FloatArray


def compute_products(real: SessionMeans, model: FloatArray, layout: FeatureLayout) -> ResidualProducts:
    """Return the products of the residuals (real minus predicted features) of each pair of real sessions, counts^2.

    The products are summed over taxels, or over conditions and features. They are also returned for the residuals minus
    their mean over the sessions. model: f64[C, F, n] (C conditions, F features, n taxels), predicted features, counts.
    """
    scale = np.sqrt(layout.compute_scale(real.value.shape[0], real.value.shape[3]) * real.pair_weight)[:, None]
    residual = real.compute_residual(model)
    centred = np.where(
        real.is_known, residual - compute_known_mean(np.where(real.is_known, residual, np.nan), 1)[:, None], 0.0
    )
    results = []
    for value in (residual, centred):
        scaled = value * scale
        results.append(np.einsum("csfn,ctfn->cfst", scaled, scaled, optimize=True))
        results.append(np.einsum("csfn,ctfn->nst", scaled, scaled, optimize=True))
    return ResidualProducts(results[0], results[1], results[2], results[3])


def compute_p_values(gram: FloatArray, centred: FloatArray, seed: int) -> FloatArray:
    """Return the corrected p-values of the excess at G locations, f64[G]; 1 with a single session.

    gram: f64[G, S, S], products of the residuals of the sessions, counts^2. centred: the same for the residuals minus
    their mean over the sessions. seed: seed of the bootstrap's random numbers. Source: step-down maximum statistic,
    Westfall and Young (1993).
    """
    groups, sessions = gram.shape[0], gram.shape[-1]
    if sessions < 2:
        return np.ones(groups)
    # Wild bootstrap: random factors on the centred residuals of the sessions; the root restores their variance.
    multipliers = np.random.default_rng(seed).normal(size=(BOOTSTRAP_SAMPLES, sessions)) * np.sqrt(
        sessions / (sessions - 1.0)
    )
    pairs = np.einsum("bs,bt->bst", multipliers, multipliers)
    pairs[:, np.arange(sessions), np.arange(sessions)] = 0.0
    null = (pairs.reshape(BOOTSTRAP_SAMPLES, -1) @ centred.reshape(groups, -1).T) / (sessions * (sessions - 1))
    # Each location is divided by its standard deviation; the lower limit avoids a division by a value near 0.
    scale = null.std(axis=0)
    scale = np.maximum(scale, 1e-3 * scale.max(initial=0.0) + 1e-12)
    statistic, null = compute_off_diagonal_mean(gram) / scale, null / scale
    order = np.argsort(-statistic)
    # Step-down: each location is compared with the maximum over itself and all locations with a smaller statistic.
    largest = np.maximum.accumulate(null[:, order[::-1]], axis=1)[:, ::-1]
    step_p_values = (1.0 + (largest >= statistic[order]).sum(axis=0)) / (BOOTSTRAP_SAMPLES + 1.0)
    result = np.empty(groups)
    result[order] = np.maximum.accumulate(step_p_values)
    return result


def compute_shares(excess: FloatArray) -> FloatArray:
    """Return the shares of G locations in the excess, f64[G], with the sum 1.

    A location with a negative excess has the share 0. If no location has a positive excess, all shares are equal.
    excess: f64[G], counts^2.
    """
    positive = np.maximum(excess, 0.0)
    total = positive.sum()
    return np.asarray(positive / total if total > 0 else np.full(len(excess), 1.0 / max(len(excess), 1)))


def sum_groups(gram: FloatArray, index: NDArray[np.intp], count: int) -> FloatArray:
    """Return the sum of products over each group, f64[count, S, S] (S sessions).

    gram: f64[k, S, S]. index: [k], number of the group of each entry. count: number of groups.
    """
    result = np.zeros((count, *gram.shape[1:]))
    np.add.at(result, index, gram)
    return result


def locate_excess(pair: Pair, products: ResidualProducts, layout: FeatureLayout, seed: int) -> dict[str, Any]:
    """Return the field `where` of the report: shares of the excess with p-values, largest share first.

    The keys are `sensors` (boards), `lines`, `taxels`, `phases`, `objects` and `approaches`. products: products of the
    residuals of the real sessions from the simulator's features. seed: seed of the p-values' random numbers.
    """
    sensors = pair.sensors
    taxel_share, taxel_p_values = _evaluate_groups(products.taxels, products.centred_taxels, seed)
    by_taxel = [
        {"index": int(k), "share": float(taxel_share[k]), "p_value": float(taxel_p_values[k])}
        for k in np.argsort(-taxel_share, kind="stable")
    ]
    sensor_labels = [{"address": int(a), "name": n} for a, n in zip(sensors.address, sensors.name, strict=True)]
    by_feature, centred_by_feature = (part.sum(axis=0) for part in (products.conditions, products.centred_conditions))
    phases = [phase for phase in PHASES if (layout.phase == phase).any()]
    phase_index = np.array([phases.index(Phase(int(phase))) for phase in layout.phase], dtype=np.intp)
    by_condition, centred_by_condition = products.conditions.sum(axis=1), products.centred_conditions.sum(axis=1)
    objects = pair.object_names
    object_index = np.array([objects.index(object_name) for object_name, _ in pair.conditions], dtype=np.intp)

    def list_shares(labels: list[dict[str, Any]], gram: FloatArray, centred: FloatArray) -> list[dict[str, Any]]:
        """Return the labels of locations with their shares and p-values added, largest share first."""
        share, p_values = _evaluate_groups(gram, centred, seed)
        rows = [{**label, "share": float(share[k]), "p_value": float(p_values[k])} for k, label in enumerate(labels)]
        return sorted(rows, key=lambda entry: -entry["share"])

    def sum_taxels(group: NDArray[np.intp], number: int) -> tuple[FloatArray, FloatArray]:
        """Return the products, and the centred products, summed over the taxels of each of `number` groups."""
        return sum_groups(products.taxels, group, number), sum_groups(products.centred_taxels, group, number)

    lines: list[dict[str, Any]] = []
    axes = (("tx", pair.groups.tx, pair.taxels.tx), ("rx", pair.groups.rx, pair.taxels.rx))
    for axis, group, electrode in () if LINES in pair.missing_inputs else axes:
        number = int(group.max()) + 1
        first = [int(np.flatnonzero(group == k)[0]) for k in range(number)]
        labels = [{"address": int(pair.taxels.sensor[k]), "axis": axis, "index": int(electrode[k])} for k in first]
        lines += list_shares(labels, *sum_taxels(group, number))
    return {
        "sensors": list_shares(sensor_labels, *sum_taxels(pair.groups.sensor, len(sensors.address))),
        "lines": sorted(lines, key=lambda entry: -entry["share"]),
        "taxels": by_taxel,
        "phases": list_shares(
            [{"phase": PHASES[phase]} for phase in phases],
            sum_groups(by_feature, phase_index, len(phases)),
            sum_groups(centred_by_feature, phase_index, len(phases)),
        ),
        "objects": list_shares(
            [{"name": name} for name in objects],
            sum_groups(by_condition, object_index, len(objects)),
            sum_groups(centred_by_condition, object_index, len(objects)),
        ),
        "approaches": list_shares(
            [{"object": object_name, "approach": name} for object_name, name in pair.conditions],
            by_condition,
            centred_by_condition,
        ),
    }


def _evaluate_groups(gram: FloatArray, centred: FloatArray, seed: int) -> tuple[FloatArray, FloatArray]:
    """Return shares and p-values of G locations, both f64[G]. gram, centred: f64[G, S, S] (S sessions), counts^2."""
    return compute_shares(compute_off_diagonal_mean(gram)), compute_p_values(gram, centred, seed)
