"""What was lost, where, and how that is known."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel.stream.decoder import ADDRESSES, StreamDecoder


class BoardCount(NamedTuple):
    """One board's frames.

    `received`: whole ones; `missing`: poll cycles without one, between two that brought one, in which the board had a
    newer scan to show; `damaged`: the board's own CRC was wrong, so that they were not used.
    """

    received: int
    missing: int
    damaged: int


class LossAccount:
    """What a decoder has counted so far; always up to date.

    Every frame that the hub puts onto the wire carries the next of 65,536 sequence numbers, so `lost_on_wire` is
    exact for losses shorter than that; a board's frame also carries its poll cycle, so `boards[address].missing`
    counts every frame that did not arrive, whatever the reason.
    """

    def __init__(self, decoder: StreamDecoder) -> None:
        self._decoder = decoder

    @property
    def received(self) -> int:
        """Frames of any type that arrived whole."""
        return int(self._decoder.totals[0])

    @property
    def lost_on_wire(self) -> int:
        """Frames that the hub sent and that did not arrive whole."""
        return int(self._decoder.totals[1])

    @property
    def restarts(self) -> int:
        """Times that the hub began anew."""
        return int(self._decoder.totals[2])

    @property
    def frames_sent(self) -> int:
        """Frames that the hub has put onto the wire since the first one that arrived: received and lost."""
        return self.received + self.lost_on_wire

    @property
    def boards(self) -> dict[int, BoardCount]:
        """Counts of every board that has sent a frame, by address."""
        table: NDArray[np.uint64] = self._decoder.totals[3:].reshape(4, ADDRESSES)
        seen = np.flatnonzero(table[0] + table[2] + table[3])
        return {int(a): BoardCount(*(int(count) for count in table[:3, a])) for a in seen.tolist()}

    @property
    def undecoded(self) -> dict[int, int]:
        """Compact frames that arrived whole, but coded against a reference that this host does not have, by address.

        A few, when a host begins in the middle of a stream or a board was exchanged; boards without any are left out.
        """
        table: NDArray[np.uint64] = self._decoder.totals[3:].reshape(4, ADDRESSES)
        return {int(a): int(table[3, a]) for a in np.flatnonzero(table[3]).tolist()}

    def __repr__(self) -> str:
        return f"LossAccount(received={self.received}, lost_on_wire={self.lost_on_wire}, restarts={self.restarts})"
