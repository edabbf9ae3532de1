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

LATE_CYCLES = 16
"""A frame is never this much older than the one that arrived before it, unless the hub has started anew."""


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
        part = (self.time_s >= begin_s) & (self.time_s < end_s)
        return Rows(self.time_s[part], self.raw_counts[part], self.valid[part], self.sensor_time[part])


def rows_of(hand: Hand, frames: Iterable[TaxelFrame]) -> Rows:
    """Sort the frames of every board into poll cycles. A cycle in which no board answered is no row."""
    arrived = list(frames)
    numbers = _cycles([frame.cycle for frame in arrived])
    present = np.unique(numbers)
    own: dict[int, tuple[list[TaxelFrame], list[int]]] = {board.address: ([], []) for board in hand.boards}
    for frame, place in zip(arrived, np.searchsorted(present, numbers).tolist(), strict=True):
        part, places = own[frame.address]
        part.append(frame)
        places.append(place)
    count = len(present)
    rows = Rows(
        np.full(count, np.inf),
        np.zeros((count, hand.n_taxels), np.uint16),
        np.zeros((count, len(hand.boards)), bool),
        np.zeros((count, len(hand.boards))),
    )
    for column, board in enumerate(hand.boards):
        part, places = own[board.address]
        if part:
            _fill(rows, column, hand.slice_of(board.address), part, np.array(places))
    return rows


def _cycles(numbers: list[int]) -> NDArray[np.int64]:
    """Cycle numbers of frames in the order of arrival, without their wraps; a hub that starts anew goes on counting."""
    values = np.array(numbers, dtype=np.int64)
    steps = _signed_steps(values, CYCLE_MODULUS)
    steps[steps < -LATE_CYCLES] = 1
    return np.asarray(values[:1] + np.cumsum(steps))


def _signed_steps(values: NDArray[np.int64], modulus: int) -> NDArray[np.int64]:
    """Differences of a counter, 0 for the first; each less than half of the modulus."""
    steps = np.diff(values, prepend=values[:1])
    return np.asarray((steps + modulus // 2) % modulus - modulus // 2)


def _fill(rows: Rows, column: int, where: slice, frames: list[TaxelFrame], index: NDArray[np.intp]) -> None:
    clock = np.array([frame.board_time_us for frame in frames], dtype=np.int64)
    ticks = _signed_steps(clock, CLOCK_MODULUS_US)  # signed: the clock of a board that starts anew goes back
    rows.time_s[index] = np.minimum(rows.time_s[index], [frame.time_s for frame in frames])
    rows.valid[index, column] = True
    latest = np.maximum.accumulate(np.where(rows.valid[:, column], np.arange(len(rows.time_s)), -1))
    counts = np.zeros((len(rows.time_s), where.stop - where.start), np.uint16)
    counts[index] = np.stack([frame.raw_counts for frame in frames])
    seconds = np.zeros(len(rows.time_s))
    seconds[index] = (clock[0] + np.cumsum(ticks)) * 1e-6
    rows.raw_counts[:, where] = np.where(latest[:, None] >= 0, counts[latest], 0)
    rows.sensor_time[:, column] = np.where(latest >= 0, seconds[latest], 0.0)
