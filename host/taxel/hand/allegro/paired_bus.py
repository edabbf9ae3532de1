"""Two ends of a CAN channel within one thread, for a virtual hand in lock step.

The virtual interface of python-can copies each message for each receiver and locks a queue, because its ends may belong
to different threads; this took a tenth of the computing time of an emulated grasp.
"""

from collections import deque
from typing import Self

import can

CHANNEL = "paired"


class PairedBus(can.BusABC):
    """One end of a CAN channel; the other end receives the sent messages, which both ends must leave unchanged.

    Not for several threads: `recv` returns at once, whatever its time limit.
    """

    def __init__(self) -> None:
        """Create an end without a peer; see `open_pair`."""
        super().__init__(channel=CHANNEL)
        self.channel_info = f"{CHANNEL} channel"
        self._received: deque[can.Message] = deque()
        self._peer: PairedBus | None = None

    @classmethod
    def open_pair(cls) -> tuple[Self, Self]:
        """Create the two ends of a channel; the caller shuts both down."""
        first, second = cls(), cls()
        first.connect(second)
        return first, second

    def connect(self, peer: "PairedBus") -> None:
        """Make `peer` the other end of the channel."""
        self._peer, peer._peer = peer, self

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Deliver a message to the other end at once; it is lost if that end is shut down."""
        if self._peer is not None:
            self._peer._received.append(msg)

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """Return the next message of the other end, or None if there is none now."""
        return self._received.popleft() if self._received else None

    def shutdown(self) -> None:
        """Close this end; later messages of the other end are lost."""
        super().shutdown()
        if self._peer is not None:
            self._peer._peer = None
        self._received.clear()
