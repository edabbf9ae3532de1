"""Faults of an emulated world."""

from collections.abc import Sequence

from taxel.link.virtual import Strike, VirtualWorld


class VirtualFaultInjector:
    """Lets go wrong what firmware/emulator/README.md lists."""

    def __init__(self, world: VirtualWorld) -> None:
        self._world = world

    def inject(self, name: str, address: int = 0, value: float = 0.0, second: float = 0.0) -> None:
        self._world.inject(name, address, value, second)

    def strikes(self, first: int = 0) -> Sequence[Strike]:
        return self._world.strikes(first)
