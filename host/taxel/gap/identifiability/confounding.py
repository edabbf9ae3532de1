"""Effects that look the same on some presses: what can be said of them nevertheless, and what would tell them apart."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from taxel.gap.identifiability.identify import Similarity

LADDER: Final = "force ladder: the same contact with forces from a tenth of the largest force to three times it"
ALONG_LINE: Final = "load a single taxel; compare its neighbours with distant taxels of the same TX and RX line"
RECOVERY: Final = "record one minute after a strong contact; compare the loaded taxels with unloaded ones"
TURNED: Final = "the same contact with the object rotated by 180 degrees, which inverts the sign of an offset"
TWO_SPEEDS: Final = "close slowly and quickly: a delay shifts only the onset, creep also changes the level in hold"
AFAR: Final = "hold the object a few millimetres away from the skin without contact"
WIDE_NARROW: Final = "the same force with a narrow and with a wide object"


@dataclass(frozen=True)
class Alike:
    """What two effects that look alike still tell together, and the press that would separate them."""

    combination: str
    contact: str


PAIRS: Final[Mapping[frozenset[str], Alike]] = {
    frozenset({"gain_mismatch", "stiffness"}): Alike("the slope of signal over force: gain / half_force_scale", LADDER),
    frozenset({"gain_mismatch", "saturation"}): Alike("the signal at the recorded forces", LADDER),
    frozenset({"stiffness", "saturation"}): Alike("the signal at the recorded forces", LADDER),
    frozenset({"contact_propagation", "electrode_crosstalk"}): Alike("the signal beside a contact", ALONG_LINE),
    frozenset({"contact_propagation", "proximity"}): Alike("the signal beside a contact", AFAR),
    frozenset({"electrode_crosstalk", "proximity"}): Alike("the signal beside a contact", AFAR),
    frozenset({"contact_propagation", "pose_error"}): Alike("the position of the signal in hold", TURNED),
    frozenset({"gain_mismatch", "pose_error"}): Alike("the signal of these taxels in hold", TURNED),
    frozenset({"contact_propagation", "stiffness"}): Alike("the sum of the signals of a contact", WIDE_NARROW),
    frozenset({"baseline_drift", "hysteresis"}): Alike("the signal after the release", RECOVERY),
    frozenset({"hysteresis", "latency"}): Alike("the delay of the signal", TWO_SPEEDS),
    frozenset({"gain_mismatch", "hysteresis"}): Alike("the signal in hold", TWO_SPEEDS),
    frozenset({"hysteresis", "stiffness"}): Alike("the signal in hold", TWO_SPEEDS),
}
"""What is known of pairs; of others only that they look alike."""

OTHER: Final = Alike("the features that both effects change", LADDER)


def confounded_with(
    found: Iterable[str], rivals: Mapping[str, Sequence[str]], compute_similarities: Sequence[Similarity]
) -> dict[str, list[str]]:
    """For each found effect those that cannot be told from it: that explain left-out cells as well, or that could do
    what it does.
    """
    result: dict[str, list[str]] = {}
    for name in found:
        is_confounded = [one.other for one in compute_similarities if one.name == name and one.is_confounded]
        others = list(dict.fromkeys([*rivals.get(name, ()), *is_confounded]))
        if others:
            result[name] = others
    return result


def classes(confounded: Mapping[str, Sequence[str]]) -> list[dict[str, Any]]:
    """For the report: each class with the combination that these presses do tell, and the press that separates it."""
    return [
        {
            "effects": [name, other],
            "combination": (known := PAIRS.get(frozenset({name, other}), OTHER)).combination,
            "press": known.contact,
        }
        for name, others in confounded.items()
        for other in others
    ]
