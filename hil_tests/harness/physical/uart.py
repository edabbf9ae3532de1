"""The hub's UART on a serial port, and this machine's clock."""

import time

from taxel.link import Link, open_link


class PhysicalClock:
    """This machine's monotonic clock."""

    def now_s(self) -> float:
        return time.monotonic()

    def wait(self, seconds: float) -> None:
        time.sleep(seconds)


class SerialUart:
    """A serial port: `serial:///dev/ttyUSB0?baud=1000000`, or another URL of `taxel.link.open_link`."""

    def __init__(self, url: str) -> None:
        self._url = url

    def link(self) -> Link:
        return open_link(self._url)
