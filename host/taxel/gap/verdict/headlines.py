"""Headlines: the difference in one sentence of at most twelve words, without the terms of the diagnosis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from taxel.gap.calibration.calibration import UNKNOWN

MAX_WORDS: Final = 12
"""Largest number of words of a headline (rule of the gap report, version 2)."""

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
"""Headline of each single cause. The names in braces are replaced by `Sides.fill`."""

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
"""Predicate of the skin for each effect. At most three words, so that two predicates fit into one headline."""

CERTAIN: Final = 0.8
"""Probability from which a headline states a cause without "probably". Chosen: below it, more than one statement in
five can be wrong."""

OTHER_PREDICATE: Final = "has another effect"
"""Predicate of an effect of a plug-in whose name has more than two words and would make the headline too long."""


@dataclass(frozen=True)
class Sides:
    """Words for the two datasets in a sentence.

    real, sim: the real and the simulated dataset. skin, rest: the same in at most two words, for headlines with
    predicates.
    """

    real: str = "the real skin"
    sim: str = "the simulator"
    skin: str = "the skin"
    rest: str = "the simulator"

    def fill(self, text: str) -> str:
        """Replace `{real}`, `{Real}` (capitalised) and `{sim}` in a text."""
        return text.format(real=self.real, Real=self.real.capitalize(), sim=self.sim)


REAL_AND_SIMULATED: Final = Sides()
"""Words for a real and a simulated dataset."""

TWO_REAL: Final = Sides("the first sensor", "the second", "sensor 1", "sensor 2")
"""Words for two real datasets."""


def make_headline(
    known: Sequence[str],
    sides: Sides,
    is_partial: bool = False,
    is_tentative: bool = False,
    probability: float = 1.0,
) -> str:
    """Return the headline of named effects.

    known: names of the effects, most probable first. sides: words for the two datasets. is_partial: whether a part of
    the difference remains unexplained. is_tentative: whether too few sessions were recorded for a verdict. probability:
    probability of the least probable named effect.
    """
    if is_tentative:
        return f"Few sessions: {sides.skin} probably {' and '.join(map(_get_predicate, known[:2]))}."
    if probability < CERTAIN:
        predicates = " and ".join(map(_get_predicate, known[:2]))
        return f"Probably {sides.skin} {predicates}{'; more remains' if is_partial or len(known) > 2 else ''}."
    if len(known) == 1 and not is_partial:
        return sides.fill(HEADLINES.get(known[0]) or _make_plugin_template(known[0]))
    if len(known) == 1:
        return f"Unlike {sides.rest}, {sides.skin} {_get_predicate(known[0])}; more remains unexplained."
    if len(known) == 2 and is_partial:
        return f"{sides.skin.capitalize()} {' and '.join(map(_get_predicate, known))}; more remains unexplained."
    if len(known) == 2:
        return f"Unlike {sides.rest}, {sides.skin} {' and '.join(map(_get_predicate, known))}."
    return f"Unlike {sides.rest}, {sides.skin} {_get_predicate(known[0])}; {len(known) - 1} more effects act."


def make_either_headline(first: str, second: str, sides: Sides) -> str:
    """Return the headline of two effects that the recorded contacts do not distinguish."""
    return f"{sides.skin.capitalize()} {_get_predicate(first)} or {_get_predicate(second)}; another contact decides."


def make_weak_headline(name: str, sides: Sides) -> str:
    """Return the headline of a gap whose most probable effect has too little evidence to be named."""
    return f"Perhaps {sides.skin} {_get_predicate(name)}; the evidence is weak."


def make_open_headline(sides: Sides) -> str:
    """Return the headline if no gap has a probability below one half and no cause is more probable."""
    return f"It is open whether {sides.real} and {sides.sim} differ."


def _get_predicate(name: str) -> str:
    """Return the predicate of an effect. An effect of a plug-in has "has" and its name, or `OTHER_PREDICATE` if the
    name has more than two words.
    """
    words = name.replace("_", " ")
    default = f"has {words}" if len(words.split()) <= 2 else OTHER_PREDICATE
    return PREDICATES.get(name, default)


def _make_plugin_template(name: str) -> str:
    """Return the headline template of an effect of a plug-in, without its name if the name has more than four words.

    Braces in the name are replaced, because they would be fields of the template.
    """
    words = name.replace("_", " ").replace("{", "(").replace("}", ")")
    return f"{{Real}} has {words}; {{sim}} does not." if len(words.split()) <= 4 else "{Real} has another effect."
