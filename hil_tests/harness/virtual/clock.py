"""Clock of a virtual rig."""

from typing import ClassVar

from hil_tests.harness.context import DriverContext
from hil_tests.harness.interfaces import Clock


class VirtualClock(Clock):
    """Seconds of the emulated world."""

    is_virtual: ClassVar[bool] = True

    def __init__(self, context: DriverContext) -> None:
        self._world = context.world

    def now_s(self) -> float:
        return self._world.now_s

    def wait(self, seconds: float) -> None:
        self._world.run(seconds)
