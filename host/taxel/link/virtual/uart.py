"""The UART of a virtual world as a link: through a pseudo-terminal that pyserial opens, or without one."""

from typing import Final

from taxel.link.base import Chunk
from taxel.link.errors import LinkError
from taxel.link.serial_port import SerialLink
from taxel.link.virtual.world import VirtualWorld

STEP_S: Final = 0.002
"""How far the world goes on before its port is looked at: 200 bytes at 1 Mbaud, well within a pseudo-terminal."""
GRAIN_S: Final = 1e-9
"""The least that is waited: less could be lost in rounding, and time would stand still."""
NS_PER_S: Final = 1e9


class VirtualMemoryLink:
    """The hub's UART without a port: the fastest way into a virtual world. The world stays the caller's.

    .. warning::
        Not modelled: everything that a serial driver does. Use `VirtualSerialLink` to have pyserial in the path.
    """

    is_real_time = False
    is_recorded = False

    def __init__(self, world: VirtualWorld, baud: float = 1e6) -> None:
        self.name = "virtual:"
        self.baud = baud
        self.world = world
        self.holds_back = world.holds_back

    def now_s(self) -> float:
        """World seconds."""
        return self.world.now_s

    def read(self, timeout_s: float) -> Chunk | None:
        """What has arrived; the world goes on for at most `timeout_s` until something has."""
        end = self.world.now_s + timeout_s
        while True:
            data = self.world.receive()
            left = end - self.world.now_s
            if data or left <= 0.0:
                return Chunk(data, round(self.world.now_s * NS_PER_S)) if data else None
            self.world.run(max(min(STEP_S, left), GRAIN_S))

    def write(self, data: bytes) -> None:
        """Send bytes; the world goes on while the hub's receiver has no room."""
        while data := data[self.world.send(data) :]:
            self.world.run(STEP_S)

    def close(self) -> None:
        """Nothing to let go of: the world is the caller's."""


class VirtualSerialLink(SerialLink):
    """The hub's UART as a serial port: a pseudo-terminal, opened by pyserial, of a world with `uart="pty"`.

    Every byte that the world says it has delivered is waited for, so that what is read hangs on virtual time alone.

    .. warning::
        Not modelled: baud rates that do not fit, modem lines, break, parity. A pseudo-terminal has none of them.
    """

    is_real_time = False

    def __init__(self, world: VirtualWorld, baud: float = 1e6) -> None:
        self.world = world
        super().__init__(world.pty_name, baud)
        self.holds_back = world.holds_back
        self._taken = world.delivered  # what came before nobody read: opening a port throws it away

    def now_s(self) -> float:
        """World seconds."""
        return self.world.now_s

    def read(self, timeout_s: float) -> Chunk | None:
        """What has arrived; the world goes on for at most `timeout_s` until something has."""
        end = self.world.now_s + timeout_s
        while (waiting := self.world.delivered - self._taken) == 0:
            left = end - self.world.now_s
            if left <= 0.0:
                return None
            self.world.run(max(min(STEP_S, left), GRAIN_S))
        data = self._read_exactly(waiting)
        self._taken += len(data)
        return Chunk(data, round(self.world.now_s * NS_PER_S))

    def _read_exactly(self, size: int) -> bytes:
        self._port.timeout = 5.0  # the kernel hands a pseudo-terminal's bytes over a little later
        data = bytes(self._port.read(size))
        if len(data) < size:
            raise LinkError(self.name, f"lost {size - len(data)} bytes between the emulator and pyserial")
        return data
