"""Corrections of known faults: taxels that are replaced by their neighbours, gains, and delays of the measurement."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from taxel.types import BoolArray, ByteArray, FloatArray, IntArray

INTERPOLATED: Final = 1
GAIN: Final = 2
DELAY: Final = 4
"""Bits of a taxel's flags that state its corrections."""

DONOR_PITCHES: Final = 2.1
"""Largest distance between a replaced taxel and the intact taxels (donors) from which its signal is interpolated, in
pitches (distance of adjacent taxels): two taxels in each direction, so that a dead line has donors on both sides."""


@dataclass(frozen=True, eq=False)
class RepairedSignal:
    """Signals f64[n], counts, after the corrections, and the flags u8[n] of the corrected taxels."""

    signal: FloatArray
    flags: ByteArray


@dataclass(frozen=True, eq=False)
class Repair:
    """Corrections of n taxels.

    masked: bool[n], taxels whose signals are interpolated. gain: f64[n], response relative to a healthy taxel, above 0.
    delay_s: f64[n], seconds by which the measurement of a taxel is late; time stamps are corrected, not signals.
    donors: sparse f64[n, n], weights of the taxels that replace a masked taxel; an empty row: there is none.
    """

    masked: BoolArray
    gain: FloatArray
    delay_s: FloatArray
    donors: csr_array

    @classmethod
    def make(
        cls, masked: BoolArray, gain: FloatArray, delay_s: FloatArray, position: FloatArray, board: IntArray
    ) -> Repair:
        """Create the corrections and find the donors of the masked taxels.

        position: f64[n, 3], centres of the taxels in the frame of their board, metres. board: i64[n], index of each
        taxel's board. Raises ValueError for different numbers of taxels, and for a gain that is not above 0.
        """
        if not gain.shape == delay_s.shape == masked.shape == board.shape:
            raise ValueError(f"expected {masked.size} taxels, found {gain.size} gains and {delay_s.size} delays")
        if not (np.isfinite(gain) & (gain > 0.0)).all():
            raise ValueError("gain: expected finite numbers above 0; mask a taxel without response")
        return cls(masked, gain, delay_s, _find_donors(masked, position, board))

    @property
    def flags(self) -> ByteArray:
        """Kinds of the corrections of each taxel, u8[n], a sum of `INTERPOLATED`, `GAIN` and `DELAY`."""
        flags = INTERPOLATED * self.masked + GAIN * (~self.masked & (self.gain != 1.0)) + DELAY * (self.delay_s != 0.0)
        return np.asarray(flags, np.uint8)

    def apply(self, signal: FloatArray) -> RepairedSignal:
        """Correct the signals f64[n] of one frame, counts; a missing signal is NaN.

        The signal of a masked taxel without a donor is NaN. Raises ValueError for another number of signals.
        """
        if signal.shape != self.masked.shape:
            raise ValueError(f"signal: expected {self.masked.size} taxels, found shape {signal.shape}")
        scaled = signal / self.gain
        known = np.isfinite(scaled) & ~self.masked
        weight = self.donors @ known.astype(np.float64)
        total = self.donors @ np.where(known, scaled, 0.0)
        replaced = np.where(weight > 0.0, total / np.where(weight > 0.0, weight, 1.0), np.nan)
        return RepairedSignal(np.where(self.masked, replaced, scaled), self.flags)


def _find_donors(masked: BoolArray, position: FloatArray, board: IntArray) -> csr_array:
    """Return the interpolation weights of the intact taxels around each masked taxel, sparse f64[n, n].

    Row: masked taxel; column: intact taxel of the same board. The weight is the inverse square of their distance.
    """
    rows: list[int] = []
    columns: list[int] = []
    weights: list[float] = []
    for number in np.unique(board[masked]).tolist():
        taxels = np.flatnonzero(board == number)
        intact = taxels[~masked[taxels]]
        if len(taxels) < 2 or not len(intact):
            continue
        # The nearest taxel of each taxel is the taxel itself, the second nearest is an adjacent one.
        pitch = float(np.median(np.asarray(cKDTree(position[taxels]).query(position[taxels], k=2)[0])[:, 1]))
        tree = cKDTree(position[intact])
        for taxel in taxels[masked[taxels]].tolist():
            near = intact[tree.query_ball_point(position[taxel], DONOR_PITCHES * pitch)]
            distance = np.linalg.norm(position[near] - position[taxel], axis=1)
            rows += [taxel] * len(near)
            columns += near.tolist()
            weights += (1.0 / np.maximum(distance, 1e-6) ** 2).tolist()
    return csr_array((weights, (rows, columns)), shape=(len(masked), len(masked)))
