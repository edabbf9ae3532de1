"""UART of an emulated hub."""

from typing import ClassVar

from hil_tests.harness.context import DriverContext
from hil_tests.harness.interfaces import Uart
from taxel.hand.world import WorldSettings
from taxel.link import Link
from taxel.link.virtual import VirtualMemoryLink, VirtualSerialLink


class VirtualUart(Uart):
    """A pseudo-terminal that pyserial opens (`port = "pty"`), or a link in memory (`port = "memory"`)."""

    is_virtual: ClassVar[bool] = True

    def __init__(self, context: DriverContext, port: str = "pty") -> None:
        """Create the UART between the emulated hub and the host. port: "pty", a pseudo-terminal, or "memory"."""
        self._world, self._port = context.world, port
        self._baud = float(context.description.world.get("baud", WorldSettings.baud))

    def open_link(self) -> Link:
        """Open a link to the emulated hub: in memory, or through a pseudo-terminal of the operating system."""
        if self._port == "memory":
            return VirtualMemoryLink(self._world, self._baud)
        return VirtualSerialLink(self._world, self._baud)
