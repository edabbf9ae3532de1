"""CAN channel to a virtual hand in the thread of its driver, in real time.

A virtual hand in a thread of its own falls silent while that thread waits for the processor or for the lock of the
interpreter. The driver then reports a silent hand although no fault exists. Here each receive call of the driver first
advances the virtual hand to the present time, so that reports are never late.
"""

import time
from collections.abc import Callable

import can

from taxel.hand.allegro.dynamics import FreeJoints
from taxel.hand.allegro.paired_bus import PairedBus
from taxel.hand.allegro.virtual import VirtualAllegro


class EmulatedBus(PairedBus):
    """The driver's end of a CAN channel with a virtual hand at the other end; shut down by the caller.

    clock: the clock of the driver; returns seconds. `hand` is the virtual hand; its joints start at rest.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        """Create the channel and its virtual hand; the virtual time of the hand starts now."""
        super().__init__()
        self.channel_info = "emulated hand"
        self._hand_end = PairedBus()
        self.connect(self._hand_end)
        self.hand = VirtualAllegro(self._hand_end, FreeJoints())
        self._clock, self._start_s = clock, clock()

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """Advance the virtual hand to the present time; return its next message, or None if there is none now."""
        self.hand.follow(self._clock() - self._start_s)
        return super().recv(timeout)

    def shutdown(self) -> None:
        """Deliver the last commands of the driver to the virtual hand, and close both ends."""
        self.hand.step(0.0)
        super().shutdown()
        self._hand_end.shutdown()
