"""Taxel centres as the original programs contain them ("coded" centres).

The coded centres of the kinds proximal_front, medial_front and fingertip are the true centres turned by 5 degrees about
the y axis of their link, 2.1 to 2.9 mm apart on average; those of the palm differ at seven taxels. Some boards have no
coded centres. Source: the public repository abed-almrad/BICI_SENSORS_ROS (2023), tools/hand/original.
"""

import csv
from enum import Enum
from functools import lru_cache
from importlib import resources
from typing import Final

import numpy as np

from taxel.errors import TaxelError
from taxel.hand.description import Hand
from taxel.types import FloatArray


class PluginCoordinates(Enum):
    """Coordinates of a board's taxels in the contact plug-in of the original simulator."""

    CODED = "coded"
    ORIGIN = "at the origin of the bracket"
    NONE = "none"


_CODED: Final = (0x08, 0x0C, 0x0D, 0x15, 0x18, 0x19, 0x1C, 0x1D)
_AT_ORIGIN: Final = (0x09, 0x0A, 0x0E, 0x0F, 0x11, 0x13, 0x1A, 0x1B)
_NOT_LISTED: Final = (0x0B, 0x10, 0x12, 0x14, 0x16, 0x17)
PLUGIN_COORDINATES: Final = {
    **dict.fromkeys(_CODED, PluginCoordinates.CODED),
    **dict.fromkeys(_AT_ORIGIN, PluginCoordinates.ORIGIN),
    **dict.fromkeys(_NOT_LISTED, PluginCoordinates.NONE),
}
"""Coordinates in the contact plug-in by board address.

Coded: palm, three proximal and three medial fronts, fingertip of the index finger (463 taxels). At the origin: backs of
proximal and medial links, medial boards of the thumb. Not listed: back of the hand, the other fingertips, proximal
boards of the thumb.
"""

_HANDS: Final = ("original", "original_complete")


class NoCodedCentresError(TaxelError, ValueError):
    """The hand is not the original hand, to which the numbers of the original programs refer."""

    def __init__(self, hand: str) -> None:
        """Create the error of a hand without coded centres. hand: its name."""
        super().__init__(hand)

    def _format_message(self) -> str:
        """Format the error as one line with the name of the hand."""
        return (
            f"hand '{self.args[0]}': expected {' or '.join(_HANDS)}, because the original programs contain only the "
            "taxel centres of that hand; choose that hand, or switch coded centres off"
        )


@lru_cache(maxsize=1)
def _read_coded_centres() -> dict[str, FloatArray]:
    """Read the packaged table: centres f64[n, 3], metres, bracket frame, by kind of board."""
    rows: dict[str, list[list[float]]] = {}
    with resources.files(__package__).joinpath("coded_centres.csv").open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            rows.setdefault(row["kind"], []).append([float(row[f"{axis}_m"]) for axis in "xyz"])
    return {kind: np.array(values) for kind, values in rows.items()}


def load_coded_centres(hand: Hand) -> FloatArray:
    """Load the taxel centres of the original host, f64[n, 3], metres, in the frames of the brackets; NaN: no centre.

    The host contains the centres of palm, back of the hand, proximal and medial fronts, and fingertips. Raises
    NoCodedCentresError for a hand other than the original hand.
    """
    if hand.name not in _HANDS:
        raise NoCodedCentresError(hand.name)
    centres, table = np.full((hand.n_taxels, 3), np.nan), _read_coded_centres()
    for board in hand.boards:
        if board.kind.name in table:
            centres[hand.get_slice(board.address)] = table[board.kind.name]
    return centres


def get_plugin_coordinates(hand: Hand) -> list[PluginCoordinates]:
    """Return which coordinates the contact plug-in of the thesis author's simulator has for the taxels of each board.

    The result is in the order of `hand.boards`: coded centres, the origin of the bracket, or none. Raises
    NoCodedCentresError for a hand other than the original hand.
    """
    if hand.name not in _HANDS:
        raise NoCodedCentresError(hand.name)
    return [PLUGIN_COORDINATES[board.address] for board in hand.boards]
