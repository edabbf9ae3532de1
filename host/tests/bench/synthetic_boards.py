"""Synthetic raw counts of healthy boards and of boards with a known fault."""

import numpy as np

from taxel.hand import BoardKind, load_hand
from taxel_tools.bench.analysis.at_rest import RestCounts
from taxel_tools.bench.analysis.fault import Axis, get_lines_of_taxels
from taxel_tools.bench.analysis.indentations import Indentations

FULL_SCALE = 6400.0
KINDS = {board.kind.name: board.kind for board in load_hand("allegro").boards}
NAMES = sorted(KINDS)
ERROR = 0.3


def to_grid(kind: BoardKind, values: np.ndarray) -> np.ndarray:
    """Arrange the values f64[taxels] at their crossings, f64[tx, rx]; 0 at crossings without a taxel."""
    grid = np.zeros(kind.crossings.shape)
    grid[kind.crossings] = values
    return grid


def sample_capacitances(kind: BoardKind, rng: np.random.Generator, spread: float = 0.045) -> np.ndarray:
    """Sample the hardware counts of a healthy board."""
    return 3950.0 * np.exp(spread * rng.standard_normal(kind.taxel_count))


def measure_at_rest(kind: BoardKind, hardware: np.ndarray, rng: np.random.Generator) -> RestCounts:
    """Return the rest counts that a board with these hardware counts f64[taxels] shows, with noise."""
    measured = np.minimum(hardware + ERROR * rng.standard_normal(len(hardware)), FULL_SCALE)
    return RestCounts(kind, measured, np.full(len(hardware), ERROR), FULL_SCALE)


def with_open_line(
    kind: BoardKind, values: np.ndarray, axis: Axis, index: int, remaining_share: float = 0.03
) -> np.ndarray:
    """Return the values f64[taxels] of a board with an open line: the crossings keep `remaining_share`, the stub."""
    return np.where(get_lines_of_taxels(kind, axis) == index, remaining_share, 1.0) * values


def with_shorted_lines(kind: BoardKind, values: np.ndarray, axis: Axis, index: int, share: float = 0.5) -> np.ndarray:
    """Return the values f64[taxels] of a board on which line `index` and the next line are shorted.

    Both measure the share `share` of the sum of their crossings.
    """
    grid = to_grid(kind, values)
    table = grid if axis is Axis.TX else grid.T
    table[index : index + 2] = share * table[index : index + 2].sum(axis=0)
    return grid[kind.crossings]


def with_swapped_lines(kind: BoardKind, values: np.ndarray, axis: Axis, first: int, second: int) -> np.ndarray:
    """Return the values of a board with two swapped lines."""
    grid = to_grid(kind, values)
    table = grid if axis is Axis.TX else grid.T
    table[[first, second]] = table[[second, first]]
    return grid[kind.crossings]


def sample_responses(
    kind: BoardKind, rng: np.random.Generator, counts: float = 700.0, spread: float = 0.08
) -> np.ndarray:
    """Sample the response matrix f64[indented taxel, responding taxel] of a healthy board without crosstalk."""
    return np.diag(counts * np.exp(spread * rng.standard_normal(kind.taxel_count)))


def measure_indentations(
    kind: BoardKind, response: np.ndarray, rng: np.random.Generator, force_n: float = 1.0
) -> Indentations:
    """Return the measurement of this response matrix, with noise of 3 counts."""
    error = 3.0
    noisy = response + error * rng.standard_normal(response.shape)
    return Indentations(kind, noisy, np.full(len(response), error), force_n)
