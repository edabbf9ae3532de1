"""Board frames grouped by poll cycle: one row per cycle, one column per taxel or board, as a dataset stores them."""

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
"""Largest delay of a frame in poll cycles; a larger step back of the cycle number means that the hub restarted."""


@dataclass(frozen=True, eq=False)
class PollCycles:
    """Frames of s boards with n taxels, grouped into T poll cycles in order of time.

    time_s: f64[T], start of the first board's scan. raw_counts: u16[T, n]. valid: bool[T, s], whether the board's frame
    arrived. sensor_time: f64[T, s], time on each board's own clock, seconds. Where a frame is missing, raw_counts and
    sensor_time repeat the board's latest values (0 before its first frame).
    """

    time_s: NDArray[np.float64]
    raw_counts: NDArray[np.uint16]
    valid: NDArray[np.bool_]
    sensor_time: NDArray[np.float64]

    def between(self, begin_s: float, end_s: float) -> PollCycles:
        """Return the poll cycles with begin_s <= time_s < end_s."""
        part = (self.time_s >= begin_s) & (self.time_s < end_s)
        return PollCycles(self.time_s[part], self.raw_counts[part], self.valid[part], self.sensor_time[part])


def group_by_poll_cycle(hand: Hand, frames: Iterable[TaxelFrame]) -> PollCycles:
    """Group the frames of all boards by poll cycle, in which the hub reads each board once.

    Cycles without any frame are omitted.
    """
    arrived = list(frames)
    numbers = _unwrap_cycle_numbers([frame.cycle for frame in arrived])
    present = np.unique(numbers)
    by_board: dict[int, tuple[list[TaxelFrame], list[int]]] = {board.address: ([], []) for board in hand.boards}
    for frame, row in zip(arrived, np.searchsorted(present, numbers).tolist(), strict=True):
        board_frames, board_rows = by_board[frame.address]
        board_frames.append(frame)
        board_rows.append(row)
    count = len(present)
    cycles = PollCycles(
        np.full(count, np.inf),
        np.zeros((count, hand.n_taxels), np.uint16),
        np.zeros((count, len(hand.boards)), bool),
        np.zeros((count, len(hand.boards))),
    )
    for column, board in enumerate(hand.boards):
        board_frames, board_rows = by_board[board.address]
        if board_frames:
            _fill_board(cycles, column, hand.get_slice(board.address), board_frames, np.array(board_rows))
    return cycles


def _unwrap_cycle_numbers(numbers: list[int]) -> NDArray[np.int64]:
    """Convert cycle numbers, which wrap around, to numbers i64[f] that do not, for f frames in order of arrival.

    A late frame keeps the number of its earlier cycle. If the hub restarts and counts from 0 again, the result
    continues without a jump.
    """
    values = np.array(numbers, dtype=np.int64)
    steps = _compute_signed_steps(values, CYCLE_MODULUS)
    steps[steps < -LATE_CYCLES] = 1
    return np.asarray(values[:1] + np.cumsum(steps))


def _compute_signed_steps(values: NDArray[np.int64], modulus: int) -> NDArray[np.int64]:
    """Compute the difference of each value from the previous one, for a counter that wraps at `modulus`.

    Each difference is between -modulus / 2 and modulus / 2; the first one is 0.
    """
    steps = np.diff(values, prepend=values[:1])
    return np.asarray((steps + modulus // 2) % modulus - modulus // 2)


def _fill_board(
    cycles: PollCycles, column: int, taxels: slice, frames: list[TaxelFrame], index: NDArray[np.intp]
) -> None:
    """Write the frames of one board into the arrays of `cycles`; missing frames repeat the latest counts and time.

    column: index of the board. taxels: its columns in the counts. index: poll cycle of each frame. The board's clock
    in microseconds, which wraps, becomes seconds without wraps.
    """
    clock = np.array([frame.board_time_us for frame in frames], dtype=np.int64)
    ticks = _compute_signed_steps(clock, CLOCK_MODULUS_US)  # signed: the clock of a board that restarts steps back
    cycles.time_s[index] = np.minimum(cycles.time_s[index], [frame.time_s for frame in frames])
    cycles.valid[index, column] = True
    latest = np.maximum.accumulate(np.where(cycles.valid[:, column], np.arange(len(cycles.time_s)), -1))
    counts = np.zeros((len(cycles.time_s), taxels.stop - taxels.start), np.uint16)
    counts[index] = np.stack([frame.raw_counts for frame in frames])
    seconds = np.zeros(len(cycles.time_s))
    seconds[index] = (clock[0] + np.cumsum(ticks)) * 1e-6
    cycles.raw_counts[:, taxels] = np.where(latest[:, None] >= 0, counts[latest], 0)
    cycles.sensor_time[:, column] = np.where(latest >= 0, seconds[latest], 0.0)
