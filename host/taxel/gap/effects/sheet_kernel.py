"""Spread of force in a cover sheet: kernel exp(-(r / spread)^shape) over all pairs of pieces of a board."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from hashlib import sha256
from typing import Final
from weakref import WeakValueDictionary

import numpy as np
from numpy.typing import NDArray

from taxel.gap.data.boards import PIECES_PER_SIDE, BoardLayout
from taxel.types import FloatArray

MAX_DISTANCE_M: Final = 0.04
"""Distance of pieces beyond which the kernel is 0, metres."""

DISTANCE_STEP_M: Final = 2e-4
"""Step of the distances at which a kernel is tabulated, metres. Values between are interpolated linearly."""

POINTS_PER_SIDE: Final = 5
"""Number of points along the side of a piece over which the kernel is averaged."""

MAX_PIECE_PAIRS: Final = 10_000_000
"""Largest number of pairs of pieces of a board. On a larger board the kernel is computed between whole taxels, which
limits memory."""

DISTANCE_RESOLUTION_M: Final = 1e-6
"""Resolution to which distances are rounded, metres, so that the kernel is computed once for equal distances."""


@dataclass(frozen=True, eq=False)
class _PieceDistances:
    """Distances between the pieces of a board with m taxels.

    distance_m: f64[d], distinct distances, metres. index: intp[9, 9, m, m], index into `distance_m`; the axes are
    target piece, source piece, source taxel, target taxel.
    """

    distance_m: FloatArray
    index: NDArray[np.intp]


_shared_distances: WeakValueDictionary[bytes, _PieceDistances] = WeakValueDictionary()


def compute_sheet_kernel(board: BoardLayout, spread_m: float, shape: float = 1.0) -> FloatArray:
    """Return the share of the force on each piece that reaches each taxel of the board, f64[9, m, m] (m taxels of the
    board).

    The axes are source piece, source taxel, target taxel; the shares of a piece add up to 1. spread_m: decay length of
    the kernel, metres. shape: exponent of the kernel, 1 for an exponential and 2 for a Gaussian kernel.
    """
    if _is_large(board):
        kernel = _interpolate_taxel_kernel(board, spread_m, shape)
        return np.broadcast_to(kernel, (PIECES_PER_SIDE**2, *kernel.shape))
    return _average_kernel(_compute_distances(board), spread_m, board.pitch_m / PIECES_PER_SIDE, shape)


def compute_even_kernel(board: BoardLayout, spread_m: float, shape: float = 1.0) -> FloatArray:
    """Return the share of the force on an evenly loaded taxel (row) that reaches another taxel (column), f64[m, m] (m
    taxels of the board). spread_m, shape: see `compute_sheet_kernel`. The array is read-only.
    """
    if _is_large(board):
        return _interpolate_taxel_kernel(board, spread_m, shape)
    return _average_even_kernel(board, spread_m, shape)


def _is_large(board: BoardLayout) -> bool:
    """Return whether the kernel of a board is computed between whole taxels; such a kernel is not cached."""
    return (PIECES_PER_SIDE**2 * len(board.taxels)) ** 2 > MAX_PIECE_PAIRS


def _interpolate_taxel_kernel(board: BoardLayout, spread_m: float, shape: float) -> FloatArray:
    """Return the kernel of `compute_even_kernel` between whole taxels, f64[m, m], read-only."""
    kernel = _interpolate_kernel(board.distance_m, spread_m, board.pitch_m, shape)
    kernel /= kernel.sum(axis=-1, keepdims=True)
    kernel.setflags(write=False)
    return kernel


@lru_cache(maxsize=64)
def _average_even_kernel(board: BoardLayout, spread_m: float, shape: float) -> FloatArray:
    """Return the kernel of `compute_even_kernel` from the pieces of the taxels, f64[m, m], read-only.

    Cached: a fit to a hand alternates between three spreads and shapes on each of up to 17 boards.
    """
    kernel = compute_taxel_kernel(compute_sheet_kernel(board, spread_m, shape), None)
    kernel.setflags(write=False)
    return kernel


@lru_cache(maxsize=16)
def _average_kernel(distances: _PieceDistances, spread_m: float, side_m: float, shape: float) -> FloatArray:
    """Return the kernel of `compute_sheet_kernel`, f64[9, m, m]: source piece in its taxel, source taxel, target taxel
    (m taxels of the board).

    A weight is the mean over the pieces of the target taxel; the weights of a source piece add up to 1. spread_m: decay
    length of the spread, metres. side_m: side of a piece, metres. shape: exponent of the kernel. Cached: boards with
    equal distances share one array, which is read-only.
    """
    kernel = _interpolate_kernel(distances.distance_m, spread_m, side_m, shape)[distances.index].mean(axis=0)
    kernel /= kernel.sum(axis=-1, keepdims=True)
    kernel.setflags(write=False)
    return np.asarray(kernel)


def _interpolate_kernel(distance_m: FloatArray, spread_m: float, side_m: float, shape: float) -> FloatArray:
    """Return the mean of exp(-(r / spread)^shape) between two squares, for each distance of their centres; 0 beyond
    `MAX_DISTANCE_M`.

    distance_m: distances, any shape. spread_m: decay length. side_m: side of the squares. All in metres. shape:
    exponent of the kernel.
    """
    # The lengths are rounded, so that nearly equal lengths share a cached table.
    share = np.interp(distance_m, *_tabulate_square_kernel(round(spread_m, 7), round(side_m, 6), round(shape, 6)))
    return np.asarray(np.where(distance_m < MAX_DISTANCE_M, share, 0.0))


def compute_taxel_kernel(kernel: FloatArray, share: FloatArray | None) -> FloatArray:
    """Return the share of the force on a taxel (row) that reaches another taxel (column), f64[m, m] (m taxels of the
    board).

    kernel: f64[9, m, m], of `compute_sheet_kernel`. share: f64[m, 9], share of a taxel's force on each of its pieces;
    None: equal shares.
    """
    return np.asarray(kernel.mean(axis=0) if share is None else np.einsum("mp,pmn->mn", share, kernel))


@lru_cache(maxsize=64)
def _compute_distances(board: BoardLayout) -> _PieceDistances:
    """Return the distances between all pieces of a board; boards with equal distances share one object, which saves
    memory.
    """
    points = board.piece_centres
    steps = np.empty((PIECES_PER_SIDE**2, PIECES_PER_SIDE**2, len(points), len(points)), np.int64)
    for target, source in np.ndindex(steps.shape[:2]):
        distance = np.linalg.norm(points[:, source, None] - points[:, target], axis=-1)
        steps[target, source] = np.rint(distance / DISTANCE_RESOLUTION_M)
    values, index = np.unique(steps, return_inverse=True)
    distances = _PieceDistances(DISTANCE_RESOLUTION_M * values.astype(np.float64), index.reshape(steps.shape))
    return _shared_distances.setdefault(sha256(steps.tobytes()).digest(), distances)


@lru_cache(maxsize=256)
def _tabulate_square_kernel(spread_m: float, side_m: float, shape: float) -> tuple[FloatArray, FloatArray]:
    """Return distances, metres, and the mean of exp(-(r / spread)^shape) over two squares whose centres have these
    distances.
    """
    distance, lengths, share = _tabulate_lengths(side_m)
    relative = lengths / spread_m
    return distance, np.exp(-relative if shape == 1.0 else -(relative**shape)) @ share


@lru_cache(maxsize=64)
def _tabulate_lengths(side_m: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return d distances of the centres of two squares, metres, f64[d], the lengths between p pairs of their points at
    each distance, metres, f64[d, p], and the shares of the pairs, f64[p], whose sum is 1.

    Half of the pairs belong to the direction along a side of the squares, half to the diagonal direction.
    """
    # Offsets between the points of the two squares on one axis, and the number of pairs of points with each offset.
    steps, weight = (
        np.arange(1 - POINTS_PER_SIDE, POINTS_PER_SIDE) * side_m / POINTS_PER_SIDE,
        POINTS_PER_SIDE - np.abs(np.arange(1 - POINTS_PER_SIDE, POINTS_PER_SIDE)),
    )
    x, y = (grid.ravel() for grid in np.meshgrid(steps, steps))
    share = np.outer(weight, weight).ravel() / POINTS_PER_SIDE**4
    distance = np.arange(0.0, MAX_DISTANCE_M + DISTANCE_STEP_M, DISTANCE_STEP_M)
    along = np.hypot(distance[:, None] + x, y)
    across = np.hypot(distance[:, None] / np.sqrt(2) + x, distance[:, None] / np.sqrt(2) + y)
    return distance, np.hstack([along, across]), 0.5 * np.concatenate([share, share])
