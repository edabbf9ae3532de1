"""Faults of an emulated world."""

from collections.abc import Sequence
from typing import ClassVar

from hil_tests.harness.context import DriverContext
from hil_tests.harness.interfaces import FaultInjector
from taxel.link.virtual import FaultEvent, VirtualWorld


class VirtualFaultInjector(FaultInjector):
    """Injects the faults listed in firmware/emulator/README.md."""

    is_virtual: ClassVar[bool] = True

    def __init__(self, context: DriverContext) -> None:
        self._world: VirtualWorld = context.world

    def inject(self, name: str, address: int = 0, value: float = 0.0, second_value: float = 0.0) -> None:
        self._world.inject(name, address, value, second_value)

    def read_events(self, first: int = 0) -> Sequence[FaultEvent]:
        return self._world.read_faults(first)
