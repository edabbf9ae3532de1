"""Raw counts that replace the measurements of emulated front ends."""

from typing import ClassVar

from numpy.typing import ArrayLike

from hil_tests.harness.context import DriverContext
from hil_tests.harness.interfaces import RawCounts


class VirtualRawCounts(RawCounts):
    """Sets the result of every conversion. Requires a world that was built with `has_known_counts`."""

    is_virtual: ClassVar[bool] = True

    def __init__(self, context: DriverContext) -> None:
        self._world = context.world

    def set_counts(self, counts: ArrayLike) -> None:
        self._world.set_stimulus(counts)
