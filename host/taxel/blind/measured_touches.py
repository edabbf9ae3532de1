"""Faults in the frames of the CapFingerId recordings, their correction, and repeats from the frames of one touch.

The frames of the touch panel are torn: the first taxels of a frame still have the values of the frame before (stale
prefix). The first taxel with a new value may contain an impulse, a wrong value; only the later taxels have valid new
values. An impulse remains in the frames until a later frame has a prefix that ends before its taxel.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from taxel.recording import TouchRecording
from taxel.recording.capfingerid import COLUMNS, ROWS
from taxel.types import BoolArray, FloatArray

N_TAXELS: Final = ROWS * COLUMNS
ROW_OF_TAXEL: Final = np.arange(N_TAXELS) // COLUMNS

IMPULSE_COUNTS: Final = 40.0
"""Difference from the corrected value above which a value is an impulse, counts. Noise has about 2 counts, a touch
about 200 counts.
"""

TOUCHED_COUNTS: Final = 60.0
TOUCHED_TAXELS: Final = 2
"""Signal in counts above which a taxel is treated as touched, and smallest number of touched taxels under a finger."""

REST_COUNTS: Final = 25.0
"""Largest corrected value of a frame without a finger on the panel, counts."""

REST_BLOCKS: Final = 10
HOLD_BLOCKS: Final = 2
"""Number of frames of a repeat before contact, and smallest number of its frames in the hold phase. The diagnosis
requires 10 frames before contact; with fewer than 3 frames in hold it estimates no noise in hold."""


@dataclass(frozen=True, eq=False)
class Frames:
    """The T different frames of a recording of 405 taxels, as recorded and corrected (see the top of this file).

    time_s: f64[T]. task: task of the participant in each frame. n_duplicates: number of omitted frames, whose values
    equal those of the frame before. stale: bool[T, 405], taxels of the stale prefix. first: i64[T], the first taxel
    after the prefix. The counts are f64[T, 405]: measured: as recorded. corrected: prefix and first taxel are
    interpolated in time between valid values; 0 for the corner taxel, which never has a valid value. without_impulses:
    corrected counts with the recorded prefixes. without_prefixes: corrected counts with the recorded impulses, each
    only in the frame in which it occurs first.
    """

    name: str
    time_s: FloatArray
    task: NDArray[np.str_]
    n_duplicates: int
    stale: BoolArray
    first: NDArray[np.intp]
    measured: FloatArray
    corrected: FloatArray
    without_impulses: FloatArray
    without_prefixes: FloatArray

    @classmethod
    def from_recording(cls, recording: TouchRecording) -> Frames:
        """Detect the faults in the recording of a touch panel and build its corrected versions.

        A frame is torn: the taxels before the first changed one (`first`) still have the values of the frame before
        (`stale`), and the first changed value may be wrong (an impulse). Only the later taxels are valid.
        Three versions of the counts are built: `corrected` (invalid counts interpolated), `without_impulses`
        (corrected, with the stale counts), and `without_prefixes` (corrected, with the recorded first changed values).
        """
        frames = recording.values.reshape(len(recording.values), N_TAXELS).astype(np.float64)
        is_new = np.concatenate([[True], (frames[1:] != frames[:-1]).any(axis=1)])
        values, time = frames[is_new], recording.time_s[is_new]
        first = np.concatenate([[0], (values[1:] != values[:-1]).argmax(axis=1)])
        stale = np.arange(N_TAXELS) < first[:, None]
        corrected = _interpolate_invalid(values, time, np.arange(N_TAXELS) > first[:, None])
        torn = corrected.copy()
        for k in range(1, len(torn)):
            torn[k, stale[k]] = torn[k - 1, stale[k]]
        rows = np.arange(len(values))
        with_impulses = corrected.copy()
        with_impulses[rows, first] = values[rows, first]
        name, task = recording.name, recording.task[is_new]
        return cls(name, time, task, int((~is_new).sum()), stale, first, values, corrected, torn, with_impulses)

    @property
    def impulses(self) -> BoolArray:
        """Whether each measured value is an impulse, new or remaining from an earlier frame, bool[T, 405]."""
        return np.asarray(np.abs(self.measured - self.without_impulses) > IMPULSE_COUNTS)

    def summarise(self) -> dict[str, Any]:
        """Return statistics of the faults in the recorded frames as JSON values: shares, lengths and sizes.

        The faults are repeated frames, stale prefixes (first taxels with the values of the frame before) and impulses
        (wrong values, at first in the taxel after the prefix).
        """
        prefix, impulses = self.stale.sum(axis=1)[1:], self.impulses
        is_new_impulse = np.abs(self.measured - self.corrected)[np.arange(len(self.first)), self.first] > IMPULSE_COUNTS
        size = (self.measured - self.corrected)[np.arange(len(self.first)), self.first][is_new_impulse]
        by_row = {"stale": self.stale, "impulse": impulses}
        return {
            "frames": len(self.time_s) + self.n_duplicates,
            "repeat_share": self.n_duplicates / (len(self.time_s) + self.n_duplicates),
            "torn_share": float((prefix > 0).mean()),
            "prefix_cells": {q: float(np.quantile(prefix, f)) for q, f in (("median", 0.5), ("p90", 0.9), ("most", 1))},
            "impulse_born_share": float(is_new_impulse.mean()),
            "impulse_present_share": float(impulses.any(axis=1).mean()),
            "impulse_counts": {q: float(np.quantile(size, f)) for q, f in (("least", 0), ("median", 0.5), ("most", 1))},
            "impulse_upward_share": float((size > 0).mean()),
            "share_by_row": {
                key: [round(float(flags[:, row == ROW_OF_TAXEL].mean()), 4) for row in range(ROWS)]
                for key, flags in by_row.items()
            },
        }


def _interpolate_invalid(values: FloatArray, time_s: FloatArray, is_valid: BoolArray) -> FloatArray:
    """Interpolate the invalid counts of each taxel in time between its valid counts; return f64[T, n].

    values: f64[T, n], counts. time_s: f64[T]. is_valid: bool[T, n]. A taxel without a valid count is 0.
    """
    corrected = np.zeros_like(values)
    for taxel in range(N_TAXELS):
        rows = is_valid[:, taxel]
        if rows.any():
            corrected[:, taxel] = np.interp(time_s, time_s[rows], values[rows, taxel])
    return corrected


@dataclass(frozen=True, eq=False)
class Touch:
    """Contact of a finger at one position.

    number: index of the touch in the recording. begin, end: index of the first frame with contact, and of the first
    frame after it without contact.
    """

    frames: Frames
    number: int
    begin: int
    end: int

    @property
    def row(self) -> int:
        """Row of the panel at which the centre of the contact lies, averaged over the touch."""
        weight = self.frames.corrected[self.begin : self.end].mean(axis=0).clip(0.0)
        return round(float(weight @ ROW_OF_TAXEL / weight.sum()))

    def split_blocks(self, n_repeats: int) -> tuple[NDArray[np.intp], NDArray[np.uint8]] | None:
        """Divide the frames of a touch into B blocks of `n_repeats` consecutive frames, one for each repeat.

        Returns the indices of the frames, i64[B, n_repeats], and the grasp phase of each block, u8[B]; None if there
        are not enough frames before, in or after the touch, or if another touch follows at once. The blocks are:

        - Baseline: ten blocks of the last frames without a finger before the touch, also from earlier pauses.
        - Closing: the first block with contact. Closing contains no frame before the contact, because a repeat has only
          one frame in 0.6 s, too few to determine the time of the contact.
        - Hold: the later blocks with contact.
        - Release: the first block after the contact.
        """
        n_hold = (self.end - self.begin) // n_repeats - 1
        is_away: BoolArray = np.max(self.frames.corrected, axis=1) <= REST_COUNTS
        after = np.arange(self.end, self.end + n_repeats)
        rest = np.flatnonzero(is_away[: self.begin])[-REST_BLOCKS * n_repeats :]
        if n_hold < HOLD_BLOCKS or len(rest) < REST_BLOCKS * n_repeats or after[-1] >= len(is_away):
            return None
        if detect_touches(self.frames, after).any():
            return None
        contact = np.arange(self.begin, self.begin + (n_hold + 1) * n_repeats)
        frames = np.concatenate([rest, contact, after]).reshape(-1, n_repeats)
        phase = np.repeat([0, 1, 2, 3], [REST_BLOCKS, 1, n_hold, 1]).astype(np.uint8)
        return frames, phase


@dataclass(frozen=True, eq=False)
class Repeat:
    """One repeat of a touch, which consists of one frame of every block (`Touch.split_blocks`).

    number: index of the repeat. frames: i64[B], index of the frame in each of the B blocks. phase: u8[B], grasp phase
    of each block. time_s: f64[B], time of each block, the same for all repeats.
    """

    touch: Touch
    number: int
    frames: NDArray[np.intp]
    phase: NDArray[np.uint8]
    time_s: FloatArray


def detect_touches(frames: Frames, indices: NDArray[np.intp] | slice) -> BoolArray:
    """Return whether a finger is on the panel in each of the frames with these indices, bool[len(indices)]."""
    return np.asarray((frames.corrected[indices] > TOUCHED_COUNTS).sum(axis=1) >= TOUCHED_TAXELS)


def list_touches(frames: Frames, task: str = "TAP") -> list[Touch]:
    """List the touches that began during one task of the participant.

    In the task TAP, the finger does not move along the panel.
    """
    change = np.diff(np.concatenate([[0], detect_touches(frames, slice(None)).astype(np.int64), [0]]))
    begins, ends = np.flatnonzero(change > 0), np.flatnonzero(change < 0)
    touches = [Touch(frames, k, int(b), int(e)) for k, (b, e) in enumerate(zip(begins, ends, strict=True))]
    return [touch for touch in touches if frames.task[touch.begin] == task]


def split_repeats(touch: Touch, n_repeats: int, rng: np.random.Generator) -> list[Repeat]:
    """Split a long touch into `n_repeats` repeats, as if the finger had touched several times.

    Each repeat gets one frame of each block (`Touch.split_blocks`), assigned at random. All frames of a block get the
    time of the block, so that the times do not depend on the assignment. The list is empty for a touch that is too
    short.
    """
    result = touch.split_blocks(n_repeats)
    if result is None:
        return []
    blocks, phase = result
    assigned = np.stack([rng.permutation(block) for block in blocks], axis=1)
    period = float(np.median(np.diff(touch.frames.time_s))) * n_repeats
    time = touch.frames.time_s[touch.begin] + period * np.arange(len(blocks))
    return [Repeat(touch, k, assigned[k], phase, time) for k in range(n_repeats)]


def split_halves(repeats: list[Repeat]) -> tuple[list[Repeat], list[Repeat]]:
    """Return the first and the second half of the repeats of every touch; the numbers in each half begin with 0."""
    count = (max(repeat.number for repeat in repeats) + 1) // 2
    first = [repeat for repeat in repeats if repeat.number < count]
    return first, [replace(repeat, number=repeat.number - count) for repeat in repeats if repeat.number >= count]
