"""Forces on an emulated board."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.hand import BoardKind
from taxel.link.virtual import VirtualWorld

SAMPLES: Final = 41
"""Points across the tip, by which its area is shared out among the cells of the taxels under it."""


class EmulatedProbe:
    """A flat tip on an emulated board that lies flat: its force spreads evenly over the tip's area.

    first: where the board's taxels begin among the world's. pitch_m: between taxels. move_s: how long the probe takes
    from one place to another, world seconds.

    .. warning::
        Not modelled: the tip's edge, which presses harder than its middle, and tilt.
    """

    name = "emulated probe"
    is_automatic = True
    knows_force = True

    def __init__(self, world: VirtualWorld, kind: BoardKind, first: int, pitch_m: float, move_s: float = 0.1) -> None:
        self._world = world
        self._kind = kind
        self._first = first
        self._pitch_m = pitch_m
        self._move_s = move_s
        self._place = -1

    def press(self, taxel: int, force_n: float, diameter_m: float) -> None:
        """As `Probe`."""
        if taxel != self._place:
            self.release()
            self._world.run(self._move_s)
        self._place = taxel
        forces = np.zeros(self._world.taxels)
        last = self._first + self._kind.taxel_count
        forces[self._first : last] = force_n * self._shares(taxel, diameter_m)
        self._world.press(forces)

    def _shares(self, taxel: int, diameter_m: float) -> NDArray[np.float64]:
        """Share of the tip over each taxel's cell; what lies over bare board presses nothing that is measured."""
        across = (np.arange(SAMPLES) + 0.5) / SAMPLES - 0.5
        down, right = np.meshgrid(across * diameter_m, across * diameter_m, indexing="ij")
        inside = np.hypot(down, right) <= diameter_m / 2.0
        tx = np.rint(down[inside] / self._pitch_m).astype(int) + int(self._kind.tx[taxel])
        rx = np.rint(right[inside] / self._pitch_m).astype(int) + int(self._kind.rx[taxel])
        rows, columns = self._kind.crossings.shape
        on_board = (tx >= 0) & (tx < rows) & (rx >= 0) & (rx < columns)
        cells = np.zeros((rows, columns))
        np.add.at(cells, (tx[on_board], rx[on_board]), 1.0 / inside.sum())
        return np.asarray(cells[self._kind.crossings])

    def release(self) -> None:
        """As `Probe`."""
        self._place = -1
        self._world.press(np.zeros(self._world.taxels))

    def close(self) -> None:
        """As `Probe`."""
        self.release()
