"""What a capture says of each board, as arrays: times, counts and sequence numbers, piece by piece."""

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


class BoardFrames(NamedTuple):
    """Snapshots of one board, one a row, in the order in which they came.

    time_s f64[t]: when the scan began, seconds (see `TaxelFrame.time_s`). raw_counts u16[t, n], in the board's taxel
    order. sequence u16[t]: the board's scan number. cycle u16[t]: the hub's poll cycle.
    """

    time_s: NDArray[np.float64]
    raw_counts: NDArray[np.uint16]
    sequence: NDArray[np.uint16]
    cycle: NDArray[np.uint16]

    def part(self, rows: slice) -> "BoardFrames":
        """Some of them."""
        return BoardFrames(self.time_s[rows], self.raw_counts[rows], self.sequence[rows], self.cycle[rows])

    def then(self, later: "BoardFrames") -> "BoardFrames":
        """These, and those that came later. Raises ValueError if that board has another number of taxels."""
        return BoardFrames(
            np.concatenate([self.time_s, later.time_s]),
            np.concatenate([self.raw_counts, later.raw_counts]),
            np.concatenate([self.sequence, later.sequence]),
            np.concatenate([self.cycle, later.cycle]),
        )


class BoardActivity(NamedTuple):
    """Snapshots of one board, its baseline, and which taxels are active in each of them."""

    frames: BoardFrames
    baseline: BaselineResult
    activation: ActivationFrame


def read_boards(path: str | os.PathLike[str]) -> Iterator[dict[int, BoardFrames]]:
    """The boards of a capture by address, some thousand frames at a time: memory does not grow with the file.

    A board that is exchanged for one of another size begins a new piece. Raises `CaptureError` (see `CaptureDecoder`).
    """
    source = CaptureDecoder(path)
    clock = RowClock(ClockMap(source.baud, source.has_arrivals), lambda message: None)
    for batch, arrivals in source:
        for rows, time_s in clock.take(batch, arrivals["end"], arrivals["time_ns"]):
            yield from _by_board(rows, time_s, batch.counts)


def _by_board(
    rows: NDArray[np.void], time_s: NDArray[np.float64], counts: NDArray[np.uint16]
) -> Iterator[dict[int, BoardFrames]]:
    key = rows["address"].astype(np.uint32) << 16 | rows["size"]
    order = np.argsort(key, kind="stable")
    borders = np.flatnonzero(np.diff(key[order])) + 1
    pieces: list[dict[int, BoardFrames]] = [{}]
    for own in np.split(order, borders):
        address, size = int(rows["address"][own[0]]), int(rows["size"][own[0]])
        windows = np.lib.stride_tricks.sliding_window_view(counts, size)
        frames = BoardFrames(time_s[own], windows[rows["offset"][own]], rows["board_sequence"][own], rows["cycle"][own])
        if address in pieces[-1]:
            pieces.append({})
        pieces[-1][address] = frames
    yield from pieces


def activity_of(
    path: str | os.PathLike[str],
    samples: int = BASELINE_SAMPLES,
    threshold: float = ACTIVATION_THRESHOLD_COUNTS,
) -> Iterator[dict[int, BoardActivity]]:
    """Which taxels of a capture are active, by address, some thousand frames at a time.

    The first `samples` frames of each board are its baseline (see `Baseline`), and are not judged; what comes later is.
    A board with fewer says nothing; one of another size begins anew. Raises `CaptureError` (see `CaptureDecoder`).
    """
    resting: dict[int, BoardFrames] = {}
    judges: dict[int, tuple[BaselineResult, Activation]] = {}
    for piece in read_boards(path):
        judged: dict[int, BoardActivity] = {}
        for address, arrived in piece.items():
            frames, taxels = arrived, arrived.raw_counts.shape[1]
            if address in judges and judges[address][1].n_taxels != taxels:
                del judges[address]
            if address not in judges:
                if address in resting and resting[address].raw_counts.shape[1] == taxels:
                    frames = resting[address].then(frames)
                resting[address] = frames
                if len(frames.time_s) <= samples:
                    continue
                baseline = compute_baseline(frames.raw_counts[:samples], samples=samples)
                judges[address] = baseline, Activation(baseline.mean, threshold)
                frames = frames.part(slice(samples, None))
                del resting[address]
            baseline, judge = judges[address]
            judged[address] = BoardActivity(frames, baseline, judge(frames.raw_counts))
        if judged:
            yield judged
