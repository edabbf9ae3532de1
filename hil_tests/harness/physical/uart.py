"""UART of the hub on a serial port."""

from hil_tests.harness.context import DriverContext
from hil_tests.harness.interfaces import Uart
from taxel.link import Link, open_link


class SerialUart(Uart):
    """A serial port: `serial:///dev/ttyUSB0?baud=1000000`, or another URL of `taxel.link.open_link`."""

    def __init__(self, context: DriverContext, url: str) -> None:
        """Create the UART of a physical rig. url: of the serial port, opened when a test needs it."""
        del context  # the URL names the port completely
        self._url = url

    def open_link(self) -> Link:
        return open_link(self._url)
