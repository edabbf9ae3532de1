"""A touch panel's cells laid over the taxels of a hand.

A recording from a panel has to go through several boards. The panel is cut into equal rectangles, and each is laid on
a window of a board where every crossing is a taxel: what touched neighbouring cells touches neighbouring taxels, panel
rows along TX, panel columns along RX. The largest rectangle that fits is taken; windows are taken board by board in the
order of addresses, on a board lowest RX first, then lowest TX, so the same hand always gives the same tiling.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np
import numpy.typing as npt
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from taxel.hand import Board, Hand
from taxel.recording.capfingerid import COLUMNS, ROWS
from taxel.recording.errors import RecordingError

BOARDS_MIN = 4
"""A touch has to cross from board to board: no board takes more than a quarter of the tiles."""

REST_COUNTS = 2440
"""Raw count of an untouched taxel: about the mean of the emulated front end (firmware/emulator/front_end.c)."""

RAW_COUNT_MAX = 65_535


@dataclass(frozen=True, eq=False)
class Tiling:
    """Which taxel of a hand each cell of a panel is laid on.

    n_taxels: taxels of the hand. taxel_of_cell: int64[405], in the panel's row-major order, all different.
    tile_shape: panel rows and columns that lie together on one board.

    Raises ValueError if a taxel is outside the hand or taken twice.
    """

    n_taxels: int
    taxel_of_cell: NDArray[np.int64]
    tile_shape: tuple[int, int]

    def __post_init__(self) -> None:
        taxels = self.taxel_of_cell
        if taxels.shape != (ROWS * COLUMNS,) or len(np.unique(taxels)) != len(taxels):
            raise ValueError(f"taxel_of_cell: expected {ROWS * COLUMNS} different taxels, found shape {taxels.shape}")
        if taxels.min() < 0 or taxels.max() >= self.n_taxels:
            raise ValueError(
                f"taxel_of_cell: expected 0 to {self.n_taxels - 1}, found {taxels.min()} to {taxels.max()}"
            )

    @classmethod
    def of(cls, hand: Hand) -> "Tiling":
        """The tiling of `hand`. Raises `RecordingError` if the hand is too small."""
        for shape in _tile_shapes():
            needed = (ROWS // shape[0]) * (COLUMNS // shape[1])
            tiles = [tile for board in hand.boards for tile in _tiles_on(hand, board, shape, needed // BOARDS_MIN)]
            if len(tiles) >= needed:
                return cls(hand.n_taxels, _cells_of(np.stack(tiles[:needed]), shape), shape)
        raise RecordingError(
            f"hand '{hand.name}' is too small for a panel of {ROWS} x {COLUMNS} cells: expected {ROWS * COLUMNS} "
            f"taxels with no more than a quarter of them on one board, found {hand.n_taxels} on {len(hand.boards)} "
            "boards; use a larger hand"
        )

    def spread(self, values: npt.ArrayLike) -> NDArray[np.int64]:
        """Panel values [T, 27, 15] as values of all taxels, int64[T, n_taxels], 0 where no cell lies."""
        cells = np.asarray(values)
        if cells.ndim != 3 or cells.shape[1:] != (ROWS, COLUMNS) or cells.dtype.kind not in "iu":
            raise ValueError(f"values: expected integers [T, {ROWS}, {COLUMNS}], found {cells.dtype} {cells.shape}")
        result = np.zeros((len(cells), self.n_taxels), dtype=np.int64)
        result[:, self.taxel_of_cell] = cells.reshape(len(cells), -1)
        return result

    def to_counts(self, values: npt.ArrayLike, rest: int = REST_COUNTS) -> NDArray[np.uint16]:
        """Raw counts u16[T, n_taxels] of panel values [T, 27, 15]: rest - value, clipped to 0..65,535.

        Taxels without a cell have `rest`.
        Raises ValueError for a wrong shape or dtype, or a rest outside 0..65,535.
        """
        if not 0 <= rest <= RAW_COUNT_MAX:
            raise ValueError(f"rest: expected 0 to {RAW_COUNT_MAX}, found {rest}")
        counts: NDArray[np.uint16] = np.clip(rest - self.spread(values), 0, RAW_COUNT_MAX).astype(np.uint16)
        return counts

    def from_counts(self, counts: npt.ArrayLike, rest: int = REST_COUNTS) -> NDArray[np.int64]:
        """Panel values int64[T, 27, 15] = rest - count of raw counts [T, n_taxels].

        Raises ValueError for another shape.
        """
        raw = np.asarray(counts)
        if raw.ndim != 2 or raw.shape[1] != self.n_taxels:
            raise ValueError(f"counts: expected [T, {self.n_taxels}], found {raw.shape}")
        values: NDArray[np.int64] = rest - raw[:, self.taxel_of_cell].astype(np.int64)
        return values.reshape(-1, ROWS, COLUMNS)


def _tile_shapes() -> list[tuple[int, int]]:
    """Rectangles that divide the panel into `BOARDS_MIN` tiles or more: largest first, squarer first among equals."""
    shapes = product(
        [rows for rows in range(1, ROWS + 1) if ROWS % rows == 0],
        [columns for columns in range(1, COLUMNS + 1) if COLUMNS % columns == 0],
    )
    usable = [(r, c) for r, c in shapes if r * c * BOARDS_MIN <= ROWS * COLUMNS]
    return sorted(usable, key=lambda shape: (-shape[0] * shape[1], abs(shape[0] - shape[1])))


def _tiles_on(hand: Hand, board: Board, shape: tuple[int, int], most: int) -> Iterator[NDArray[np.int64]]:
    """Up to `most` windows of a board that do not overlap, each as the taxels under it, int64[rows, columns]."""
    free = board.kind.crossings.copy()
    if shape[0] > free.shape[0] or shape[1] > free.shape[1]:
        return
    taxel = np.full(free.shape, -1, dtype=np.int64)
    taxel[free] = np.arange(hand.n_taxels)[hand.get_slice(board.address)]
    found = 0
    windows = sliding_window_view(free, shape).all(axis=(2, 3))
    for rx, tx in np.argwhere(windows.T).tolist():
        window = (slice(tx, tx + shape[0]), slice(rx, rx + shape[1]))
        if found < most and free[window].all():
            free[window] = False
            found += 1
            yield taxel[window]


def _cells_of(tiles: NDArray[np.int64], shape: tuple[int, int]) -> NDArray[np.int64]:
    """Tiles [k, rows, columns], in the panel's row-major order, put together to int64[405]."""
    down, across = ROWS // shape[0], COLUMNS // shape[1]
    return tiles.reshape(down, across, *shape).swapaxes(1, 2).reshape(-1)
