"""CAN channel of a virtual Allegro hand."""

import itertools
from typing import ClassVar

import can

from hil_tests.harness.context import DriverContext
from hil_tests.harness.interfaces import CanBus
from hil_tests.harness.virtual.can_channel import FaultyChannel
from taxel.hand.allegro import FreeJoints, VirtualAllegro

_CHANNEL_NUMBERS = itertools.count()


class VirtualCanBus(CanBus):
    """A virtual bus of python-can with a virtual hand. Time is the time of the hand, in lock step with the test."""

    is_virtual: ClassVar[bool] = True

    def __init__(self, context: DriverContext) -> None:
        """Create a virtual CAN channel with an emulated Allegro hand. context: closes the channel at the end of the
        test.
        """
        name = f"hil-{next(_CHANNEL_NUMBERS)}"
        host_end, hand_end = (can.Bus(name, "virtual") for _ in range(2))
        for bus in (host_end, hand_end):
            context.close_at_end(bus.shutdown)
        self.channel = FaultyChannel(host_end)
        context.close_at_end(self.channel.shutdown)
        self.hand = VirtualAllegro(hand_end, FreeJoints())

    def open_bus(self) -> can.BusABC:
        return self.channel

    def now_s(self) -> float:
        return self.hand.time_s

    def advance(self, seconds: float) -> None:
        self.hand.step(seconds)
