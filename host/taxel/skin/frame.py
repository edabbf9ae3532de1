"""Raw counts of a whole skin."""

from typing import NamedTuple

from taxel.types import BoolArray, CountArray


class SkinFrame(NamedTuple):
    """Raw counts of the whole skin in one poll cycle.

    cycle: number of the hub's poll cycle. time_s: start of the first board's scan, seconds of the host clock.
    raw_counts: u16[n] in the hand's taxel order, 0 where `valid` is False. valid: bool[n], True where the frame of the
    taxel's board arrived.
    """

    cycle: int
    time_s: float
    raw_counts: CountArray
    valid: BoolArray
