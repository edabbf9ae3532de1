"""The verdict: status, causes, headline and reasons, derived from the probabilities of the comparison."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Final

from taxel.gap.calibration.calibration import LISTED, NO_GAP, SMALLEST_CAUSE, UNKNOWN
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

LEAST_SESSIONS: Final = 3
"""Sessions below which no variance between sessions, and so no certainty, is known."""

WORDS: Final = {
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
"""Meaning of each cause; an effect of a plug-in has none."""


@dataclass(frozen=True)
class Verdict:
    """A verdict; see the gap report for the fields.

    rivals: effects that are not named and predict almost as well, by the named effect, or the most probable one, that
    they may replace.
    """

    status: str
    effects: tuple[str, ...]
    probabilities: Mapping[str, float]
    headline: str
    one_line: str
    reasons: tuple[str, ...] = ()
    rivals: Mapping[str, Sequence[str]] = field(default_factory=dict)


NO_CAUSE_NAMED: Final = "no cause has a probability of 0.5 or more"


def list_causes(probabilities: Mapping[str, float]) -> tuple[str, ...]:
    """Causes with a probability of at least `LISTED`, most probable first, an unknown cause last.

    ["unknown"] if there are none and no gap has a probability below `LISTED`.
    """
    causes = sorted((name for name in probabilities if name != NO_GAP), key=lambda name: -probabilities[name])
    names = [name for name in causes if probabilities[name] >= LISTED]
    if not names and probabilities[NO_GAP] < LISTED:
        return (UNKNOWN,)
    return tuple(sorted(names, key=lambda name: name == UNKNOWN))


def list_questioned(probabilities: Mapping[str, float]) -> tuple[str, ...]:
    """Effects whose rivals matter: the named ones, or else the most probable one."""
    known = tuple(name for name in list_causes(probabilities) if name != UNKNOWN)
    others = [name for name in probabilities if name not in (NO_GAP, UNKNOWN)]
    return known or tuple(sorted(others, key=lambda name: -probabilities[name])[:1])


def judge_verdict(
    gap: Gap,
    probabilities: Mapping[str, float],
    held: HeldOut,
    rivals: Mapping[str, Sequence[str]] = MappingProxyType({}),
    warnings: Sequence[str] = (),
    sides: Sides = REAL_AND_SIMULATED,
) -> Verdict:
    """Derive the verdict.

    probabilities: of every cause and of no gap. held: the gap of held-out sessions with the named effects. rivals: by
    effect of `list_questioned`, the effects that may replace it. warnings: reasons for doubt that other parts of the
    diagnosis found, one sentence each. sides: words for the two datasets.
    """
    effects = list_causes(probabilities)
    known = tuple(name for name in effects if name != UNKNOWN)
    own = {name: tuple(other for other in others if other not in known) for name, others in rivals.items()}
    rivals = {name: others for name, others in own.items() if others}
    reasons = list(warnings)
    is_tentative = held.sessions < LEAST_SESSIONS
    if is_tentative:
        reasons.insert(0, f"too few sessions for a verdict: {held.sessions} recorded, needs {LEAST_SESSIONS}")
    if not effects and not is_tentative:
        bound = f"is smaller than {max(gap.most, 0.0) ** 0.5:.1f} counts with a probability of 95 %"
        line = f"No gap: the difference is {describe_size(held)}; the part above the floor {bound}."
        headline = f"{sides.sim.capitalize()} agrees with {sides.real}."
        return Verdict("no_gap", (), probabilities, headline, line, tuple(reasons))
    if not effects or (is_tentative and not known):
        line = f"Unknown: the difference is {describe_size(held)}; {reasons[0]}."
        headline = f"Too few sessions for a verdict: record {LEAST_SESSIONS} or more."
        return Verdict(UNKNOWN, (UNKNOWN,), probabilities, headline, line, tuple(reasons))
    if not known:
        return _judge_unknown(held, probabilities, rivals, reasons, sides)
    remains = _describe_remaining_excess(gap, held)
    has_more = UNKNOWN in effects or bool(remains)
    if UNKNOWN in effects:
        percent = f"{100 * probabilities[UNKNOWN]:.0f} %"
        reasons.append(f"a cause outside the catalogue is present with a probability of {percent}")
    if remains:
        reasons.append(remains)
    status = "partly_explained" if has_more or is_tentative else "explained"
    least = min(probabilities[name] for name in known)
    headline = make_headline(known, sides, has_more, is_tentative, least)
    line = f"{'Partly explained' if status == 'partly_explained' else 'Explained'}: {_describe_shrink(held, known)}"
    if UNKNOWN in effects:
        line += "; the cause of the remaining gap is unknown"
    elif is_tentative or remains:
        line += f"; {reasons[0] if is_tentative else remains}"
    return Verdict(status, effects, probabilities, headline, f"{line}.", tuple(reasons), rivals)


def _judge_unknown(
    held: HeldOut,
    probabilities: Mapping[str, float],
    rivals: Mapping[str, Sequence[str]],
    reasons: list[str],
    sides: Sides,
) -> Verdict:
    """The verdict of a gap without a named effect. reasons: the other reasons for doubt."""
    size, headline = describe_size(held), sides.fill(HEADLINES[UNKNOWN])
    line = f"Unknown: the gap is {size}; no effect of the catalogue explains the gap."
    if not set(probabilities) - {UNKNOWN, NO_GAP}:
        line = f"Unknown: the gap is {size}; no effect of the catalogue was tried."
    elif rivals and probabilities.get(UNKNOWN, 0.0) < LISTED:
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


def describe_size(held: HeldOut) -> str:
    """The gap and the floor of held-out sessions; without repeats and with one session the floor is not measured."""
    floor = f"floor {held.floor2**0.5:.1f}" if held.floor2 > 0.0 else "floor not measured"
    return f"{held.before:.1f} counts ({floor})"


def _describe_shrink(held: HeldOut, known: Sequence[str]) -> str:
    """What the named effects change in held-out sessions."""
    causes = " and ".join(_to_words(name) for name in known)
    verb = "reduces" if len(known) == 1 else "reduce"
    is_at_floor = held.left2.low is None or held.left2.low <= 0.0
    relation = "the rest agrees with the floor of" if is_at_floor else "the floor is"
    floor = f"; {relation} {held.floor2**0.5:.1f} counts" if held.floor2 > 0.0 else ""
    change = f"from {held.before:.1f} to {held.after:.1f} counts, by {100 * held.shrink.value:.0f} %"
    if held.shrink.value < 0.0:
        return f"{causes} {verb} no gap: {held.before:.1f} counts before, {held.after:.1f} after{floor}"
    return f"{causes} {verb} the gap {change}{floor}"


def _describe_remaining_excess(gap: Gap, held: HeldOut) -> str:
    """A sentence on what the named effects leave; "" unless the remaining excess is that of a further cause.

    A cause produces at least `SMALLEST_CAUSE` floors: the lower bound of the remaining excess must exceed this gap.
    """
    left = held.left2
    if left.low is None or left.low <= (SMALLEST_CAUSE * gap.floor) ** 2:
        return ""
    return f"{left.value**0.5:.1f} counts above the floor remain in held-out sessions"


def _to_words(name: str) -> str:
    """Name and meaning of a cause."""
    plain = name.replace("_", " ")
    return f"{plain} ({WORDS[name]})" if name in WORDS else plain
