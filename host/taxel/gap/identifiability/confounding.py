"""Confounded effects: the combination of their parameters that is identifiable, and the contact that separates them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from taxel.gap.identifiability.identify import Similarity

FORCE_LADDER: Final = "force ladder: the same contact with forces from a tenth of the largest force to three times it"
SINGLE_TAXEL: Final = "load a single taxel; compare its neighbours with distant taxels of the same TX and RX line"
LONG_RECOVERY: Final = "record one minute after a strong contact; compare the loaded taxels with unloaded ones"
ROTATED_OBJECT: Final = "the same contact with the object rotated by 180 degrees, which inverts the sign of an offset"
TWO_SPEEDS: Final = "close slowly and quickly: a delay shifts only the onset, creep also changes the level in hold"
HOVERING_OBJECT: Final = "hold the object a few millimetres away from the skin without contact"
NARROW_AND_WIDE_OBJECT: Final = "the same force with a narrow and with a wide object"


@dataclass(frozen=True)
class ConfoundedPair:
    """Identifiable combination of two confounded effects, and the contact that would separate them, as report texts."""

    combination: str
    contact: str


CONFOUNDED_PAIRS: Final[Mapping[frozenset[str], ConfoundedPair]] = {
    frozenset({"gain_mismatch", "stiffness"}): ConfoundedPair(
        "the slope of signal over force: gain / half_force_scale", FORCE_LADDER
    ),
    frozenset({"gain_mismatch", "saturation"}): ConfoundedPair("the signal at the recorded forces", FORCE_LADDER),
    frozenset({"stiffness", "saturation"}): ConfoundedPair("the signal at the recorded forces", FORCE_LADDER),
    frozenset({"contact_propagation", "electrode_crosstalk"}): ConfoundedPair(
        "the signal beside a contact", SINGLE_TAXEL
    ),
    frozenset({"contact_propagation", "proximity"}): ConfoundedPair("the signal beside a contact", HOVERING_OBJECT),
    frozenset({"electrode_crosstalk", "proximity"}): ConfoundedPair("the signal beside a contact", HOVERING_OBJECT),
    frozenset({"contact_propagation", "pose_error"}): ConfoundedPair(
        "the position of the signal in hold", ROTATED_OBJECT
    ),
    frozenset({"gain_mismatch", "pose_error"}): ConfoundedPair("the signal of these taxels in hold", ROTATED_OBJECT),
    frozenset({"contact_propagation", "stiffness"}): ConfoundedPair(
        "the sum of the signals of a contact", NARROW_AND_WIDE_OBJECT
    ),
    frozenset({"baseline_drift", "hysteresis"}): ConfoundedPair("the signal after the release", LONG_RECOVERY),
    frozenset({"hysteresis", "latency"}): ConfoundedPair("the delay of the signal", TWO_SPEEDS),
    frozenset({"gain_mismatch", "hysteresis"}): ConfoundedPair("the signal in hold", TWO_SPEEDS),
    frozenset({"hysteresis", "stiffness"}): ConfoundedPair("the signal in hold", TWO_SPEEDS),
}
"""Entries for pairs of effects of the catalogue; `UNLISTED_PAIR` applies to every other pair."""

UNLISTED_PAIR: Final = ConfoundedPair("the features that both effects change", FORCE_LADDER)


def find_confounded_effects(
    named_effects: Iterable[str], rivals: Mapping[str, Sequence[str]], similarities: Sequence[Similarity]
) -> dict[str, list[str]]:
    """Return the confounded effects of each named effect; named effects without confounded effects are omitted.

    An effect is confounded with a named effect if it predicts the held-out features almost as well (a rival), or if the
    two are not distinguishable on the recorded contacts (by their similarity). rivals: rivals of each named effect,
    from the comparison. similarities: from `identify.compute_similarities`.
    """
    result: dict[str, list[str]] = {}
    for name in named_effects:
        confounded_others = [
            similarity.other for similarity in similarities if similarity.name == name and similarity.is_confounded
        ]
        others = list(dict.fromkeys([*rivals.get(name, ()), *confounded_others]))
        if others:
            result[name] = others
    return result


def list_confounded_classes(confounded: Mapping[str, Sequence[str]]) -> list[dict[str, Any]]:
    """Return one report entry for each pair of confounded effects (effects that the recorded contacts do not separate).

    An entry states the two effects, the combination of their parameters that is identifiable from the recorded
    contacts, and a contact (`press`) that would separate the effects. confounded: for each named effect, the effects
    that are confounded with it, from `find_confounded_effects`.
    """
    return [
        {
            "effects": [name, other],
            "combination": (pair := CONFOUNDED_PAIRS.get(frozenset({name, other}), UNLISTED_PAIR)).combination,
            "press": pair.contact,
        }
        for name, others in confounded.items()
        for other in others
    ]
