"""The boards of a capture as arrays of times, raw counts and sequence numbers, in blocks of some thousand frames."""

import os
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from taxel.signal import (
    ACTIVATION_THRESHOLD_COUNTS,
    BASELINE_SAMPLES,
    Activation,
    ActivationFrame,
    BaselineResult,
    compute_baseline,
)
from taxel.stream import CaptureDecoder, ClockMap
from taxel.stream.row_clock import RowClock
from taxel.types import CountArray, FloatArray


class BoardFrames(NamedTuple):
    """The T frames of one board with n taxels, in the order of their arrival.

    time_s: f64[T], start of the scan, seconds (see `TaxelFrame.time_s`). raw_counts: u16[T, n], in the board's taxel
    order. sequence: u16[T], scan number of the board. cycle: u16[T], number of the hub's poll cycle.
    """

    time_s: FloatArray
    raw_counts: CountArray
    sequence: CountArray
    cycle: CountArray

    def select(self, frames: slice) -> "BoardFrames":
        """Return a part of the board's frames, by their indices in the order of arrival."""
        return BoardFrames(self.time_s[frames], self.raw_counts[frames], self.sequence[frames], self.cycle[frames])

    def concatenate(self, later: "BoardFrames") -> "BoardFrames":
        """Return these frames followed by later ones of the board. Raises ValueError for another number of taxels."""
        return BoardFrames(
            np.concatenate([self.time_s, later.time_s]),
            np.concatenate([self.raw_counts, later.raw_counts]),
            np.concatenate([self.sequence, later.sequence]),
            np.concatenate([self.cycle, later.cycle]),
        )


class BoardActivity(NamedTuple):
    """Frames of one board, its baseline, and the activation of its taxels in each frame."""

    frames: BoardFrames
    baseline: BaselineResult
    activation: ActivationFrame


def read_boards(path: str | os.PathLike[str]) -> Iterator[dict[int, BoardFrames]]:
    """Yield the frames of all boards of a capture file by board address, in blocks of some thousand frames.

    Memory use does not grow with the file. A new block starts where a board is replaced by a board with another number
    of taxels. Raises `CaptureError` (see `CaptureDecoder`).
    """
    source = CaptureDecoder(path)
    clock = RowClock(ClockMap(source.baud, source.has_arrivals), lambda message: None)
    for batch, arrivals in source:
        for rows, time_s in clock.take(batch, arrivals["end"], arrivals["time_ns"]):
            yield from _split_by_board(rows, time_s, batch.counts)


def _split_by_board(rows: NDArray[np.void], time_s: FloatArray, counts: CountArray) -> Iterator[dict[int, BoardFrames]]:
    """Divide the T frames of a batch by board; yield dictionaries from the board address to the board's frames.

    rows: one record for each frame, dtype `ROW`. time_s: f64[T], time of each frame. counts: concatenated raw counts of
    all frames. If an address has frames with different numbers of taxels, each number is in a dictionary of its own.
    """
    key = rows["address"].astype(np.uint32) << 16 | rows["size"]
    order = np.argsort(key, kind="stable")
    borders = np.flatnonzero(np.diff(key[order])) + 1
    blocks: list[dict[int, BoardFrames]] = [{}]
    for index in np.split(order, borders):
        address, size = int(rows["address"][index[0]]), int(rows["size"][index[0]])
        windows = np.lib.stride_tricks.sliding_window_view(counts, size)  # row k: counts[k : k + size]
        frames = BoardFrames(
            time_s[index], windows[rows["offset"][index]], rows["board_sequence"][index], rows["cycle"][index]
        )
        if address in blocks[-1]:
            blocks.append({})
        blocks[-1][address] = frames
    yield from blocks


def read_activity(
    path: str | os.PathLike[str],
    samples: int = BASELINE_SAMPLES,
    threshold: float = ACTIVATION_THRESHOLD_COUNTS,
) -> Iterator[dict[int, BoardActivity]]:
    """Yield the active taxels of a capture file by board address, in blocks of some thousand frames.

    The first `samples` frames of each board give its baseline (see `Baseline`) and are not part of the result. A board
    with fewer frames is left out. If a board is replaced by one with another number of taxels, a new baseline starts.
    threshold: signal above which a taxel is active, counts. Raises `CaptureError` (see `CaptureDecoder`).
    """
    pending: dict[int, BoardFrames] = {}
    ready: dict[int, tuple[BaselineResult, Activation]] = {}
    for block in read_boards(path):
        activity: dict[int, BoardActivity] = {}
        for address, arrived in block.items():
            frames, taxels = arrived, arrived.raw_counts.shape[1]
            if address in ready and ready[address][1].n_taxels != taxels:
                del ready[address]
            if address not in ready:
                if address in pending and pending[address].raw_counts.shape[1] == taxels:
                    frames = pending[address].concatenate(frames)
                pending[address] = frames
                if len(frames.time_s) <= samples:
                    continue
                baseline = compute_baseline(frames.raw_counts[:samples], samples=samples)
                ready[address] = baseline, Activation(baseline.mean, threshold)
                frames = frames.select(slice(samples, None))
                del pending[address]
            baseline, activation = ready[address]
            activity[address] = BoardActivity(frames, baseline, activation(frames.raw_counts))
        if activity:
            yield activity
