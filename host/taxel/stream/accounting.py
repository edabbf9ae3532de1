"""Counters of received, lost and damaged frames."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel.stream.decoder import ADDRESSES, StreamDecoder


class BoardCount(NamedTuple):
    """Frame counts of one board.

    `received`: number of complete frames. `missing`: number of poll cycles without a frame of the board, between two
    cycles with a frame, in which the board had a new scan. `damaged`: number of frames rejected for a wrong CRC of the
    board.
    """

    received: int
    missing: int
    damaged: int


class LossAccount:
    """Live view of the loss counters of a decoder.

    Every frame of the hub carries a 16-bit sequence number, so `lost_on_wire` is exact for gaps shorter than 65,536
    frames. A board's frame also carries its poll cycle, so `boards[address].missing` counts every missing frame,
    regardless of the cause.
    """

    def __init__(self, decoder: StreamDecoder) -> None:
        """Create a live view of the loss counters of `decoder`."""
        self._decoder = decoder

    @property
    def frames_received(self) -> int:
        """Number of complete frames of any type received since the start."""
        return int(self._decoder.totals[0])

    @property
    def lost_on_wire(self) -> int:
        """Number of frames that the hub sent but that did not arrive complete."""
        return int(self._decoder.totals[1])

    @property
    def restarts(self) -> int:
        """Number of hub restarts."""
        return int(self._decoder.totals[2])

    @property
    def unknown_frames(self) -> int:
        """Number of complete frames that this version does not define: an unknown type, or a longer payload.

        A hub of a newer version sends such frames. They are part of `frames_received`, and are not damaged.
        """
        return int(self._decoder.totals[3])  # the order of the counters is described at `StreamDecoder.totals`

    @property
    def frames_sent(self) -> int:
        """Frames that the hub has sent since the first received frame: received plus lost."""
        return self.frames_received + self.lost_on_wire

    @property
    def boards(self) -> dict[int, BoardCount]:
        """Frame counts by board address, for the boards that have sent a frame."""
        # Rows: received, missing, damaged, undecoded frames.
        table: NDArray[np.uint64] = self._decoder.totals[4:].reshape(4, ADDRESSES)
        addresses = np.flatnonzero(table[0] + table[2] + table[3])
        return {int(a): BoardCount(*(int(count) for count in table[:3, a])) for a in addresses.tolist()}

    @property
    def undecoded_frames(self) -> dict[int, int]:
        """Number of complete delta frames whose key frame this host does not have, by board address.

        A few such frames occur when a host joins a running stream or a board is replaced. Boards without any are
        omitted.
        """
        # Rows: received, missing, damaged, undecoded frames.
        table: NDArray[np.uint64] = self._decoder.totals[4:].reshape(4, ADDRESSES)
        return {int(a): int(table[3, a]) for a in np.flatnonzero(table[3]).tolist()}

    def __repr__(self) -> str:
        """Return the loss counters as text for debugging."""
        return (
            f"LossAccount(frames_received={self.frames_received}, lost_on_wire={self.lost_on_wire}, "
            f"restarts={self.restarts})"
        )
