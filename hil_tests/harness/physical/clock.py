"""Clock of a physical rig."""

import time

from hil_tests.harness.context import DriverContext
from hil_tests.harness.interfaces import Clock


class MonotonicClock(Clock):
    """The monotonic clock of this machine."""

    def __init__(self, context: DriverContext) -> None:
        del context  # the clock of this machine needs nothing from the rig

    def now_s(self) -> float:
        return time.monotonic()

    def wait(self, seconds: float) -> None:
        time.sleep(seconds)
