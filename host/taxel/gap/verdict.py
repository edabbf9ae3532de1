"""From numbers to a verdict: no gap, explained, partly explained, or unknown."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from taxel.gap.metric import Gap
from taxel.gap.select import Selection

MARGIN_FLOORS: Final = 3.0
"""An excess of at most three squared floors is no gap: the gap is then at most twice the floor. A simulator of another
hand's contact is never exact; below this what is wrong cannot be told from what scatters."""

SIGNIFICANT: Final = 0.02
"""P-value of an excess from which on it may be chance."""

NAMED: Final = 0.5
"""Share of the score that the found effects must explain together to be believed; below it the cause is unknown."""

EXPLAINED: Final = 0.72
"""And to leave nothing worth a name."""

WORDS: Final = {
    "contact_propagation": "pressure spreads sideways before it is measured",
    "electrode_crosstalk": "taxels on a common electrode disturb each other",
    "noise": "the hand is noisier",
    "gain_mismatch": "taxels or boards are more or less sensitive than modelled",
    "stiffness": "the dielectric is softer or harder than modelled",
    "baseline_drift": "the no-contact count wanders",
    "hysteresis": "the layer creeps and recovers late",
    "saturation": "the count stops falling at high force",
    "proximity": "the fringe field answers before contact",
    "dropout": "taxels, lines or boards do not answer",
    "pose_error": "an object or a bracket is not where the model has it",
    "latency": "boards lag the hand",
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
    gap: Gap, selection: Selection, shrink: float, reducible: float | None, simulated2: float = 0.0
) -> Verdict:
    """shrink, reducible: of the gap in counts on sessions that were left out, and of what lies above its floor.
    simulated2: counts^2 by which the other side's means scatter, where it has sessions as well.
    """
    margin = MARGIN_FLOORS * (gap.floor**2 + simulated2)
    names, explained = selection.names, max(selection.explained, reducible or 0.0)
    # Few sessions bound an excess loosely: one that is small and may well be chance is none either.
    within = gap.most <= margin or (gap.p_value > SIGNIFICANT and gap.excess.value <= 0.5 * margin)
    local = "dropout" in names
    if within and not local and (not names or explained < NAMED or gap.excess.value <= margin / 3.0):
        line = f"No gap: {gap.gap.value:.1f} counts where repeats and sessions alone make {gap.floor:.1f}."
        return Verdict("no_gap", (), line, margin)
    size = f"a gap of {gap.gap.value:.1f} counts (floor {gap.floor:.1f})"
    if not names or (explained < NAMED and not local):
        return Verdict("unknown", ("unknown",), f"Unknown: {size} that no effect of the catalogue explains.", margin)
    said = "; ".join(f"{name.replace('_', ' ')} ({WORDS[name]})" for name in names)
    if explained < EXPLAINED and not within:
        line = f"Partly explained: {size}, {100 * shrink:.0f} % less with {said}; the rest is unknown."
        return Verdict("partly_explained", (*names, "unknown"), line, margin)
    return Verdict("explained", names, f"Explained: {size}, {100 * shrink:.0f} % less with {said}.", margin)
