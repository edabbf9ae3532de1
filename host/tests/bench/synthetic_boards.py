"""Counts of boards that never were: sound ones, and ones with a fault that is known."""

from __future__ import annotations

import numpy as np

from taxel.hand import BoardKind, load_hand
from taxel_tools.bench.analysis.at_rest import AtRest
from taxel_tools.bench.analysis.fault import Axis, lines_of
from taxel_tools.bench.analysis.presses import Presses

LARGEST = 6400.0
KINDS = {board.kind.name: board.kind for board in load_hand("allegro").boards}
NAMES = sorted(KINDS)
ERROR = 0.3


def grid_of(kind: BoardKind, values: np.ndarray) -> np.ndarray:
    """Values of taxels at their crossings, 0 where there is none."""
    grid = np.zeros(kind.crossings.shape)
    grid[kind.crossings] = values
    return grid


def capacitances(kind: BoardKind, rng: np.random.Generator, spread: float = 0.045) -> np.ndarray:
    """Hardware counts of a sound board."""
    return 3950.0 * np.exp(spread * rng.standard_normal(kind.taxel_count))


def at_rest(kind: BoardKind, hardware: np.ndarray, rng: np.random.Generator) -> AtRest:
    """What is measured of it."""
    measured = np.minimum(hardware + ERROR * rng.standard_normal(len(hardware)), LARGEST)
    return AtRest(kind, measured, np.full(len(hardware), ERROR), LARGEST)


def with_open_line(kind: BoardKind, values: np.ndarray, axis: Axis, index: int, left: float = 0.03) -> np.ndarray:
    """A line of which only a stub is left."""
    return np.where(lines_of(kind, axis) == index, left, 1.0) * values


def with_joined_lines(kind: BoardKind, values: np.ndarray, axis: Axis, index: int, share: float = 0.5) -> np.ndarray:
    """A line and the next one carry a share of the sum of their crossings."""
    grid = grid_of(kind, values)
    table = grid if axis is Axis.TX else grid.T
    table[index : index + 2] = share * table[index : index + 2].sum(axis=0)
    return grid[kind.crossings]


def with_exchanged_lines(kind: BoardKind, values: np.ndarray, axis: Axis, first: int, second: int) -> np.ndarray:
    """Two lines in each other's place."""
    grid = grid_of(kind, values)
    table = grid if axis is Axis.TX else grid.T
    table[[first, second]] = table[[second, first]]
    return grid[kind.crossings]


def responses(kind: BoardKind, rng: np.random.Generator, counts: float = 700.0, spread: float = 0.08) -> np.ndarray:
    """[pressed, shown]: a sound board answers where it is pressed."""
    return np.diag(counts * np.exp(spread * rng.standard_normal(kind.taxel_count)))


def presses(kind: BoardKind, response: np.ndarray, rng: np.random.Generator, force_n: float = 1.0) -> Presses:
    """What is measured of it, with noise of 3 counts."""
    error = 3.0
    noisy = response + error * rng.standard_normal(response.shape)
    return Presses(kind, noisy, np.full(len(response), error), force_n)
