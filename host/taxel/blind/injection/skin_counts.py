"""What an injected cause acts on: the skin, and the signal of one grasp."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from taxel.types import BoolArray, FloatArray


@dataclass(frozen=True, eq=False)
class SkinTable:
    """The n taxels of a skin.

    position: f64[n, 3], metres, bracket frame. sensor, tx, rx: i64[n]. full_scale: largest signal of the sensor model,
    counts.
    """

    position: FloatArray
    sensor: NDArray[np.int64]
    tx: NDArray[np.int64]
    rx: NDArray[np.int64]
    full_scale: float

    @property
    def n(self) -> int:
        """Number of taxels."""
        return len(self.sensor)

    @cached_property
    def boards(self) -> list[NDArray[np.intp]]:
        """Taxels of every board."""
        return [np.flatnonzero(self.sensor == address) for address in np.unique(self.sensor)]

    @cached_property
    def distance(self) -> FloatArray:
        """Distances in a board, f64[n, n], metres; infinite between boards and from a taxel to itself."""
        apart = np.linalg.norm(self.position[:, None] - self.position, axis=2)
        apart[self.sensor[:, None] != self.sensor] = np.inf
        np.fill_diagonal(apart, np.inf)
        return np.asarray(apart)

    def shares_line(self, axis: str) -> BoolArray:
        """Whether two taxels share a line, bool[n, n]. axis: "tx" or "rx"."""
        line = self.tx if axis == "tx" else self.rx
        same = (self.sensor[:, None] == self.sensor) & (line[:, None] == line)
        np.fill_diagonal(same, False)
        return np.asarray(same)


@dataclass(frozen=True, eq=False)
class GraspSignal:
    """One grasp: signal f64[T, n], counts; time_s f64[T]; phase u8[T]; rng: random numbers of this grasp.

    separation: f64[T, n], metres, of the simulator in the same condition, at the same part of the phase; None if the
    simulator states none.
    """

    signal: FloatArray
    time_s: FloatArray
    phase: NDArray[np.uint8]
    rng: np.random.Generator
    separation: FloatArray | None = None


Injection = Callable[[GraspSignal, float], FloatArray]
"""Changed signal f64[T, n] of a grasp at a strength; strength 0 changes nothing."""
