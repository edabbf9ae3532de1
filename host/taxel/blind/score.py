"""The figures of a blind check, computed from its results."""

from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Any, Final

import numpy as np

from taxel.blind.baselines import NO_GAP
from taxel.blind.catalogue_causes import EFFECT_NAMES
from taxel.blind.hidden import UNKNOWN
from taxel.blind.out_of_catalogue import SIMILAR_EFFECTS
from taxel.blind.results import ReportedVerdict, WorldResult

RATIOS: Final = (0.0, 1.0, 2.0, 3.0, 4.0, 6.0, np.inf)
"""Bounds of the ratio of gap to floor for the accuracy by ratio."""

REQUIRED_UNITS: Final = ("counts", "s", "mm", "deg")
"""Units of the parameters whose median relative error is limited, in addition to log_std."""

KINDS: Final = ("none", "single", "several", "outside", "lookalike")

_Z: Final = 1.959964
"""97.5 % quantile of the standard normal distribution."""


def compute_wilson_interval(successes: int, count: int) -> list[float]:
    """Compute the 95 % interval of a proportion `successes` / `count` (Wilson, J. Am. Stat. Assoc. 22, 1927)."""
    if count == 0:
        return [0.0, 1.0]
    proportion = successes / count
    middle = (proportion + _Z**2 / (2 * count)) / (1 + _Z**2 / count)
    variance = proportion * (1 - proportion) / count + _Z**2 / (4 * count**2)
    half = _Z / (1 + _Z**2 / count) * float(np.sqrt(variance))
    return [max(0.0, middle - half), min(1.0, middle + half)]


def share(flags: Iterable[bool]) -> dict[str, Any]:
    """Compute the share of true values: {"count": number, "of": total, "share": ratio, "ci95": Wilson interval}."""
    values = [bool(flag) for flag in flags]
    count = sum(values)
    return {
        "count": count,
        "of": len(values),
        "share": count / len(values) if values else None,
        "ci95": compute_wilson_interval(count, len(values)),
    }


def score(results: Sequence[WorldResult]) -> dict[str, Any]:
    """Compute all figures of the blind check's score sheet, separately for the rig and the whole hand."""
    rig = [result for result in results if result.world.hand == "rig4"]
    full_hand = [result for result in results if result.world.hand != "rig4"]
    return {
        "worlds": len(results),
        "rig4": _score_part(rig),
        "full_hand": _score_part(full_hand) if full_hand else None,
    }


def _score_part(results: Sequence[WorldResult]) -> dict[str, Any]:
    """Compute all figures of the score for one group of worlds: the rig or the whole hand.

    Most figures are computed from the clear worlds, in which the gap is so large that the cause must be named. A key
    of the result is a row or a table of the score sheet.
    """
    by_kind = {kind: [result for result in results if result.world.hidden.kind == kind] for kind in KINDS}
    clear = {kind: [result for result in of_kind if result.is_clear] for kind, of_kind in by_kind.items()}
    single = clear["single"]
    return {
        "counts": {kind: {"worlds": len(of_kind), "clear": len(clear[kind])} for kind, of_kind in by_kind.items()},
        "errors": [f"{result.world.number}: {result.error}" for result in results if result.error],
        "blindfold": dict(Counter(result.isolation for result in results if not result.error)),
        **_first_effect_scores(by_kind["single"]),
        "several_f1": _micro_f1(clear["several"]),
        "false_alarms": share(result.verdict.status != NO_GAP for result in by_kind["none"]),
        **_out_of_catalogue_scores(clear["outside"], single),
        "lookalike": share(_is_unknown_or_similar(result) for result in clear["lookalike"]),
        "places": share(result.is_location_found for result in results if result.is_location_found is not None),
        "parameters": _parameter_errors(results),
        "shrink": _shrink_error(results),
        "coverage": share(
            parameter.low <= parameter.truth <= parameter.high
            for result in single
            for parameter in result.parameters
            if parameter.low is not None and parameter.high is not None
        ),
        "seeds": share(
            not result.error and _is_same(verdict, result.verdict)
            for result in results
            for verdict in result.verdicts_by_seed
        ),
        "runtime_s": _runtime_quantiles([result.runtime_s for result in results if not result.error]),
        "confusion": _confusion(results),
        "simpler": _baseline_scores(results, single),
    }


