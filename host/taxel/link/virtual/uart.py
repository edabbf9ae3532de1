"""The UART of a virtual world as a link: through a pseudo-terminal and pyserial, or through memory."""

from typing import Final

from taxel.link.base import Chunk
from taxel.link.errors import LinkError
from taxel.link.serial_port import SerialLink
from taxel.link.virtual.world import VirtualWorld

STEP_S: Final = 0.002
"""Virtual time between two reads of the port, seconds. At 1 Mbaud 200 bytes arrive in this time, far fewer than a
pseudo-terminal can buffer.
"""
MIN_STEP_S: Final = 1e-9
"""Shortest step of virtual time, seconds: a shorter step could round to 0, and a wait would never end."""
NS_PER_S: Final = 1e9


class VirtualMemoryLink:
    """The hub's UART through memory: the fastest link to a virtual world. `close()` does not close the world.

    .. warning::
        Not modelled: the serial driver. `VirtualSerialLink` includes pyserial.
    """

    is_real_time = False
    is_recorded = False

    def __init__(self, world: VirtualWorld, baud: float = 1e6) -> None:
        """Create a link that exchanges bytes with the hub of a virtual world through memory; baud: bits per second."""
        self.name = "virtual:"
        self.baud = baud
        self.world = world
        self.has_flow_control = world.has_flow_control

    def now_s(self) -> float:
        """Return the present virtual time, seconds."""
        return self.world.now_s

    def read(self, timeout_s: float) -> Chunk | None:
        """Return the bytes received from the virtual hub, or None if none arrives within `timeout_s`.

        The call runs the virtual world for at most `timeout_s` seconds of virtual time until a byte arrives.
        """
        end_s = self.world.now_s + timeout_s
        while True:
            data = self.world.receive()
            remaining_s = end_s - self.world.now_s
            if data or remaining_s <= 0.0:
                return Chunk(data, round(self.world.now_s * NS_PER_S)) if data else None
            self.world.run(max(min(STEP_S, remaining_s), MIN_STEP_S))

    def write(self, data: bytes) -> None:
        """Send bytes to the virtual hub; the virtual world runs while the receive buffer of the hub is full."""
        while data := data[self.world.send(data) :]:
            self.world.run(STEP_S)

    def close(self) -> None:
        """Do nothing: the caller closes the virtual world."""


class VirtualSerialLink(SerialLink):
    """The hub's UART as a serial port: a pseudo-terminal, opened by pyserial, of a world with `uart="pty"`.

    `read` waits until pyserial has received every byte that the world has delivered, so that the result depends only on
    virtual time.

    .. warning::
        Not modelled: different baud rates at both ends, modem lines, break, parity. A pseudo-terminal has none of
        these.
    """

    is_real_time = False

    def __init__(self, world: VirtualWorld, baud: float = 1e6) -> None:
        """Open the pseudo-terminal of a virtual world as a serial port; baud: bits per second."""
        self.world = world
        super().__init__(world.pty_name, baud)
        self.has_flow_control = world.has_flow_control
        self._read_bytes = world.delivered_bytes  # opening the port has discarded the bytes delivered before

    def now_s(self) -> float:
        """Return the present virtual time, seconds."""
        return self.world.now_s

    def read(self, timeout_s: float) -> Chunk | None:
        """Return the bytes received from the virtual hub, or None if none arrives within `timeout_s`.

        The call runs the virtual world for at most `timeout_s` seconds of virtual time until a byte arrives.
        """
        end_s = self.world.now_s + timeout_s
        while (waiting := self.world.delivered_bytes - self._read_bytes) == 0:
            remaining_s = end_s - self.world.now_s
            if remaining_s <= 0.0:
                return None
            self.world.run(max(min(STEP_S, remaining_s), MIN_STEP_S))
        data = self._read_exactly(waiting)
        self._read_bytes += len(data)
        return Chunk(data, round(self.world.now_s * NS_PER_S))

    def _read_exactly(self, size: int) -> bytes:
        """Read `size` bytes that the world has delivered. Raises `LinkError` if bytes are missing."""
        self._port.timeout = 5.0  # the kernel transfers the bytes of a pseudo-terminal with a delay
        data = bytes(self._port.read(size))
        if len(data) < size:
            raise LinkError(self.name, f"lost {size - len(data)} bytes between the emulator and pyserial")
        return data
