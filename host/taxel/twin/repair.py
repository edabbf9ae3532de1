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
"""Bits of the flags of a taxel."""

DONOR_PITCHES: Final = 2.1
"""Distance within which intact taxels replace a taxel, in pitches: the next two in each direction, so that a dead line
has donors on both of its sides."""


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
        """Create the corrections.

        position: f64[n, 3], centres of the taxels in the frame of their board, metres. board: i64[n]. Raises ValueError
        for a wrong shape or a gain that is not above 0.
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
        """Correct the signals f64[n] of one frame, counts; NaN is missing. A masked taxel without a donor is NaN."""
        if signal.shape != self.masked.shape:
            raise ValueError(f"signal: expected {self.masked.size} taxels, found shape {signal.shape}")
        scaled = signal / self.gain
        known = np.isfinite(scaled) & ~self.masked
        weight = self.donors @ known.astype(np.float64)
        total = self.donors @ np.where(known, scaled, 0.0)
        replaced = np.where(weight > 0.0, total / np.where(weight > 0.0, weight, 1.0), np.nan)
        return RepairedSignal(np.where(self.masked, replaced, scaled), self.flags)


def _find_donors(masked: BoolArray, position: FloatArray, board: IntArray) -> csr_array:
    """Weights of the intact taxels around each masked taxel of the same board: the inverse square of the distance."""
    rows: list[int] = []
    columns: list[int] = []
    weights: list[float] = []
    for number in np.unique(board[masked]).tolist():
        own = np.flatnonzero(board == number)
        intact = own[~masked[own]]
        if len(own) < 2 or not len(intact):
            continue
        pitch = float(np.median(np.asarray(cKDTree(position[own]).query(position[own], k=2)[0])[:, 1]))
        tree = cKDTree(position[intact])
        for taxel in own[masked[own]].tolist():
            near = intact[tree.query_ball_point(position[taxel], DONOR_PITCHES * pitch)]
            distance = np.linalg.norm(position[near] - position[taxel], axis=1)
            rows += [taxel] * len(near)
            columns += near.tolist()
            weights += (1.0 / np.maximum(distance, 1e-6) ** 2).tolist()
    return csr_array((weights, (rows, columns)), shape=(len(masked), len(masked)))