def _first_effect_scores(worlds: Sequence[WorldResult]) -> dict[str, Any]:
    """Compute how often the first effect of the verdict is correct, in worlds with a single cause."""
    clear = [result for result in worlds if result.is_clear]
    with_report = [result for result in worlds if not result.error]
    return {
        "single_first": share(result.is_first_correct for result in clear),
        "single_each": {
            name: share(result.is_first_correct for result in clear if name in result.world.hidden.names)
            for name in EFFECT_NAMES
        },
        "single_each_form": _share_by_group((_emulator_effect(result), result.is_first_correct) for result in clear),
        "single_by_ratio": [
            {
                "from": low,
                "to": None if np.isinf(high) else high,
                **share(result.is_first_correct for result in with_report if low <= result.ratio < high),
            }
            for low, high in pairwise(RATIOS)
        ],
    }


def _out_of_catalogue_scores(outside: Sequence[WorldResult], single: Sequence[WorldResult]) -> dict[str, Any]:
    """Compute how often the verdict is "unknown" although no effect of the catalogue is correct.

    outside: clear worlds whose cause is not in the catalogue. single: clear worlds with a single cause; for some of
    them a second diagnosis was made with the correct effect, or another one (decoy), removed from the catalogue.
    """
    withheld = [
        (result.world.hidden.names[0], result.verdict_withheld)
        for result in single
        if result.verdict_withheld is not None
    ]
    verdicts = [*(result.verdict for result in outside), *(verdict for _, verdict in withheld)]
    return {
        "unknown": share(verdict.has_unknown for verdict in verdicts),
        "unknown_outside": share(result.verdict.has_unknown for result in outside),
        "unknown_outside_each": _share_by_group(
            (_emulator_effect(result), result.verdict.has_unknown) for result in outside
        ),
        "unknown_withheld": share(verdict.has_unknown for _, verdict in withheld),
        "unknown_withheld_each": _share_by_group((name, verdict.has_unknown) for name, verdict in withheld),
        "misnamed": share(verdict.is_confident for verdict in verdicts),
        "decoy_first": share(
            result.verdict_decoy.is_first(result.world.hidden.names)
            for result in single
            if result.verdict_decoy is not None
        ),
    }


def _is_unknown_or_similar(result: WorldResult) -> bool:
    """Whether the verdict contains an unknown cause, or its first effect is similar to the hidden cause."""
    similar = [(name,) for name in SIMILAR_EFFECTS[_emulator_effect(result)]]
    return result.verdict.has_unknown or result.verdict.effects[:1] in similar


def _is_same(first: ReportedVerdict, second: ReportedVerdict) -> bool:
    """Whether two verdicts have the same status and the same effects in the same order."""
    return (first.status, first.effects) == (second.status, second.effects)


def _emulator_effect(result: WorldResult) -> str:
    """Return the emulator effect of the first hidden cause of a world, such as "spread film"."""
    return result.world.hidden.causes[0].emulator_effect


def _share_by_group(rows: Iterable[tuple[str, bool]]) -> dict[str, Any]:
    """Compute the share of true values of each group. rows: name of the group and value."""
    groups: dict[str, list[bool]] = {}
    for name, flag in rows:
        groups.setdefault(name, []).append(flag)
    return {name: share(groups[name]) for name in sorted(groups)}


def _micro_f1(results: Sequence[WorldResult]) -> dict[str, Any]:
    """Compute precision, recall and F1 over the effect names of all worlds together (micro-average).

    A true cause also counts as named if the data cannot distinguish it from a wrong effect of the verdict. Causes that
    are not observable are ignored among the true causes and in the verdict.
    """
    correct_count = named_count = true_count = 0
    for result in results:
        named = set(result.verdict.effects) - {UNKNOWN, *result.unobservable_causes}
        truth = set(result.world.hidden.names) - set(result.unobservable_causes)
        correct_count += result.verdict.count_named(truth)
        named_count, true_count = named_count + len(named), true_count + len(truth)
    precision, recall = correct_count / max(named_count, 1), correct_count / max(true_count, 1)
    f1 = 2 * precision * recall / max(precision + recall, 1e-12)
    return {"f1": f1, "precision": precision, "recall": recall, "worlds": len(results)}


