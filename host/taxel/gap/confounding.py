"""Effects that look the same on some presses: what can be said of them nevertheless, and what would tell them apart."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from taxel.gap.identify import Likeness

LADDER: Final = "the same spot with forces from a tenth of the greatest to three times it: a force ladder"
ALONG_LINE: Final = "one taxel alone; compare the taxels beside it with those far off on the same TX and RX line"
RECOVERY: Final = "nothing, for a minute after a hard press; watch the taxels that were pressed beside the others"
TURNED: Final = "the same spot with the object turned by half a turn: what an offset does changes its sign"
TWO_SPEEDS: Final = "the same spot closed slowly and quickly: a delay moves the onset, creep also the level in hold"
AFAR: Final = "nothing: bring the object to a few millimetres and hold it there without touching"
WIDE_NARROW: Final = "the same force with a narrow and with a wide object"


@dataclass(frozen=True)
class Alike:
    """What two effects that look alike still tell together, and the press that would separate them."""

    combination: str
    press: str


PAIRS: Final[Mapping[frozenset[str], Alike]] = {
    frozenset({"gain_mismatch", "stiffness"}): Alike("the slope of drop over force: gain / half_force_scale", LADDER),
    frozenset({"gain_mismatch", "saturation"}): Alike("the drop at the forces that were pressed", LADDER),
    frozenset({"stiffness", "saturation"}): Alike("the drop at the forces that were pressed", LADDER),
    frozenset({"contact_propagation", "electrode_crosstalk"}): Alike("how much taxels beside a press drop", ALONG_LINE),
    frozenset({"contact_propagation", "proximity"}): Alike("how much taxels beside a press drop", AFAR),
    frozenset({"electrode_crosstalk", "proximity"}): Alike("how much taxels beside a press drop", AFAR),
    frozenset({"contact_propagation", "pose_error"}): Alike("where the drops lie in hold", TURNED),
    frozenset({"gain_mismatch", "pose_error"}): Alike("the drops of these spots in hold", TURNED),
    frozenset({"contact_propagation", "stiffness"}): Alike("the summed drop of a press", WIDE_NARROW),
    frozenset({"baseline_drift", "hysteresis"}): Alike("the counts that are left after release", RECOVERY),
    frozenset({"hysteresis", "latency"}): Alike("how late the drop comes", TWO_SPEEDS),
    frozenset({"gain_mismatch", "hysteresis"}): Alike("the drop in hold", TWO_SPEEDS),
    frozenset({"hysteresis", "stiffness"}): Alike("the drop in hold", TWO_SPEEDS),
}
"""What is known of pairs; of others only that they look alike."""

OTHER: Final = Alike("the features that both of them move", LADDER)


def confounded_with(
    found: Iterable[str], rivals: Mapping[str, Sequence[str]], likenesses: Sequence[Likeness]
) -> dict[str, list[str]]:
    """For each found effect those that cannot be told from it: that explain left-out cells as well, or that could do
    what it does.
    """
    result: dict[str, list[str]] = {}
    for name in found:
        alike = [one.other for one in likenesses if one.name == name and one.alike]
        others = list(dict.fromkeys([*rivals.get(name, ()), *alike]))
        if others:
            result[name] = others
    return result


def classes(confounded: Mapping[str, Sequence[str]]) -> list[dict[str, Any]]:
    """For the report: each class with the combination that these presses do tell, and the press that separates it."""
    return [
        {
            "effects": [name, other],
            "combination": (known := PAIRS.get(frozenset({name, other}), OTHER)).combination,
            "press": known.press,
        }
        for name, others in confounded.items()
        for other in others
    ]
