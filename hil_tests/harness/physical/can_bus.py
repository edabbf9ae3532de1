"""The hand's CAN channel, through python-can."""

import time

import can

from taxel.hand.allegro import open_bus


class PhysicalCanBus:
    """A channel as `taxel.hand.allegro.open_bus` names it: `can:socketcan:can0`, `can:pcan:PCAN_USBBUS1` ..."""

    def __init__(self, url: str) -> None:
        self._url = url

    def open(self) -> can.BusABC:
        return open_bus(self._url)

    def let_pass(self, seconds: float) -> None:
        time.sleep(seconds)

    def now_s(self) -> float:
        return time.monotonic()
