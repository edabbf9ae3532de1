"""From numbers to a verdict: no gap, explained, partly explained, or unknown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final

from taxel.gap.catalogue import DROPOUT
from taxel.gap.held_out import HeldOut
from taxel.gap.metric import Gap, margin2
from taxel.gap.trial import Selection

UNKNOWN: Final = "unknown"

SURELY_WITHIN: Final = 1.0 / 3.0
"""Of the margin: an excess below it is none, whatever was found; and what all presses but one make together."""

STRAYS: Final = 2.0
"""Margins, up to which an excess that no effect explains may hang on one press."""

SIGNIFICANT: Final = 0.02
"""P-value of an excess from which on it may be chance."""

PRESSES: Final = 8
"""From so many on a gap that no effect explains must not hang on one of them."""

NAMED: Final = 0.5
"""Share of the score that the found effects must explain together to be believed; below it the cause is unknown."""

EXPLAINED: Final = 0.8
"""And to leave nothing worth a name: this share of what lies above the floor on the sessions that were left out, and of
the score where they were fitted; and what is left is no gap of its own, by the same margin. A stranger is often
explained by two thirds, and rarely by so much."""

PATTERN_LEVEL: Final = 0.01
"""P-value of a generic distortion in what is left, corrected for the bank, under which it is surely there."""

PATTERN_SHARE: Final = 0.5
"""Of what is left that it tells; if that is more than the margin, something nameless is there."""

NEARLY_ALL: Final = 0.96
"""Or this: no model of a large effect is better."""

WORDS: Final = {
    "contact_propagation": "pressure spreads sideways in the dielectric",
    "electrode_crosstalk": "taxels with a common electrode influence each other",
    "noise": "the hand has more noise",
    "gain_mismatch": "taxels or boards are more or less sensitive than modelled",
    "stiffness": "the dielectric is softer or harder than modelled",
    "baseline_drift": "the count without contact drifts",
    "hysteresis": "the layer creeps and recovers slowly",
    "saturation": "the count stops decreasing at high force",
    "proximity": "the fringe field produces a signal before contact",
    "dropout": "taxels, lines or boards do not respond",
    "pose_error": "an object or a bracket is not where the model places it",
    "latency": "boards lag behind the hand",
    "unknown": "a cause that is not in the catalogue",
}


@dataclass(frozen=True)
class Verdict:
    """status: as the report page has it. effects: strongest first. one_line: for people. margin: counts^2."""

    status: str
    effects: tuple[str, ...]
    one_line: str
    margin: float


def judge_verdict(
    gap: Gap,
    selection: Selection,
    names: tuple[str, ...],
    held: HeldOut,
    simulated2: float = 0.0,
    nameless: Mapping[str, str] = MappingProxyType({}),
    cells: Sequence[tuple[str, str]] = (),
    bank: Sequence[Mapping[str, Any]] = (),
) -> Verdict:
    """names: what was found, strongest first. held: the gap on sessions that were left out. simulated2: counts^2 by
    which the other side's means scatter, where it has sessions as well. nameless: of the found ones those that may as
    well be a cause without a name, and why. cells: object and approach of each press. bank: generic distortions of what
    the found ones leave, as the report's `unexplained` has them.
    """
    margin = margin2(gap.floor**2 + simulated2)
    # Few sessions bound an excess loosely: one within the margin that may well be chance is none either.
    within = gap.most <= margin or (gap.excess.value <= margin and gap.p_value > SIGNIFICANT)
    named = max(selection.explained, held.reducible or 0.0)
    local = selection.is_local
    # Within the margin counts must tell it, too: a score may be of what hardly scatters, and no gap of counts.
    told = min(named, held.reducible or 0.0) >= NAMED and gap.excess.value > SURELY_WITHIN * margin
    if within and not local and not (names and told):
        line = f"No gap: {gap.gap.value:.1f} counts; repeats and sessions alone cause {gap.floor:.1f} counts"
        found = [_in_words(name) for name in names] if named >= NAMED else []
        part = f" A part of the {gap.gap.value:.1f} counts is due to {'; '.join(found)}." if found else ""
        line = f"{line}.{part}"
        return Verdict("no_gap", (), line, margin)
    if not names and gap.excess.value <= STRAYS * margin and (one := _hangs_on(gap, margin)) is not None:
        press = f"one condition ({' '.join(cells[one])})" if cells else "one condition"
        size = f"{gap.gap.value:.1f} counts (floor {gap.floor:.1f})"
        line = f"No gap except in {press}: {size}, hardly any excess in the other conditions."
        return Verdict("no_gap", (), line, margin)
    if within and local and gap.excess.value <= SURELY_WITHIN * margin:
        names = tuple(name for name in names if name == DROPOUT)  # what else was found is too little to be told
    size = f"a gap of {gap.gap.value:.1f} counts (floor {gap.floor:.1f})"
    if not names and not (selection.rounds and selection.rounds[0].trials):
        return Verdict(UNKNOWN, (UNKNOWN,), f"Unknown: {size}; no effect of the catalogue was tried.", margin)
    if not names and gap.floor == 0.0:
        line = f"Unknown: {size}; without repeats the variance is unknown; record every condition at least twice."
        return Verdict(UNKNOWN, (UNKNOWN,), line, margin)
    if not names and gap.excess.error is None:
        line = f"Unknown: {size}; fewer than three sessions do not determine its cause{_most_like(selection)}."
        return Verdict(UNKNOWN, (UNKNOWN,), line, margin)
    if not names or (named < NAMED and not local):
        return Verdict(UNKNOWN, (UNKNOWN,), f"Unknown: {size} that no effect of the catalogue explains.", margin)
    said = "; ".join(_in_words(name) for name in names)
    less = f"reduced by {100 * held.shrink.value:.0f} % with {said}"
    enough = _is_enough(selection, held, margin) and not _has_pattern(bank, margin)
    if not (within and local) and not enough:
        line = f"Partly explained: {size}, {less}; the cause of the remaining gap is unknown."
        return Verdict("partly_explained", (*names, UNKNOWN), line, margin)
    unsure = "; ".join(dict.fromkeys(nameless[name] for name in names if name in nameless))
    if unsure:
        line = f"Partly explained: {size}, {less}; but {unsure}."
        return Verdict("partly_explained", (*names, UNKNOWN), line, margin)
    return Verdict("explained", names, f"Explained: {size}, {less}.", margin)


def _has_pattern(bank: Sequence[Mapping[str, Any]], margin: float) -> bool:
    """Whether what is left is surely of one kind, and as much as a gap of its own."""
    return any(
        one["p_value"] is not None
        and one["p_value"] < PATTERN_LEVEL
        and one["share"] > PATTERN_SHARE
        and one["counts2"] > margin
        for one in bank
    )


def _hangs_on(gap: Gap, margin: float) -> int | None:
    """The press without which there is next to no excess, if there is one: a touch of an edge comes out otherwise with
    another solver, and a stranger that touches one press only cannot be told from that.
    """
    excess = gap.terms.excess
    cells = excess.sum(axis=(1, 2)) / (excess.shape[0] * excess.shape[2])
    alone = len(cells) >= PRESSES and float(cells.sum() - cells.max()) <= SURELY_WITHIN * margin
    return int(cells.argmax()) if alone else None


def _most_like(selection: Selection) -> str:
    """What takes most of the gap, though nobody knows whether by chance."""
    best = selection.rounds[0].best if selection.rounds else None
    if best is None or best.held is None or best.held.gone_of(selection.start) < NAMED:
        return ""
    share = 100 * best.held.gone_of(selection.start)
    return f"; the most similar effect is {_in_words(best.name)} with {share:.0f} % of the score"


def _in_words(name: str) -> str:
    """The name, and what it is, if somebody has said so: a user's own effect needs no entry."""
    plain = name.replace("_", " ")
    return f"{plain} ({WORDS[name]})" if name in WORDS else plain


def _is_enough(selection: Selection, held: HeldOut, margin: float) -> bool:
    """Whether what the found effects leave is none itself, or next to nothing of what was there."""
    if selection.fits < EXPLAINED:
        return False
    if held.reducible is None:
        return True
    return held.reducible >= NEARLY_ALL or (held.reducible >= EXPLAINED and held.left2 <= margin)