def _parameter_errors(results: Sequence[WorldResult]) -> dict[str, Any]:
    """Compute the median relative errors of the parameters, in total and for each parameter of each emulator effect.

    The total is computed separately for the parameters that must be accurate (those with a unit of `REQUIRED_UNITS`,
    and "log_std") and for the others.
    """
    groups: dict[tuple[str, str, str, str, bool], list[float]] = {}
    for parameter in (parameter for result in results if result.is_clear for parameter in result.parameters):
        name = parameter.name.split("@")[0]  # the name of one board's parameter ends in the address: "seconds@81"
        key = parameter.emulator_effect, name, parameter.effect, parameter.unit, parameter.is_reference
        groups.setdefault(key, []).append(parameter.relative_error)
    each: dict[str, Any] = {}
    errors: dict[bool, list[float]] = {True: [], False: []}
    for (emulator_effect, name, effect, unit, is_reference), group in sorted(groups.items()):
        is_required = unit in REQUIRED_UNITS or name == "log_std"
        errors[is_required] += group
        each[f"{emulator_effect}: {name}"] = {
            "effect": effect,
            "unit": unit,
            "against": "reference fit" if is_reference else "hidden value",
            "asked": is_required,
            "of": len(group),
            "median_relative_error": _median(group),
        }
    return {"each": each, "asked": _median(errors[True]), "others": _median(errors[False])}


def _median(values: Sequence[float]) -> float | None:
    """Compute the median of values; None without values."""
    return float(np.median(values)) if values else None


def _shrink_error(results: Sequence[WorldResult]) -> dict[str, Any]:
    """Compute how well the diagnosis predicts the shrink, the relative reduction of the gap by the diagnosed effects.

    Returns the mean absolute difference of predicted and measured shrink, percentage points, and the number of worlds.
    """
    points = [
        100 * abs(result.shrink[0] - result.shrink[1])
        for result in results
        if result.shrink is not None and result.is_clear
    ]
    return {"of": len(points), "mean_points": float(np.mean(points)) if points else None}


def _runtime_quantiles(values: Sequence[float]) -> dict[str, Any]:
    """Compute median, 90 % quantile and maximum of run times in seconds; None for each without run times."""
    if not values:
        return {"median": None, "p90": None, "max": None}
    return {"median": float(np.median(values)), "p90": float(np.quantile(values, 0.9)), "max": max(values)}


def _confusion(results: Sequence[WorldResult]) -> dict[str, dict[str, int]]:
    """Count the worlds for each true effect (rows) and effect named first (columns).

    Only worlds with at most one cause count: those with a clear gap, and those without a cause.
    """
    table: dict[str, dict[str, int]] = {}
    for result in results:
        hidden = result.world.hidden
        if hidden.kind == "several" or (hidden.kind != "none" and not result.is_clear):
            continue
        truth = hidden.names[0] if hidden.names else NO_GAP
        row = table.setdefault(truth, {})
        column = _first_effect_or_status(result.verdict)
        row[column] = row.get(column, 0) + 1
    return table


def _first_effect_or_status(verdict: ReportedVerdict) -> str:
    """Return the first effect of a verdict, or the status of a verdict without effects, such as "no_gap"."""
    return verdict.effects[0] if verdict.effects else verdict.status


def _baseline_scores(results: Sequence[WorldResult], single: Sequence[WorldResult]) -> dict[str, Any]:
    """Compute the scores of the simple reference diagnosers, and of the diagnosis with exchanged simulations.

    single: clear worlds with a single cause, on which the reference diagnosers are scored. Exchanged simulations belong
    to other indentations and do not match the real data: the correct verdict is then "unknown" or "no gap".
    """
    shuffled = [result.verdict_shuffled for result in results if result.verdict_shuffled is not None]
    by_diagnoser = {
        name: share(result.baseline_verdicts.get(name) == result.world.hidden.names[0] for result in single)
        for name in ("rules", "effect_blind")
    }
    return {
        **by_diagnoser,
        "shuffled_says_unknown_or_no_gap": share(
            verdict.has_unknown or verdict.status == NO_GAP for verdict in shuffled
        ),
    }
