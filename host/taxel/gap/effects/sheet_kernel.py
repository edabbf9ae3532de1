"""How a sheet carries the force on a piece of a taxel to other taxels: exp(-r / spread) over all pairs of pieces."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from hashlib import sha256
from typing import Final
from weakref import WeakValueDictionary

import numpy as np
from numpy.typing import NDArray

from taxel.gap.data.boards import PIECES, BoardLayout
from taxel.types import FloatArray

FAR_M: Final = 0.04
"""Pieces farther apart do not reach each other."""

STEP_M: Final = 2e-4
"""Between the distances at which a kernel is worked out."""

SUB: Final = 5
"""Points along a piece's side over which the kernel is averaged."""

MOST_PAIRS: Final = 10_000_000
"""Of pieces of one board; beyond, a kernel goes from taxel to taxel."""

EQUAL_M: Final = 1e-6
"""Distances that differ by less are worked out once."""


@dataclass(frozen=True, eq=False)
class _Distances:
    """Distances of pieces that occur, f64[d], and which one it is to each of a taxel's pieces (first axis) from every
    piece (second) of every taxel, [9, 9, m, m]: from taxels, to taxels.
    """

    apart_m: FloatArray
    which: NDArray[np.intp]


_known: WeakValueDictionary[bytes, _Distances] = WeakValueDictionary()


def sheet_kernel(board: BoardLayout, spread_m: float) -> FloatArray:
    """Share of the force on each piece that reaches a taxel (last axis) of its board, f64[9, m, m]; they add to 1."""
    if (PIECES**2 * len(board.taxels)) ** 2 > MOST_PAIRS:
        kernel = _shares(board.apart_m, spread_m, board.pitch_m)
        return np.broadcast_to(kernel / kernel.sum(axis=-1, keepdims=True), (PIECES**2, *kernel.shape))
    return _kernel(_distances(board), spread_m, board.pitch_m / PIECES)


@lru_cache(maxsize=16)
def _kernel(distances: _Distances, spread_m: float, side_m: float) -> FloatArray:
    """See `sheet_kernel`; fingers that are built alike share it."""
    kernel = _shares(distances.apart_m, spread_m, side_m)[distances.which].mean(axis=0)
    kernel /= kernel.sum(axis=-1, keepdims=True)
    kernel.setflags(write=False)
    return np.asarray(kernel)


def _shares(apart_m: FloatArray, spread_m: float, side_m: float) -> FloatArray:
    """What reaches a square of another, over the distance of their centres."""
    share = np.interp(apart_m, *_square_kernel(round(spread_m, 7), round(side_m, 6)))
    return np.asarray(np.where(apart_m < FAR_M, share, 0.0))


def taxel_kernel(kernel: FloatArray, share: FloatArray | None) -> FloatArray:
    """Share of a taxel's force (row) that reaches another (column), f64[m, m]. share: f64[m, 9], of a taxel's force on
    its pieces; None: even.
    """
    return np.asarray(kernel.mean(axis=0) if share is None else np.einsum("mp,pmn->mn", share, kernel))


@lru_cache(maxsize=64)
def _distances(board: BoardLayout) -> _Distances:
    """Of a board's pieces; of boards that are built alike the same object, as long as it is in use."""
    points = board.pieces
    steps = np.empty((PIECES**2, PIECES**2, len(points), len(points)), np.int64)
    for end, begin in np.ndindex(steps.shape[:2]):
        apart = np.linalg.norm(points[:, begin, None] - points[:, end], axis=-1)
        steps[end, begin] = np.rint(apart / EQUAL_M)
    values, which = np.unique(steps, return_inverse=True)
    found = _Distances(EQUAL_M * values.astype(np.float64), which.reshape(steps.shape))
    return _known.setdefault(sha256(steps.tobytes()).digest(), found)


@lru_cache(maxsize=256)
def _square_kernel(spread_m: float, side_m: float) -> tuple[FloatArray, FloatArray]:
    """exp(-r / spread) averaged over two squares, over the distance of their centres, mean of two directions."""
    steps, weight = np.arange(1 - SUB, SUB) * side_m / SUB, SUB - np.abs(np.arange(1 - SUB, SUB))
    x, y = (grid.ravel() for grid in np.meshgrid(steps, steps))
    share = np.outer(weight, weight).ravel() / SUB**4
    distance = np.arange(0.0, FAR_M + STEP_M, STEP_M)
    along = np.exp(-np.hypot(distance[:, None] + x, y) / spread_m) @ share
    across = np.exp(-np.hypot(distance[:, None] / np.sqrt(2) + x, distance[:, None] / np.sqrt(2) + y) / spread_m)
    return distance, 0.5 * (along + across @ share)
