"""The effects of the original programs that the thesis did not model, and the combinations that are measured."""

from dataclasses import dataclass, fields, replace
from types import MappingProxyType
from typing import Final


@dataclass(frozen=True)
class OwnEffects:
    """Effects that are switched on. The default switches all of them off.

    Attributes:
        coded_host: the host places the taxels of the real hand at the coded centres (fingers turned by 5 degrees).
        coded_simulation: the simulation places (and activates) its taxels at the coded centres.
        mask: the host of the hardware ignores 117 taxels at the sides of the fingers; the simulation does not.
        back_boards: taxels of the backs of the fingers are used, at the origin of their bracket, on both sides.
        stale_contacts: the contact plug-in of the simulation never clears the contact points of a board.
        tuned_poses: the simulation uses tool poses that were tuned by hand; off: those of the hardware.
        rises: a rise of the count by at least 150 activates a taxel of the real hand as well as a decrease.
    """

    coded_host: bool = False
    coded_simulation: bool = False
    mask: bool = False
    back_boards: bool = False
    stale_contacts: bool = False
    tuned_poses: bool = False
    rises: bool = False


NO_EFFECTS: Final = OwnEffects()

CODED_BOTH: Final = "coded_centres"
"""Name of the two effects of the coded centres together, as in the original programs."""

GROUPS: Final = MappingProxyType(
    {**{item.name: (item.name,) for item in fields(OwnEffects)}, CODED_BOTH: ("coded_host", "coded_simulation")}
)
"""Groups of effects that are switched together, by the name of their row in the table of shares: each effect alone, and
the coded centres on both sides."""

LAYER_GROUPS: Final = tuple(name for name in GROUPS if name != "stale_contacts")
"""Groups for the simulator with an elastic layer, which has no contact messages and therefore no stale contacts."""


def switch(effects: OwnEffects, group: str, is_on: bool) -> OwnEffects:
    """Return the effects with one group of `GROUPS` switched on or off."""
    return replace(effects, **dict.fromkeys(GROUPS[group], is_on))


def combine(groups: tuple[str, ...]) -> OwnEffects:
    """Return the effects with the named groups switched on and all others switched off."""
    effects = NO_EFFECTS
    for group in groups:
        effects = switch(effects, group, True)
    return effects
