"""Force probe on an emulated skin."""

from typing import ClassVar

import numpy as np

from hil_tests.harness.context import DriverContext
from hil_tests.harness.interfaces import Stimulus


class VirtualStimulus(Stimulus):
    """Applies a normal force to one taxel at a time."""

    is_virtual: ClassVar[bool] = True

    def __init__(self, context: DriverContext) -> None:
        self._world, self._hand = context.world, context.hand

    def press(self, address: int, taxel: int, force_n: float) -> None:
        """Apply a force in N to one taxel of the board at `address`, and no force to all other taxels."""
        forces_n = np.zeros(self._world.taxels)
        forces_n[self._hand.get_slice(address).start + taxel] = force_n
        self._world.set_stimulus(forces_n)

    def release(self) -> None:
        self._world.set_stimulus(np.zeros(self._world.taxels))
