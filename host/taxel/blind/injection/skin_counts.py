"""Inputs of an injected cause: the taxels of the skin, and the signal of one grasp."""

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

    position: f64[n, 3], metres, bracket frame. sensor: i64[n], address of the board. tx, rx: i64[n], line numbers.
    full_scale: largest signal of the sensor model, counts.
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
        """Indices of the taxels of each board."""
        return [np.flatnonzero(self.sensor == address) for address in np.unique(self.sensor)]

    @cached_property
    def distance(self) -> FloatArray:
        """Distances between the taxels of a board, f64[n, n], metres.

        They are infinite between taxels of different boards, and from a taxel to itself.
        """
        apart = np.linalg.norm(self.position[:, None] - self.position, axis=2)
        apart[self.sensor[:, None] != self.sensor] = np.inf
        np.fill_diagonal(apart, np.inf)
        return np.asarray(apart)

    def shares_line(self, axis: str) -> BoolArray:
        """Return whether two different taxels share a line, bool[n, n]. axis: "tx" or "rx"."""
        line = self.tx if axis == "tx" else self.rx
        same = (self.sensor[:, None] == self.sensor) & (line[:, None] == line)
        np.fill_diagonal(same, False)
        return np.asarray(same)


@dataclass(frozen=True, eq=False)
class GraspSignal:
    """One grasp of T frames and n taxels.

    signal: f64[T, n], counts. time_s: f64[T]. phase: u8[T]. rng: random numbers of this grasp. separation: f64[T, n],
    metres, distance between skin and object in the simulated grasp of the same condition, at the same relative time
    within the phase; None if the simulated dataset does not contain it.
    """

    signal: FloatArray
    time_s: FloatArray
    phase: NDArray[np.uint8]
    rng: np.random.Generator
    separation: FloatArray | None = None


Injection = Callable[[GraspSignal, float], FloatArray]
"""Function of a grasp and a strength that returns the changed signal, f64[T, n]; strength 0 changes nothing."""
