"""From a stream of board frames to the rows of a dataset: one row a poll cycle, a column a taxel."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.hand import Hand
from taxel.stream import TaxelFrame

CYCLE_MODULUS = 1 << 16
CLOCK_MODULUS_US = 1 << 32


@dataclass(frozen=True, eq=False)
class Rows:
    """Poll cycles in order. time_s: f64[T], when the first board's scan began; raw_counts: u16[T, n], the last one
    where a frame is missing (0 before the first); valid: bool[T, s]; sensor_time: f64[T, s], each board's own clock,
    seconds (where a frame is missing: the last one).
    """

    time_s: NDArray[np.float64]
    raw_counts: NDArray[np.uint16]
    valid: NDArray[np.bool_]
    sensor_time: NDArray[np.float64]

    def between(self, begin_s: float, end_s: float) -> Rows:
        """The rows with begin_s <= time_s < end_s."""
        part = slice(*np.searchsorted(self.time_s, [begin_s, end_s]).tolist())
        return Rows(self.time_s[part], self.raw_counts[part], self.valid[part], self.sensor_time[part])


def rows_of(hand: Hand, frames: Iterable[TaxelFrame]) -> Rows:
    """Sort the frames of every board into poll cycles. A cycle in which no board answered is no row."""
    own: dict[int, list[TaxelFrame]] = {board.address: [] for board in hand.boards}
    for frame in frames:
        own[frame.address].append(frame)
    cycles = {address: _unwrapped([frame.cycle for frame in part]) for address, part in own.items()}
    _align(cycles, own)
    present = np.unique(np.concatenate([*cycles.values(), np.empty(0, np.int64)]))
    count = len(present)
    rows = Rows(
        np.full(count, np.inf),
        np.zeros((count, hand.n_taxels), np.uint16),
        np.zeros((count, len(hand.boards)), bool),
        np.zeros((count, len(hand.boards))),
    )
    for column, board in enumerate(hand.boards):
        _fill(
            rows,
            column,
            hand.slice_of(board.address),
            own[board.address],
            np.searchsorted(present, cycles[board.address]),
        )
    return rows


def _unwrapped(numbers: list[int]) -> NDArray[np.int64]:
    """Cycle numbers count modulo 65,536; a board is never silent for half of that."""
    values = np.array(numbers, dtype=np.int64)
    steps = np.diff(values, prepend=values[:1])
    return np.asarray(values[:1] + np.cumsum((steps + CYCLE_MODULUS // 2) % CYCLE_MODULUS - CYCLE_MODULUS // 2))


def _align(cycles: dict[int, NDArray[np.int64]], own: dict[int, list[TaxelFrame]]) -> None:
    """A board that was first heard after a wrap of the cycle number belongs that many wraps later: its time says so."""
    heard = [(own[address][0].time_s, address) for address in cycles if len(cycles[address])]
    if not heard:
        return
    first = min(heard)[1]
    times = np.array([frame.time_s for frame in own[first]])
    for _, address in heard:
        expected = np.interp(own[address][0].time_s, times, cycles[first])
        cycles[address] += CYCLE_MODULUS * round((expected - cycles[address][0]) / CYCLE_MODULUS)


def _fill(rows: Rows, column: int, where: slice, frames: list[TaxelFrame], index: NDArray[np.intp]) -> None:
    if not frames:
        return
    clock = np.array([frame.board_time_us for frame in frames], dtype=np.int64)
    ticks = np.diff(clock, prepend=clock[:1]) % CLOCK_MODULUS_US
    rows.time_s[index] = np.minimum(rows.time_s[index], [frame.time_s for frame in frames])
    rows.valid[index, column] = True
    latest = np.maximum.accumulate(np.where(rows.valid[:, column], np.arange(len(rows.time_s)), -1))
    counts = np.zeros((len(rows.time_s), where.stop - where.start), np.uint16)
    counts[index] = np.stack([frame.raw_counts for frame in frames])
    seconds = np.zeros(len(rows.time_s))
    seconds[index] = (clock[0] + np.cumsum(ticks)) * 1e-6
    rows.raw_counts[:, where] = np.where(latest[:, None] >= 0, counts[latest], 0)
    rows.sensor_time[:, column] = np.where(latest >= 0, seconds[latest], 0.0)
