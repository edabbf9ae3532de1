"""Frames of one board, as arrays."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taxel.types import CountArray, FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Capture:
    """Frames of one board.

    `raw_counts` u16[t, taxels]. `time_s` f64[t], host clock: start of each scan (through the hub), or time of the read
    (over an adapter). `board_time_s` f64[t]: start of each scan by the clock of the board. `sequence` i64[t]: scans
    since boot, unwrapped.
    """

    raw_counts: CountArray
    time_s: FloatArray
    board_time_s: FloatArray
    sequence: IntArray

    def __len__(self) -> int:
        return len(self.time_s)

    @property
    def seconds(self) -> float:
        """Time from the first scan to the last."""
        return float(self.time_s[-1] - self.time_s[0]) if len(self) else 0.0

    @property
    def rate_hz(self) -> float:
        """Frames per second; 0 for fewer than two frames."""
        return (len(self) - 1) / self.seconds if self.seconds > 0.0 else 0.0

    @property
    def missed_scans(self) -> int:
        """Number of scans between the first and the last for which no frame was received."""
        return int(np.maximum(np.diff(self.sequence) - 1, 0).sum())

    @property
    def mean(self) -> FloatArray:
        """Mean raw counts, f64[taxels]."""
        return np.asarray(self.raw_counts.mean(axis=0, dtype=np.float64))


def unwrap_counter(values: NDArray[np.integer], modulus: int) -> IntArray:
    """Remove the wraps from the values of a counter modulo `modulus`, i64[n]; the first value stays as it is."""
    counter = np.asarray(values, dtype=np.int64)
    if not len(counter):
        return counter
    steps = np.mod(np.diff(counter), modulus)
    return np.concatenate((counter[:1], counter[0] + np.cumsum(steps)))
