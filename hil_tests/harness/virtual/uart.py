"""UART of an emulated hub."""

from typing import ClassVar

from hil_tests.harness.context import DriverContext
from hil_tests.harness.errors import RigError
from hil_tests.harness.interfaces import Uart
from hil_tests.harness.virtual.world import I2C_DEV
from taxel.hand.world import WorldSettings
from taxel.link import Link
from taxel.link.virtual import VirtualMemoryLink, VirtualSerialLink


class VirtualUart(Uart):
    """UART of the emulated hub: a pseudo-terminal that pyserial opens (`port = "pty"`), or a link in memory (`port =
    "memory"`). With `port = "i2c-dev"` there is no hub: the link leads to a Linux hub on an emulated I2C adapter.
    """

    is_virtual: ClassVar[bool] = True

    def __init__(self, context: DriverContext, port: str = "pty") -> None:
        """Create the UART between the emulated hub and the host. port: "pty", "memory" or "i2c-dev".

        Raises `RigError` for another port.
        """
        if port not in ("pty", "memory", I2C_DEV):
            raise RigError(f"rig {context.description.path}: [uart] port = '{port}'; expected pty, memory or {I2C_DEV}")
        self._world, self._port = context.world, port
        self._baud = float(context.description.world.get("baud", WorldSettings.baud))

    def open_link(self) -> Link:
        """Open a link to the emulated hub: in memory, or through a pseudo-terminal of the operating system."""
        if self._port != "pty":
            return VirtualMemoryLink(self._world, self._baud)
        return VirtualSerialLink(self._world, self._baud)
