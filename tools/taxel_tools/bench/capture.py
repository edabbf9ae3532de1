"""Frames of one board, as arrays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Capture:
    """`raw_counts` u16[t, taxels]; `time_s` f64[t], host clock: when each scan began (through the hub), or was read
    (over an adapter); `board_time_s` f64[t], when it began by the board's own clock; `sequence` i64[t], scans since
    boot, wraps taken away.
    """

    raw_counts: NDArray[np.uint16]
    time_s: NDArray[np.float64]
    board_time_s: NDArray[np.float64]
    sequence: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.time_s)

    @property
    def seconds(self) -> float:
        """From the first scan to the last."""
        return float(self.time_s[-1] - self.time_s[0]) if len(self) else 0.0

    @property
    def rate_hz(self) -> float:
        """Frames a second; 0 if there are too few to tell."""
        return (len(self) - 1) / self.seconds if self.seconds > 0.0 else 0.0

    @property
    def missed(self) -> int:
        """Scans between the first and the last that did not come."""
        return int(np.maximum(np.diff(self.sequence) - 1, 0).sum())

    @property
    def mean(self) -> NDArray[np.float64]:
        """Mean counts, f64[taxels]."""
        return np.asarray(self.raw_counts.mean(axis=0, dtype=np.float64))


def unwrapped(values: NDArray[np.integer], modulus: int) -> NDArray[np.int64]:
    """A counter that wraps, without its wraps."""
    whole = np.asarray(values, dtype=np.int64)
    if not len(whole):
        return whole
    steps = np.mod(np.diff(whole), modulus)
    return np.concatenate((whole[:1], whole[0] + np.cumsum(steps)))
