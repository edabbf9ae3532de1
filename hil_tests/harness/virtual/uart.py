"""The hub's UART and the clock of a virtual rig."""

from taxel.link import Link
from taxel.link.virtual import VirtualMemoryLink, VirtualSerialLink, VirtualWorld


class VirtualClock:
    """World seconds."""

    def __init__(self, world: VirtualWorld) -> None:
        self._world = world

    def now_s(self) -> float:
        return self._world.now_s

    def wait(self, seconds: float) -> None:
        self._world.run(seconds)


class VirtualUart:
    """A pseudo-terminal opened by pyserial (`pty`), or the bytes without a port (`memory`)."""

    def __init__(self, world: VirtualWorld, port: str, baud: float) -> None:
        self._world, self._port, self._baud = world, port, baud

    def link(self) -> Link:
        if self._port == "memory":
            return VirtualMemoryLink(self._world, self._baud)
        return VirtualSerialLink(self._world, self._baud)
