"""A probe on an emulated skin, and raw counts in its place."""

import numpy as np
from numpy.typing import ArrayLike

from taxel.hand import Hand
from taxel.link.virtual import VirtualWorld


class VirtualStimulus:
    """Presses one taxel at a time, straight down."""

    def __init__(self, world: VirtualWorld, hand: Hand) -> None:
        self._world, self._hand = world, hand

    def press(self, address: int, taxel: int, force_n: float) -> None:
        forces = np.zeros(self._world.taxels)
        forces[self._hand.get_slice(address).start + taxel] = force_n
        self._world.press(forces)

    def release(self) -> None:
        self._world.press(np.zeros(self._world.taxels))


class VirtualCounts:
    """What every conversion gives."""

    def __init__(self, world: VirtualWorld) -> None:
        self._world = world

    def show(self, counts: ArrayLike) -> None:
        self._world.press(counts)
