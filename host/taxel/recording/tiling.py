"""Assignment of the cells of a touch panel to the taxels of a hand.

The values of a panel's cells are distributed to several boards. The panel is divided into equal rectangles (tiles), and
each tile is assigned to a window of a board in which every crossing is a taxel: neighbouring cells become neighbouring
taxels, panel rows along TX and panel columns along RX. The largest possible rectangle is used. Windows are selected
board by board in the order of addresses, on a board by lowest RX, then lowest TX, so that a hand has only one tiling.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np
import numpy.typing as npt
from numpy.lib.stride_tricks import sliding_window_view

from taxel.hand import Board, Hand
from taxel.recording.capfingerid import COLUMNS, ROWS
from taxel.recording.errors import RecordingError
from taxel.types import CountArray, IntArray

BOARDS_MIN = 4
"""Smallest number of boards that share the panel, so that a touch can move from board to board. With 4, no board has
more than a quarter of the tiles.
"""

UNTOUCHED_COUNTS = 2440
"""Raw count of an untouched taxel: about the mean of the emulated front end (firmware/emulator/physics/front_end.c)."""

RAW_COUNT_MAX = 65_535


@dataclass(frozen=True, eq=False)
class Tiling:
    """Assignment of the 27 x 15 cells of a touch panel to taxels of a hand.

    n_taxels: number of taxels of the hand. taxel_of_cell: int64[405], index of the taxel of each cell, all different,
    in the panel's row-major order. tile_shape: (rows, columns) of cells in one tile, which is on one board. Raises
    ValueError for a taxel outside the hand or a taxel with two cells.
    """

    n_taxels: int
    taxel_of_cell: IntArray
    tile_shape: tuple[int, int]

    def __post_init__(self) -> None:
        """Check that each cell of the panel has a taxel of its own, and that the hand has every taxel."""
        taxels = self.taxel_of_cell
        if taxels.shape != (ROWS * COLUMNS,) or len(np.unique(taxels)) != len(taxels):
            raise ValueError(f"taxel_of_cell: expected {ROWS * COLUMNS} different taxels, found shape {taxels.shape}")
        if taxels.min() < 0 or taxels.max() >= self.n_taxels:
            raise ValueError(
                f"taxel_of_cell: expected 0 to {self.n_taxels - 1}, found {taxels.min()} to {taxels.max()}"
            )

    @classmethod
    def for_hand(cls, hand: Hand) -> "Tiling":
        """Assign the cells of the touch panel to taxels of `hand`. Raises `RecordingError` if the hand is too small."""
        for shape in _list_tile_shapes():
            n_tiles = (ROWS // shape[0]) * (COLUMNS // shape[1])
            tiles = [tile for board in hand.boards for tile in _find_tiles(hand, board, shape, n_tiles // BOARDS_MIN)]
            if len(tiles) >= n_tiles:
                return cls(hand.n_taxels, _join_tiles(np.stack(tiles[:n_tiles]), shape), shape)
        raise RecordingError(
            f"hand '{hand.name}' is too small for a panel of {ROWS} x {COLUMNS} cells: expected {ROWS * COLUMNS} "
            f"taxels with at most a quarter of them on one board, found {hand.n_taxels} on {len(hand.boards)} "
            "boards; use a larger hand"
        )

    def to_taxels(self, values: npt.ArrayLike) -> IntArray:
        """Convert panel values [T, 27, 15] to values of all taxels, int64[T, n_taxels]; 0 for taxels without a cell."""
        cells = np.asarray(values)
        if cells.ndim != 3 or cells.shape[1:] != (ROWS, COLUMNS) or cells.dtype.kind not in "iu":
            raise ValueError(f"values: expected integers [T, {ROWS}, {COLUMNS}], found {cells.dtype} {cells.shape}")
        result = np.zeros((len(cells), self.n_taxels), dtype=np.int64)
        result[:, self.taxel_of_cell] = cells.reshape(len(cells), -1)
        return result

    def to_counts(self, values: npt.ArrayLike, untouched: int = UNTOUCHED_COUNTS) -> CountArray:
        """Convert panel values [T, 27, 15] to raw counts u16[T, n_taxels]: untouched - value, clipped to 0..65,535.

        Taxels without a cell have the count `untouched`. Raises ValueError for a wrong shape or dtype, or if
        `untouched` is outside 0..65,535.
        """
        if not 0 <= untouched <= RAW_COUNT_MAX:
            raise ValueError(f"untouched: expected 0 to {RAW_COUNT_MAX}, found {untouched}")
        counts: CountArray = np.clip(untouched - self.to_taxels(values), 0, RAW_COUNT_MAX).astype(np.uint16)
        return counts


def _list_tile_shapes() -> list[tuple[int, int]]:
    """Return the rectangles (rows, columns) that divide the touch panel into at least `BOARDS_MIN` tiles.

    The largest rectangles are first, and among equally large ones those most nearly square.
    """
    shapes = product(
        [rows for rows in range(1, ROWS + 1) if ROWS % rows == 0],
        [columns for columns in range(1, COLUMNS + 1) if COLUMNS % columns == 0],
    )
    usable = [(r, c) for r, c in shapes if r * c * BOARDS_MIN <= ROWS * COLUMNS]
    return sorted(usable, key=lambda shape: (-shape[0] * shape[1], abs(shape[0] - shape[1])))


def _find_tiles(hand: Hand, board: Board, shape: tuple[int, int], max_count: int) -> Iterator[IntArray]:
    """Yield at most `max_count` disjoint windows of a board, each as its taxel indices, int64[rows, columns].

    shape: rows and columns of a window, all of whose crossings must carry taxels.
    """
    free = board.kind.crossings.copy()
    if shape[0] > free.shape[0] or shape[1] > free.shape[1]:
        return
    taxel = np.full(free.shape, -1, dtype=np.int64)
    taxel[free] = np.arange(hand.n_taxels)[hand.get_slice(board.address)]
    count = 0
    windows = sliding_window_view(free, shape).all(axis=(2, 3))
    for rx, tx in np.argwhere(windows.T).tolist():
        window = (slice(tx, tx + shape[0]), slice(rx, rx + shape[1]))
        if count < max_count and free[window].all():
            free[window] = False
            count += 1
            yield taxel[window]


def _join_tiles(tiles: IntArray, shape: tuple[int, int]) -> IntArray:
    """Join tiles [k, rows, columns] of taxel indices to int64[405] in the row-major order of the panel's cells."""
    tile_rows, tile_columns = ROWS // shape[0], COLUMNS // shape[1]
    return tiles.reshape(tile_rows, tile_columns, *shape).swapaxes(1, 2).reshape(-1)
