"""The verdict: status, causes, headline and reasons, derived from the probabilities of the comparison."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Final

from taxel.gap.calibration.calibration import NAMED_PROBABILITY, NO_GAP, SMALLEST_CAUSE, UNKNOWN
from taxel.gap.features.metric import Gap
from taxel.gap.verdict.headlines import (
    HEADLINES,
    REAL_AND_SIMULATED,
    Sides,
    make_either_headline,
    make_headline,
    make_open_headline,
    make_weak_headline,
)
from taxel.gap.verdict.held_out import HeldOut

MIN_SESSIONS: Final = 3
"""Smallest number of sessions for the status `no_gap` or `explained`. Chosen: below it the variance between sessions is
hardly known."""

MEANINGS: Final = {
    "contact_propagation": "pressure spreads sideways in the dielectric",
    "electrode_crosstalk": "taxels with a common electrode influence each other",
    "noise": "the hand has more noise",
    "gain_mismatch": "taxels or boards are more or less sensitive than modelled",
    "stiffness": "the dielectric is softer or harder than modelled",
    "nonlinearity": "the signal depends on the load by another curve",
    "baseline_drift": "the count without contact drifts",
    "hysteresis": "the layer creeps and recovers slowly",
    "saturation": "the count stops decreasing at high force",
    "proximity": "the fringe field produces a signal before contact",
    "dropout": "taxels, lines or boards do not respond",
    "pose_error": "an object or a bracket is not where the model places it",
    "latency": "boards lag behind the hand",
    UNKNOWN: "a cause that is not in the catalogue",
}
"""Meaning of each cause in the sentence of the verdict. An effect of a plug-in has no entry; its name is used."""


@dataclass(frozen=True)
class Verdict:
    """A verdict.

    status: `no_gap`, `explained`, `partly_explained` or `unknown`. effects: causes with a probability of at least
    `NAMED_PROBABILITY`, most probable first, `unknown` last. probabilities: probability of every cause and of no gap,
    by name. headline: at most twelve words. one_line: a sentence with status, meaning, gap and floor. reasons: reasons
    for doubt, one sentence each. rivals: by leading effect (`list_leading_effects`), the unnamed effects that predict
    almost as well in its place.
    """

    status: str
    effects: tuple[str, ...]
    probabilities: Mapping[str, float]
    headline: str
    one_line: str
    reasons: tuple[str, ...] = ()
    rivals: Mapping[str, Sequence[str]] = field(default_factory=dict)


NO_CAUSE_NAMED: Final = "no cause has a probability of 0.5 or more"
"""Reason for doubt of a verdict without a named cause."""


def list_causes(probabilities: Mapping[str, float]) -> tuple[str, ...]:
    """Return the causes with a probability of at least `NAMED_PROBABILITY`, most probable first, an unknown cause last.

    Returns ("unknown",) if there is no such cause and the probability of no gap is below `NAMED_PROBABILITY`.
    """
    causes = sorted((name for name in probabilities if name != NO_GAP), key=lambda name: -probabilities[name])
    names = [name for name in causes if probabilities[name] >= NAMED_PROBABILITY]
    if not names and probabilities[NO_GAP] < NAMED_PROBABILITY:
        return (UNKNOWN,)
    return tuple(sorted(names, key=lambda name: name == UNKNOWN))


def list_leading_effects(probabilities: Mapping[str, float]) -> tuple[str, ...]:
    """Return the named effects; if none is named, the most probable effect. The report states the rivals of these
    effects.
    """
    known = tuple(name for name in list_causes(probabilities) if name != UNKNOWN)
    others = [name for name in probabilities if name not in (NO_GAP, UNKNOWN)]
    return known or tuple(sorted(others, key=lambda name: -probabilities[name])[:1])


def derive_verdict(
    gap: Gap,
    probabilities: Mapping[str, float],
    held_out: HeldOut,
    rivals: Mapping[str, Sequence[str]] = MappingProxyType({}),
    warnings: Sequence[str] = (),
    sides: Sides = REAL_AND_SIMULATED,
) -> Verdict:
    """Derive the verdict from the probabilities and the number of sessions.

    gap: gap without effects. probabilities: probability of every cause and of no gap. held_out: evaluation of the named
    effects on held-out sessions. rivals: for each effect of `list_leading_effects`, the effects that can replace it.
    warnings: reasons for doubt from other parts of the diagnosis, one sentence each. sides: words for the two datasets.
    """
    effects = list_causes(probabilities)
    known = tuple(name for name in effects if name != UNKNOWN)
    unnamed = {name: tuple(other for other in others if other not in known) for name, others in rivals.items()}
    rivals = {name: others for name, others in unnamed.items() if others}
    reasons = list(warnings)
    is_tentative = held_out.session_count < MIN_SESSIONS
    if is_tentative:
        reasons.insert(0, f"too few sessions for a verdict: {held_out.session_count} recorded, needs {MIN_SESSIONS}")
    if not effects and not is_tentative:
        bound = f"is smaller than {max(gap.excess_bound, 0.0) ** 0.5:.1f} counts with a probability of 95 %"
        line = f"No gap: the difference is {describe_size(held_out)}; the part above the floor {bound}."
        headline = f"{sides.sim.capitalize()} agrees with {sides.real}."
        return Verdict("no_gap", (), probabilities, headline, line, tuple(reasons))
    if not effects or (is_tentative and not known):
        line = f"Unknown: the difference is {describe_size(held_out)}; {reasons[0]}."
        headline = f"Too few sessions for a verdict: record {MIN_SESSIONS} or more."
        return Verdict(UNKNOWN, (UNKNOWN,), probabilities, headline, line, tuple(reasons))
    if not known:
        return _derive_unknown_verdict(held_out, probabilities, rivals, reasons, sides)
    remaining = _describe_remaining_excess(gap, held_out)
    has_more = UNKNOWN in effects or bool(remaining)
    if UNKNOWN in effects:
        percent = f"{100 * probabilities[UNKNOWN]:.0f} %"
        reasons.append(f"a cause outside the catalogue is present with a probability of {percent}")
    if remaining:
        reasons.append(remaining)
    status = "partly_explained" if has_more or is_tentative else "explained"
    least = min(probabilities[name] for name in known)
    headline = make_headline(known, sides, has_more, is_tentative, least)
    line = f"{'Partly explained' if status == 'partly_explained' else 'Explained'}: {_describe_shrink(held_out, known)}"
    if UNKNOWN in effects:
        line += "; the cause of the remaining gap is unknown"
    elif is_tentative or remaining:
        line += f"; {reasons[0] if is_tentative else remaining}"
    return Verdict(status, effects, probabilities, headline, f"{line}.", tuple(reasons), rivals)


def _derive_unknown_verdict(
    held_out: HeldOut,
    probabilities: Mapping[str, float],
    rivals: Mapping[str, Sequence[str]],
    reasons: list[str],
    sides: Sides,
) -> Verdict:
    """Derive the verdict of a gap without a named effect, whose headline names the most probable effects if there are
    any.

    reasons: the other reasons for doubt. The remaining arguments are those of `derive_verdict`.
    """
    size, headline = describe_size(held_out), sides.fill(HEADLINES[UNKNOWN])
    line = f"Unknown: the gap is {size}; no effect of the catalogue explains the gap."
    if not set(probabilities) - {UNKNOWN, NO_GAP}:
        line = f"Unknown: the gap is {size}; no effect of the catalogue was tried."
    elif rivals and probabilities.get(UNKNOWN, 0.0) < NAMED_PROBABILITY:
        first = next(iter(rivals))
        second = rivals[first][0]
        line = f"Unknown: the gap is {size}; the most probable causes are {_to_words(first)} or {_to_words(second)}."
        headline = make_either_headline(first, second, sides)
        reasons = [*reasons, NO_CAUSE_NAMED]
    else:
        first = max(probabilities, key=lambda name: probabilities[name])
        if first == NO_GAP:
            line = f"Unknown: the gap is {size}; it is open whether a cause is present."
            headline = make_open_headline(sides)
            reasons = [*reasons, NO_CAUSE_NAMED]
        elif first != UNKNOWN:
            line = f"Unknown: the gap is {size}; the most probable cause is {_to_words(first)}."
            headline = make_weak_headline(first, sides)
            reasons = [*reasons, NO_CAUSE_NAMED]
    return Verdict(UNKNOWN, (UNKNOWN,), probabilities, headline, line, tuple(reasons), rivals)


def describe_size(held_out: HeldOut) -> str:
    """Describe gap and floor of the held-out sessions: "24.3 counts (floor 4.0)".

    With one session and without repeats, the text states that the floor was not measured.
    """
    floor = f"floor {held_out.floor2**0.5:.1f}" if held_out.floor2 > 0.0 else "floor not measured"
    return f"{held_out.before:.1f} counts ({floor})"


def _describe_shrink(held_out: HeldOut, known: Sequence[str]) -> str:
    """Describe by how much the named effects reduce the gap of held-out sessions. known: names of these effects."""
    causes = " and ".join(_to_words(name) for name in known)
    verb = "reduces" if len(known) == 1 else "reduce"
    is_at_floor = held_out.remaining_excess.low is None or held_out.remaining_excess.low <= 0.0
    relation = "the rest agrees with the floor of" if is_at_floor else "the floor is"
    floor = f"; {relation} {held_out.floor2**0.5:.1f} counts" if held_out.floor2 > 0.0 else ""
    change = f"from {held_out.before:.1f} to {held_out.after:.1f} counts, by {100 * held_out.shrink.value:.0f} %"
    if held_out.shrink.value < 0.0:
        return f"{causes} {verb} no gap: {held_out.before:.1f} counts before, {held_out.after:.1f} after{floor}"
    return f"{causes} {verb} the gap {change}{floor}"


def _describe_remaining_excess(gap: Gap, held_out: HeldOut) -> str:
    """Describe the remaining excess of held-out sessions; an empty string unless it is large enough for a further
    cause.

    A cause produces a gap of at least `SMALLEST_CAUSE` floors. The lower bound of the remaining excess must exceed the
    square of this gap.
    """
    excess = held_out.remaining_excess
    if excess.low is None or excess.low <= (SMALLEST_CAUSE * gap.floor) ** 2:
        return ""
    return f"{excess.value**0.5:.1f} counts above the floor remain in held-out sessions"


def _to_words(name: str) -> str:
    """Return the name of a cause in words, with its meaning in brackets if the cause has one."""
    plain = name.replace("_", " ")
    return f"{plain} ({MEANINGS[name]})" if name in MEANINGS else plain
