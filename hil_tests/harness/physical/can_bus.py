"""CAN channel of the Allegro hand through python-can."""

import time

import can

from hil_tests.harness.context import DriverContext
from hil_tests.harness.interfaces import CanBus
from taxel.hand.allegro import open_bus


class PythonCanBus(CanBus):
    """A channel as `taxel.hand.allegro.open_bus` names it: `can:socketcan:can0`, `can:pcan:PCAN_USBBUS1` ..."""

    def __init__(self, context: DriverContext, url: str) -> None:
        """Create the CAN channel of a physical rig. url: such as `can:socketcan:can0`, opened when a test needs it."""
        del context  # the URL names the channel completely
        self._url = url

    def open_bus(self) -> can.BusABC:
        return open_bus(self._url)

    def now_s(self) -> float:
        return time.monotonic()

    def advance(self, seconds: float) -> None:
        time.sleep(seconds)
