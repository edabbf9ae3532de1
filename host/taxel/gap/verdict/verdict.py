"""The verdict: status, causes, headline and reasons, derived from the probabilities of the comparison."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Final

from taxel.gap.calibration.calibration import LISTED, NO_GAP, SMALLEST_CAUSE, UNKNOWN
from taxel.gap.features.metric import Gap
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

HEADLINES: Final = {
    "contact_propagation": "{Real} spreads pressure sideways; {sim} does not.",
    "electrode_crosstalk": "Electrodes couple taxels in {real}, not in {sim}.",
    "noise": "{Real} is noisier than {sim}.",
    "gain_mismatch": "Some taxels are more or less sensitive than in {sim}.",
    "stiffness": "{Real} is softer or harder than in {sim}.",
    "nonlinearity": "{Real} follows another load curve than {sim}.",
    "baseline_drift": "{Real} drifts without contact; {sim} does not.",
    "hysteresis": "{Real} creeps and recovers slowly; {sim} does not.",
    "saturation": "{Real} saturates at high force; {sim} does not.",
    "proximity": "{Real} responds before contact; {sim} does not.",
    "dropout": "Parts of {real} do not respond.",
    "pose_error": "An object or bracket is not where {sim} places it.",
    "latency": "Some boards of {real} lag behind {sim}.",
    UNKNOWN: "The two differ; no effect of the catalogue explains the difference.",
}
"""One sentence of at most twelve words for a single cause; {real}, {Real} and {sim} are the words of `Sides`."""


@dataclass(frozen=True)
class Sides:
    """Words for the two datasets, within a sentence."""

    real: str = "the real skin"
    sim: str = "the simulator"

    def fill(self, text: str) -> str:
        """A sentence with these words."""
        return text.format(real=self.real, Real=self.real.capitalize(), sim=self.sim)


REAL_AND_SIMULATED: Final = Sides()

TWO_REAL: Final = Sides("the first sensor", "the second sensor")


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
    few = held.sessions < LEAST_SESSIONS
    size = f"{gap.gap.value:.1f} counts (floor {gap.floor:.1f})"
    reasons = list(warnings)
    if few:
        reasons.insert(0, f"too few sessions for a verdict: {held.sessions} recorded, needs {LEAST_SESSIONS}")
    if not effects and not few:
        bound = f"smaller than {max(gap.most, 0.0) ** 0.5:.1f} counts with a probability of 95 %"
        line = f"No gap: {size}; the part above the floor is {bound}."
        return Verdict(
            "no_gap", (), probabilities, f"{sides.sim.capitalize()} agrees with {sides.real}.", line, tuple(reasons)
        )
    if not effects or (few and not known):
        line = f"Unknown: {size}; {reasons[0]}."
        headline = f"Too few sessions for a verdict: record {LEAST_SESSIONS} or more."
        return Verdict(UNKNOWN, (UNKNOWN,), probabilities, headline, line, tuple(reasons))
    if not known:
        line, headline = f"Unknown: a gap of {size} that no effect of the catalogue explains.", HEADLINES[UNKNOWN]
        if not set(probabilities) - {UNKNOWN, NO_GAP}:
            line = f"Unknown: a gap of {size}; no effect of the catalogue was tried."
        elif rivals and probabilities.get(UNKNOWN, 0.0) < LISTED:
            first = next(iter(rivals))
            either = f"{_to_words(first)} or {_to_words(rivals[first][0])}"
            line = f"Unknown: a gap of {size}; the most probable causes are {either}."
            headline = f"Either {_to_plain(first)} or {_to_plain(rivals[first][0])}; another contact separates the two."
            reasons.append("no cause has a probability of 0.5 or more")
        return Verdict(UNKNOWN, (UNKNOWN,), probabilities, headline, line, tuple(reasons), rivals)
    said = "; ".join(f"{_to_words(name)}, {100 * probabilities[name]:.0f} %" for name in known)
    line = f"a gap of {size}, reduced by {100 * held.shrink.value:.0f} % with {said}"
    headline = _make_headline(known, sides)
    if UNKNOWN in effects:
        percent = f"{100 * probabilities[UNKNOWN]:.0f} %"
        reasons.append(f"a cause outside the catalogue is present with a probability of {percent}")
    remains = _describe_remaining_excess(gap, held)
    if remains:
        reasons.append(remains)
    status = "partly_explained" if UNKNOWN in effects or few or remains else "explained"
    start = "Partly explained" if status == "partly_explained" else "Explained"
    if UNKNOWN in effects:
        end = "; the cause of the remaining gap is unknown"
    else:
        end = f"; {reasons[0]}" if few else f"; {remains}" if remains else ""
    return Verdict(status, effects, probabilities, headline, f"{start}: {line}{end}.", tuple(reasons), rivals)


def _describe_remaining_excess(gap: Gap, held: HeldOut) -> str:
    """A sentence on what the named effects leave; "" unless the remaining excess is that of a further cause.

    A cause produces at least `SMALLEST_CAUSE` floors: the lower bound of the remaining excess must exceed this gap.
    """
    left = held.left2
    if left.low is None or left.low <= (SMALLEST_CAUSE * gap.floor) ** 2:
        return ""
    return f"{left.value**0.5:.1f} counts above the floor remain in held-out sessions"


def _make_headline(known: Sequence[str], sides: Sides) -> str:
    """At most twelve words for one or several named effects."""
    if len(known) == 1:
        return sides.fill(HEADLINES.get(known[0], f"{{Real}} has {_to_plain(known[0])}; {{sim}} does not."))
    names = [_to_plain(name) for name in known[:3]]
    return f"{sides.sim.capitalize()} lacks {', '.join(names[:-1])} and {names[-1]}."


def _to_plain(name: str) -> str:
    return name.replace("_", " ")


def _to_words(name: str) -> str:
    """Name and meaning of a cause."""
    return f"{_to_plain(name)} ({WORDS[name]})" if name in WORDS else _to_plain(name)
