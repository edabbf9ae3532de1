"""Power supply of emulated boards and of the emulated hub."""

from typing import ClassVar

from hil_tests.harness.context import DriverContext
from hil_tests.harness.interfaces import Power


class VirtualPower(Power):
    """Switches each board and the hub separately."""

    is_virtual: ClassVar[bool] = True

    def __init__(self, context: DriverContext) -> None:
        self._world = context.world

    def switch(self, on: bool, address: int | None = None) -> None:
        """Connect or disconnect the supply of the emulated hub or, with an address, of one emulated board."""
        fault = "plug" if on else "unplug"
        if address is None:
            self._world.inject(f"hub_{fault}")
        else:
            self._world.inject(fault, address)
