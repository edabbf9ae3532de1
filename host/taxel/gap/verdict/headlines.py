"""Headlines: what differs, in one sentence of at most twelve words, for readers who know neither floor nor effect."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from taxel.gap.calibration.calibration import UNKNOWN

MOST_WORDS: Final = 12
"""Words of a headline (gap report, version 2)."""

HEADLINES: Final = {
    "contact_propagation": "{Real} spreads pressure sideways; {sim} does not.",
    "electrode_crosstalk": "In {real}, electrodes influence each other; not in {sim}.",
    "noise": "{Real} is noisier than {sim}.",
    "gain_mismatch": "{Real} is unevenly sensitive; {sim} is not.",
    "stiffness": "{Real} is softer or harder than {sim} assumes.",
    "nonlinearity": "{Real} answers force by another curve than {sim}.",
    "baseline_drift": "{Real} drifts without contact; {sim} does not.",
    "hysteresis": "{Real} recovers slowly after contact; {sim} does not.",
    "saturation": "{Real} saturates at high force; {sim} does not.",
    "proximity": "{Real} responds before contact; {sim} does not.",
    "dropout": "Parts of {real} do not respond.",
    "pose_error": "An object or bracket is not where {sim} places it.",
    "latency": "Parts of {real} lag behind {sim}.",
    UNKNOWN: "{Real} and {sim} differ; no known cause explains it.",
}
"""The sentence of a single cause; the names in braces are the fields of `Sides`."""

PREDICATES: Final = {
    "contact_propagation": "spreads pressure sideways",
    "electrode_crosstalk": "couples its electrodes",
    "noise": "is noisier",
    "gain_mismatch": "is unevenly sensitive",
    "stiffness": "differs in stiffness",
    "nonlinearity": "follows another curve",
    "baseline_drift": "drifts without contact",
    "hysteresis": "recovers slowly",
    "saturation": "saturates earlier",
    "proximity": "responds before contact",
    "dropout": "has dead parts",
    "pose_error": "is positioned differently",
    "latency": "lags behind",
}
"""What the skin does under each effect: at most three words, so that two of them fit into one headline."""

CERTAIN: Final = 0.8
"""Probability from which a headline states a cause without "probably": one statement in five may be wrong below it."""

OTHER_PREDICATE: Final = "has another effect"
"""The predicate of an effect of a plug-in whose name has more words than a headline has room for."""


@dataclass(frozen=True)
class Sides:
    """Words for the two datasets within a sentence.

    skin, rest: the same as `real` and `sim` in at most two words, for headlines of two effects.
    """

    real: str = "the real skin"
    sim: str = "the simulator"
    skin: str = "the skin"
    rest: str = "the simulator"

    def fill(self, text: str) -> str:
        """A sentence with these words."""
        return text.format(real=self.real, Real=self.real.capitalize(), sim=self.sim)


REAL_AND_SIMULATED: Final = Sides()

TWO_REAL: Final = Sides("the first sensor", "the second", "sensor 1", "sensor 2")


def make_headline(
    known: Sequence[str],
    sides: Sides,
    is_partial: bool = False,
    is_tentative: bool = False,
    probability: float = 1.0,
) -> str:
    """The headline of named effects, most probable first.

    is_partial: whether a part of the difference remains unexplained. is_tentative: whether too few sessions were
    recorded for a verdict. probability: of the least probable of the named effects.
    """
    if is_tentative:
        return f"Few sessions: {sides.skin} probably {' and '.join(map(_predicate, known[:2]))}."
    if probability < CERTAIN:
        what = " and ".join(map(_predicate, known[:2]))
        return f"Probably {sides.skin} {what}{'; more remains' if is_partial or len(known) > 2 else ''}."
    if len(known) == 1 and not is_partial:
        return sides.fill(HEADLINES.get(known[0]) or _single_custom(known[0]))
    if len(known) == 1:
        return f"Unlike {sides.rest}, {sides.skin} {_predicate(known[0])}; more remains unexplained."
    if len(known) == 2 and is_partial:
        return f"{sides.skin.capitalize()} {' and '.join(map(_predicate, known))}; more remains unexplained."
    if len(known) == 2:
        return f"Unlike {sides.rest}, {sides.skin} {' and '.join(map(_predicate, known))}."
    return f"Unlike {sides.rest}, {sides.skin} {_predicate(known[0])}; {len(known) - 1} more effects act."


def make_either_headline(first: str, second: str, sides: Sides) -> str:
    """The headline of two effects between which the recorded contacts do not decide."""
    return f"{sides.skin.capitalize()} {_predicate(first)} or {_predicate(second)}; another contact decides."


def make_weak_headline(name: str, sides: Sides) -> str:
    """The headline of a gap whose most probable cause is an effect without enough evidence to be named."""
    return f"Perhaps {sides.skin} {_predicate(name)}; the evidence is weak."


def make_open_headline(sides: Sides) -> str:
    """The headline of two datasets that agree with a probability below one half, though nothing is more probable."""
    return f"It is open whether {sides.real} and {sides.sim} differ."


def _predicate(name: str) -> str:
    words = name.replace("_", " ")
    own = f"has {words}" if len(words.split()) <= 2 else OTHER_PREDICATE
    return PREDICATES.get(name, own)


def _single_custom(name: str) -> str:
    """The template for an effect of a plug-in; braces in its name are no fields."""
    words = name.replace("_", " ").replace("{", "(").replace("}", ")")
    return f"{{Real}} has {words}; {{sim}} does not." if len(words.split()) <= 4 else "{Real} has another effect."
