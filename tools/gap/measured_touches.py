"""Measured touches of the CapFingerId recordings: what is wrong with their frames, and looks at one touch.

A frame of the panel is torn: up to some cell it holds what stood there in the frame before (the stale prefix), the
cell where new values begin may hold an impulse, and only what follows is fresh. An impulse stays until a frame is torn
before it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from taxel.recording import TouchRecording
from taxel.recording.capfingerid import COLUMNS, ROWS
from taxel.types import BoolArray, FloatArray

CELLS: Final = ROWS * COLUMNS
ROW_OF_CELL: Final = np.arange(CELLS) // COLUMNS

IMPULSE_COUNTS: Final = 40.0
"""A value this far from its mended one is an impulse; noise is about 2 counts, a touch about 200."""

TOUCHED_COUNTS: Final = 60.0
TOUCHED_CELLS: Final = 2
"""A finger lies on several cells."""

REST_COUNTS: Final = 25.0
"""No mended cell above it: the finger is away."""

REST_BLOCKS: Final = 10
HOLD_BLOCKS: Final = 2
"""Frames of a look at rest, and in hold at least. The diagnosis asks for 10; below 3 it tells no noise in hold."""


@dataclass(frozen=True, eq=False)
class Frames:
    """The T frames of a recording that do not repeat the one before, and the same ones mended. Counts, f64[T, 405].

    stale: bool[T, 405], cells that repeat the frame before. first: i64[T], the first fresh cell. repeats: frames that
    were left out because they repeat the one before, time and all.
    measured: as recorded. mended: stale cells and the first fresh one by interpolation in time between fresh values; 0
    for the corner cell, which is never fresh. without_impulses: torn as recorded, mended values in it.
    without_prefixes: mended, but for the impulses, each in its own frame only.
    """

    name: str
    time_s: FloatArray
    task: NDArray[np.str_]
    repeats: int
    stale: BoolArray
    first: NDArray[np.intp]
    measured: FloatArray
    mended: FloatArray
    without_impulses: FloatArray
    without_prefixes: FloatArray

    @classmethod
    def of(cls, recording: TouchRecording) -> Frames:
        """Find the faults and mend them."""
        every = recording.values.reshape(len(recording.values), CELLS).astype(np.float64)
        kept = np.concatenate([[True], (every[1:] != every[:-1]).any(axis=1)])
        values, time = every[kept], recording.time_s[kept]
        first = np.concatenate([[0], (values[1:] != values[:-1]).argmax(axis=1)])
        stale = np.arange(CELLS) < first[:, None]
        mended = _mended(values, time, np.arange(CELLS) > first[:, None])
        torn = mended.copy()
        for k in range(1, len(torn)):
            torn[k, stale[k]] = torn[k - 1, stale[k]]
        rows = np.arange(len(values))
        alone = mended.copy()
        alone[rows, first] = values[rows, first]
        name, task = recording.name, recording.task[kept]
        return cls(name, time, task, int((~kept).sum()), stale, first, values, mended, torn, alone)

    @property
    def impulses(self) -> BoolArray:
        """bool[T, 405]: holds an impulse, its own or one that stayed."""
        return np.asarray(np.abs(self.measured - self.without_impulses) > IMPULSE_COUNTS)

    def figures(self) -> dict[str, Any]:
        """What is wrong with the frames, for the report."""
        prefix, impulses = self.stale.sum(axis=1)[1:], self.impulses
        born = np.abs(self.measured - self.mended)[np.arange(len(self.first)), self.first] > IMPULSE_COUNTS
        size = (self.measured - self.mended)[np.arange(len(self.first)), self.first][born]
        by_row = {"stale": self.stale, "impulse": impulses}
        return {
            "frames": len(self.time_s) + self.repeats,
            "repeat_share": self.repeats / (len(self.time_s) + self.repeats),
            "torn_share": float((prefix > 0).mean()),
            "prefix_cells": {q: float(np.quantile(prefix, f)) for q, f in (("median", 0.5), ("p90", 0.9), ("most", 1))},
            "impulse_born_share": float(born.mean()),
            "impulse_present_share": float(impulses.any(axis=1).mean()),
            "impulse_counts": {q: float(np.quantile(size, f)) for q, f in (("least", 0), ("median", 0.5), ("most", 1))},
            "impulse_upward_share": float((size > 0).mean()),
            "share_by_row": {
                key: [round(float(flags[:, row == ROW_OF_CELL].mean()), 4) for row in range(ROWS)]
                for key, flags in by_row.items()
            },
        }


def _mended(values: FloatArray, time_s: FloatArray, fresh: BoolArray) -> FloatArray:
    mended = np.zeros_like(values)
    for cell in range(CELLS):
        known = fresh[:, cell]
        if known.any():
            mended[:, cell] = np.interp(time_s, time_s[known], values[known, cell])
    return mended


@dataclass(frozen=True, eq=False)
class Touch:
    """A finger that is laid on a place, stays, and is lifted. begin, end: frames in which it lies there."""

    frames: Frames
    number: int
    begin: int
    end: int

    @property
    def row(self) -> int:
        """The panel row on which its middle lies."""
        weight = self.frames.mended[self.begin : self.end].mean(axis=0).clip(0.0)
        return round(float(weight @ ROW_OF_CELL / weight.sum()))

    def blocks(self, looks: int) -> tuple[NDArray[np.intp], NDArray[np.uint8]] | None:
        """Frames, i64[B, looks], and phase, u8[B], of successive blocks; None for a touch that is too short for them.

        Baseline: the last frames before closing in which no finger lies anywhere, ten blocks, also from pauses before
        earlier touches. Closing: the first block in which the finger lies there. A look has a frame in 0.6 s, too few
        to tell when it was touched: closing holds no frame before that, so that nobody takes an onset from it. Hold:
        the blocks after that while the finger stays. Release: the block from the first frame without it.
        """
        held = (self.end - self.begin) // looks - 1
        away: BoolArray = np.max(self.frames.mended, axis=1) <= REST_COUNTS
        after = np.arange(self.end, self.end + looks)
        rest = np.flatnonzero(away[: self.begin])[-REST_BLOCKS * looks :]
        if held < HOLD_BLOCKS or len(rest) < REST_BLOCKS * looks or after[-1] >= len(away):
            return None
        if touches_in(self.frames, after).any():
            return None
        lying = np.arange(self.begin, self.begin + (held + 1) * looks)
        frames = np.concatenate([rest, lying, after]).reshape(-1, looks)
        phase = np.repeat([0, 1, 2, 3], [REST_BLOCKS, 1, held, 1]).astype(np.uint8)
        return frames, phase


@dataclass(frozen=True, eq=False)
class Look:
    """One look at a touch: of every block one frame. frames: i64[B]; phase: u8[B]; time_s: f64[B]."""

    touch: Touch
    number: int
    frames: NDArray[np.intp]
    phase: NDArray[np.uint8]
    time_s: FloatArray


def touches_in(frames: Frames, rows: NDArray[np.intp] | slice) -> BoolArray:
    """In which of some frames a finger lies on the panel."""
    return np.asarray((frames.mended[rows] > TOUCHED_COUNTS).sum(axis=1) >= TOUCHED_CELLS)


def held_touches(frames: Frames, task: str = "TAP") -> list[Touch]:
    """Touches that began while the participant was asked for a task. In TAP the finger stays where it was laid."""
    change = np.diff(np.concatenate([[0], touches_in(frames, slice(None)).astype(np.int64), [0]]))
    begins, ends = np.flatnonzero(change > 0), np.flatnonzero(change < 0)
    every = [Touch(frames, k, int(b), int(e)) for k, (b, e) in enumerate(zip(begins, ends, strict=True))]
    return [touch for touch in every if frames.task[touch.begin] == task]


def looks_at(touch: Touch, looks: int, rng: np.random.Generator) -> list[Look]:
    """Deal the frames of each block at random to `looks` looks; [] for a touch that is too short.

    Each look's frame stands at its block's time, so that which frame a look got does not move its clock.
    """
    found = touch.blocks(looks)
    if found is None:
        return []
    blocks, phase = found
    dealt = np.stack([rng.permutation(block) for block in blocks], axis=1)
    period = float(np.median(np.diff(touch.frames.time_s))) * looks
    time = touch.frames.time_s[touch.begin] + period * np.arange(len(blocks))
    return [Look(touch, k, dealt[k], phase, time) for k in range(looks)]


def halves(looks: list[Look]) -> tuple[list[Look], list[Look]]:
    """The first half of every touch's looks, and the other, both numbered from 0."""
    count = (max(look.number for look in looks) + 1) // 2
    first = [look for look in looks if look.number < count]
    return first, [replace(look, number=look.number - count) for look in looks if look.number >= count]
