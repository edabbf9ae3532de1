"""The figures of a blind check, from its answers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Any, Final

import numpy as np

from taxel.blind.answers import Answer, Named
from taxel.blind.hidden import UNKNOWN
from taxel.blind.kinds import NAMES
from taxel.blind.simpler import NO_GAP
from taxel.blind.strangers import ACTS_LIKE

RATIOS: Final = (0.0, 1.0, 2.0, 3.0, 4.0, 6.0, np.inf)
"""Bounds of gap over floor between which accuracy is told."""

DEFINED: Final = ("counts", "s", "mm", "deg")
"""Units whose parameters are asked to be right by 10 %; with log_std."""

_Z: Final = 1.959964
"""Of the standard normal distribution: 2.5 % lie above."""


def wilson(right: int, of: int) -> list[float]:
    """95 % interval of a share (Wilson 1927)."""
    if of == 0:
        return [0.0, 1.0]
    share = right / of
    middle = (share + _Z**2 / (2 * of)) / (1 + _Z**2 / of)
    half = _Z / (1 + _Z**2 / of) * float(np.sqrt(share * (1 - share) / of + _Z**2 / (4 * of**2)))
    return [max(0.0, middle - half), min(1.0, middle + half)]


def share(flags: Iterable[bool]) -> dict[str, Any]:
    """{"right", "of", "share", "ci95"} of what is true."""
    values = [bool(flag) for flag in flags]
    right = sum(values)
    return {
        "right": right,
        "of": len(values),
        "share": right / len(values) if values else None,
        "ci95": wilson(right, len(values)),
    }


def score(answers: Sequence[Answer]) -> dict[str, Any]:
    """Everything that the sheet shows."""
    rig = [one for one in answers if one.world.hand == "rig4"]
    whole = [one for one in answers if one.world.hand != "rig4"]
    return {"worlds": len(answers), "rig4": _of(rig), "full_hand": _of(whole) if whole else None}


def _of(answers: Sequence[Answer]) -> dict[str, Any]:
    kinds = {kind: [one for one in answers if one.world.hidden.kind == kind] for kind in _KINDS}
    clear = {kind: [one for one in own if one.clear] for kind, own in kinds.items()}
    single = clear["single"]
    return {
        "counts": {kind: {"worlds": len(own), "clear": len(clear[kind])} for kind, own in kinds.items()},
        "errors": [f"{one.world.number}: {one.error}" for one in answers if one.error],
        "blindfold": dict(Counter(one.blindfold for one in answers if not one.error)),
        **_named_first(kinds["single"]),
        "several_f1": _micro_f1(clear["several"]),
        "false_alarms": share(one.named.status != NO_GAP for one in kinds["none"]),
        **_strangers(clear["outside"], single),
        "lookalike": share(_says_what_it_is_like(one) for one in clear["lookalike"]),
        "places": share(one.found_places for one in answers if one.found_places is not None),
        "parameters": _parameters(answers),
        "shrink": _shrink(answers),
        "coverage": share(
            row.low <= row.true <= row.high
            for one in single
            for row in one.parameters
            if row.low is not None and row.high is not None
        ),
        "seeds": share(not one.error and _same(other, one.named) for one in answers for other in one.seeds),
        "runtime_s": _spread([one.runtime_s for one in answers if not one.error]),
        "confusion": _confusion(answers),
        "simpler": _simpler(answers, single),
    }


def _named_first(worlds: Sequence[Answer]) -> dict[str, Any]:
    """Of worlds with a single effect."""
    clear = [one for one in worlds if one.clear]
    told = [one for one in worlds if not one.error]
    return {
        "single_first": share(one.first_right for one in clear),
        "single_each": {
            name: share(one.first_right for one in clear if name in one.world.hidden.names) for name in NAMES
        },
        "single_each_form": _by((_form(one), one.first_right) for one in clear),
        "single_by_ratio": [
            {
                "from": low,
                "to": None if np.isinf(high) else high,
                **share(one.first_right for one in told if low <= one.ratio < high),
            }
            for low, high in pairwise(RATIOS)
        ],
    }


def _strangers(outside: Sequence[Answer], single: Sequence[Answer]) -> dict[str, Any]:
    """Of clear worlds whose cause is not in the catalogue, or was deleted from it; and with another effect deleted."""
    withheld = [(one.world.hidden.names[0], one.without) for one in single if one.without is not None]
    named = [*(one.named for one in outside), *(without for _, without in withheld)]
    return {
        "unknown": share(one.says_unknown for one in named),
        "unknown_outside": share(one.named.says_unknown for one in outside),
        "unknown_outside_each": _by((_form(one), one.named.says_unknown) for one in outside),
        "unknown_withheld": share(without.says_unknown for _, without in withheld),
        "unknown_withheld_each": _by((name, without.says_unknown) for name, without in withheld),
        "misnamed": share(one.misnames for one in named),
        "decoy_first": share(one.decoy.is_first(one.world.hidden.names) for one in single if one.decoy is not None),
    }


def _says_what_it_is_like(answer: Answer) -> bool:
    """Unknown, or the effect of the catalogue that the cause acts like."""
    return answer.named.says_unknown or answer.named.effects[:1] in [(name,) for name in ACTS_LIKE[_form(answer)]]


def _same(one: Named, other: Named) -> bool:
    return (one.status, one.effects) == (other.status, other.effects)


_KINDS: Final = ("none", "single", "several", "outside", "lookalike")


def _form(answer: Answer) -> str:
    return answer.world.hidden.causes[0].form


def _by(rows: Iterable[tuple[str, bool]]) -> dict[str, Any]:
    """The share of each name."""
    groups: dict[str, list[bool]] = {}
    for name, flag in rows:
        groups.setdefault(name, []).append(flag)
    return {name: share(groups[name]) for name in sorted(groups)}


def _micro_f1(answers: Sequence[Answer]) -> dict[str, Any]:
    """Of names: what was named and is there, against what was named and what is there. A cause that the report calls
    indistinguishable from one that it names counts as named, as with single effects. One that no press could show is
    neither asked for nor wrong.
    """
    hits = named = there = 0
    for one in answers:
        said = set(one.named.effects) - {UNKNOWN, *one.idle}
        truth = set(one.world.hidden.names) - set(one.idle)
        hits, named, there = hits + one.named.hits(truth), named + len(said), there + len(truth)
    precision, recall = hits / max(named, 1), hits / max(there, 1)
    f1 = 2 * precision * recall / max(precision + recall, 1e-12)
    return {"f1": f1, "precision": precision, "recall": recall, "worlds": len(answers)}


def _parameters(answers: Sequence[Answer]) -> dict[str, Any]:
    groups: dict[tuple[str, str, str, str, bool], list[float]] = {}
    for row in (row for one in answers if one.clear for row in one.parameters):
        key = row.form, row.name.split("@")[0], row.effect, row.unit, row.reference
        groups.setdefault(key, []).append(row.error)
    each: dict[str, Any] = {}
    errors: dict[bool, list[float]] = {True: [], False: []}
    for (form, name, effect, unit, reference), own in sorted(groups.items()):
        asked = unit in DEFINED or name == "log_std"
        errors[asked] += own
        each[f"{form}: {name}"] = {
            "effect": effect,
            "unit": unit,
            "against": "a fit to noise-free presses" if reference else "the hidden value",
            "asked": asked,
            "of": len(own),
            "median_relative_error": _median(own),
        }
    return {"each": each, "asked": _median(errors[True]), "others": _median(errors[False])}


def _median(values: Sequence[float]) -> float | None:
    return float(np.median(values)) if values else None


def _shrink(answers: Sequence[Answer]) -> dict[str, Any]:
    apart = [100 * abs(one.shrink[0] - one.shrink[1]) for one in answers if one.shrink is not None and one.clear]
    return {"of": len(apart), "mean_points": float(np.mean(apart)) if apart else None}


def _spread(values: Sequence[float]) -> dict[str, Any]:
    if not values:
        return {"median": None, "p90": None, "max": None}
    return {"median": float(np.median(values)), "p90": float(np.quantile(values, 0.9)), "max": max(values)}


def _confusion(answers: Sequence[Answer]) -> dict[str, dict[str, int]]:
    """Truth (rows) against what was named first, of worlds with a clear gap and those without a cause."""
    table: dict[str, dict[str, int]] = {}
    for one in answers:
        hidden = one.world.hidden
        if hidden.kind == "several" or (hidden.kind != "none" and not one.clear):
            continue
        truth = hidden.names[0] if hidden.names else NO_GAP
        row = table.setdefault(truth, {})
        said = _said(one.named)
        row[said] = row.get(said, 0) + 1
    return table


def _said(named: Named) -> str:
    return named.effects[0] if named.effects else named.status


def _simpler(answers: Sequence[Answer], single: Sequence[Answer]) -> dict[str, Any]:
    """Simpler diagnosers on the single worlds, and what becomes of a diagnosis whose simulation is the wrong one."""
    shuffled = [one.shuffled for one in answers if one.shuffled is not None]
    named = {
        name: share(one.simpler.get(name) == one.world.hidden.names[0] for one in single)
        for name in ("rules", "effect_blind")
    }
    return {
        **named,
        "shuffled_says_unknown_or_no_gap": share(one.says_unknown or one.status == NO_GAP for one in shuffled),
    }
