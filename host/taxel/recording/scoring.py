"""How well decoded taxels show the touches of the recording that was sent.

A board converts one taxel after another while the recording steps from frame to frame, so there is no frame that a
whole snapshot could be compared with. Each taxel sample is compared with the frame in force at the instant of its
conversion. That instant is known to `STEP_TOLERANCE_S`; where the frames before and after it disagree, either is right,
and the sample is counted as at a step.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

STEP_TOLERANCE_S = 1.5e-3
"""The mapping of three clocks onto one, and the length of a conversion (0.14 ms), with room to spare."""

EXACT_COUNTS = 0.5
"""Counts are whole numbers: a signal nearer than this to the source's value is that value."""


class SourceTouches:
    """The truth: which taxel was touched when.

    time_s: f64[T], never going back; frames are held, and of those with one time the last counts. values: int[T, n],
    counts, larger = touched. A taxel is active where its value is above `threshold`, strictly. Before the first frame
    nothing is touched.

    A touch is a maximal run of frames with at least one active taxel. Raises ValueError for shapes that do not fit.
    """

    def __init__(self, time_s: NDArray[np.float64], values: NDArray[np.int64], threshold: float) -> None:
        if values.ndim != 2 or time_s.shape != values.shape[:1] or not len(time_s):
            found = f"{time_s.shape} and {values.shape}"
            raise ValueError(f"expected time_s [T] and values [T, n] with T > 0, found {found}")
        lasting = np.append(np.diff(time_s) > 0.0, True)
        self.time_s = time_s[lasting]
        self.values = np.concatenate([np.zeros((1, values.shape[1]), dtype=np.int64), values[lasting]])  # row 0: before
        self.active: NDArray[np.bool_] = self.values > threshold
        touched = np.asarray(self.active.any(axis=1))
        begins = touched & ~np.append(False, touched[:-1])
        self.touch_of_row = np.where(touched, np.cumsum(begins) - 1, -1)
        self.onset_s = self.time_s[np.flatnonzero(begins) - 1]

    @property
    def n_touches(self) -> int:
        """Touches, numbered from 0 in the order of their onsets `onset_s` f64[n_touches]."""
        return len(self.onset_s)

    def row_at(self, time_s: NDArray[np.float64]) -> NDArray[np.int64]:
        """Row of `values` and `active` in force at each time."""
        return np.searchsorted(self.time_s, time_s, side="right")


@dataclass(frozen=True, eq=False)
class DecodedBoard:
    """What the skin made of the samples of one board.

    taxels: where the board lies on the hand's taxel axis. cycle: int64[F], poll cycle of each frame.
    sampled_s: f64[F, k], when each taxel was converted, on the source's clock. signal_counts: f64[F, k].
    active: bool[F, k].
    """

    taxels: slice
    cycle: NDArray[np.int64]
    sampled_s: NDArray[np.float64]
    signal_counts: NDArray[np.float64]
    active: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class ReplayScore:
    """How decoded taxels compare with the source.

    A sample is one taxel in one board frame. true_positives, false_positives, false_negatives, true_negatives: samples
    away from a step; at_steps: samples where either answer is right. wrong_counts: samples whose signal is not the
    source's value, neither of the frame before the instant nor of that after it.

    touches: touches in the source; touches_found: those with a sample that is rightly active; touches_unsampled: those
    that ended before any of their taxels was converted, which no decoder could find; touches_spurious: runs of poll
    cycles with an active taxel none of which is right. onset_delay_s: f64[touches_found], from a touch's first frame to
    the instant of its first right sample (to read and send that sample takes longer still).

    duration_s: from the first to the last sample; frames: board frames. map_signal f64[n] and map_active bool[n]: the
    whole skin in the poll cycle with the most active taxels, NaN and False where a board's frame is missing.
    """

    true_positives: int
    false_positives: int
    false_negatives: int
    true_negatives: int
    at_steps: int
    wrong_counts: int
    touches: int
    touches_unsampled: int
    touches_spurious: int
    onset_delay_s: NDArray[np.float64]
    duration_s: float
    boards: int
    frames: int
    map_signal: NDArray[np.float64]
    map_active: NDArray[np.bool_]

    @property
    def samples(self) -> int:
        """Taxel samples compared."""
        decided = self.true_positives + self.false_positives + self.false_negatives + self.true_negatives
        return decided + self.at_steps

    @property
    def precision(self) -> float:
        """Share of the active samples that are right; 1 if none was active."""
        return _share(self.true_positives, self.false_positives)

    @property
    def recall(self) -> float:
        """Share of the touched samples that are active; 1 if none was touched."""
        return _share(self.true_positives, self.false_negatives)

    @property
    def f1(self) -> float:
        """Harmonic mean of precision and recall; 1 if nothing was touched and nothing active."""
        return _share(2 * self.true_positives, self.false_positives + self.false_negatives)

    @property
    def touches_found(self) -> int:
        """Touches of the source that the skin showed."""
        return len(self.onset_delay_s)

    @property
    def touches_missed(self) -> int:
        """Touches of the source that the skin did not show."""
        return self.touches - self.touches_found

    def __str__(self) -> str:
        onset = "no onset"
        if self.touches_found:
            delays = 1e3 * self.onset_delay_s
            onset = f"onset {np.median(delays):.0f} ms (median), {delays.max():.0f} ms (largest)"
        return (
            f"F1 {self.f1:.4f} (precision {self.precision:.4f}, recall {self.recall:.4f}) over {self.samples:,} taxel "
            f"samples in {self.duration_s:.1f} s, {self.at_steps:,} at a step; touches {self.touches_found} of "
            f"{self.touches} found, {self.touches_missed} missed, {self.touches_spurious} spurious; {onset}"
        )


def _share(right: int, wrong: int) -> float:
    return right / (right + wrong) if right + wrong else 1.0


class _BoardComparison:
    """One board's samples beside the source."""

    def __init__(self, source: SourceTouches, board: DecodedBoard, tolerance_s: float) -> None:
        self.board = board
        self._source = source
        self._taxel = np.arange(source.values.shape[1])[board.taxels]
        self._before = source.row_at(board.sampled_s - tolerance_s)
        self._after = source.row_at(board.sampled_s + tolerance_s)
        self._was = source.active[self._before, self._taxel]
        self._becomes = source.active[self._after, self._taxel]

    @cached_property
    def at_step(self) -> NDArray[np.bool_]:
        """Touched before or after, but not both."""
        return self._was ^ self._becomes

    @cached_property
    def touched(self) -> NDArray[np.bool_]:
        """Touched for certain."""
        return self._was & self._becomes

    @cached_property
    def right(self) -> NDArray[np.bool_]:
        """Active, and rightly so."""
        right: NDArray[np.bool_] = self.board.active & (self._was | self._becomes)
        return right

    def wrong_counts(self) -> int:
        """Samples whose signal is neither value."""
        values, signal = self._source.values, self.board.signal_counts
        off_before = np.abs(values[self._before, self._taxel] - signal) > EXACT_COUNTS
        off_after = np.abs(values[self._after, self._taxel] - signal) > EXACT_COUNTS
        return int((off_before & off_after).sum())

    def touch_of(self, where: NDArray[np.bool_]) -> NDArray[np.int64]:
        """The touch that each of those samples belongs to."""
        row = np.where(self._was, self._before, self._after)
        touches: NDArray[np.int64] = self._source.touch_of_row[row[where]]
        return touches


def score_replay(
    source: SourceTouches, boards: Sequence[DecodedBoard], tolerance_s: float = STEP_TOLERANCE_S
) -> ReplayScore:
    """Compare what the skin decoded with what was sent.

    tolerance_s: how well the instants of conversion are known; frames of the source that last less than twice that are
    not told apart. Raises ValueError without any board frame.
    """
    if not boards or not any(len(board.cycle) for board in boards):
        raise ValueError("expected at least one board frame to score, found none")
    parts = [_BoardComparison(source, board, tolerance_s) for board in boards if len(board.cycle)]
    sampled, first_s = _first_samples(source, parts)
    found = np.isfinite(first_s)
    signal, active = _fullest_map(source.values.shape[1], boards)
    return ReplayScore(
        true_positives=sum(int((part.touched & part.board.active).sum()) for part in parts),
        false_positives=sum(int((part.board.active & ~part.right).sum()) for part in parts),
        false_negatives=sum(int((part.touched & ~part.board.active).sum()) for part in parts),
        true_negatives=sum(int((~part.touched & ~part.at_step & ~part.board.active).sum()) for part in parts),
        at_steps=sum(int(part.at_step.sum()) for part in parts),
        wrong_counts=sum(part.wrong_counts() for part in parts),
        touches=source.n_touches,
        touches_unsampled=int((~sampled).sum()),
        touches_spurious=_spurious_runs(parts),
        onset_delay_s=(first_s - source.onset_s)[found],
        duration_s=float(max(p.board.sampled_s.max() for p in parts) - min(p.board.sampled_s.min() for p in parts)),
        boards=len(parts),
        frames=sum(len(part.board.cycle) for part in parts),
        map_signal=signal,
        map_active=active,
    )


def _first_samples(
    source: SourceTouches, parts: Sequence[_BoardComparison]
) -> tuple[NDArray[np.bool_], NDArray[np.float64]]:
    """Per touch: whether any of its samples could show it, and when the first did (infinity: none)."""
    sampled = np.zeros(source.n_touches, dtype=bool)
    first_s = np.full(source.n_touches, np.inf)
    for part in parts:
        sampled[part.touch_of(part.touched)] = True
        sampled[part.touch_of(part.right)] = True
        np.minimum.at(first_s, part.touch_of(part.right), part.board.sampled_s[part.right])
    return sampled, first_s


def _spurious_runs(parts: Sequence[_BoardComparison]) -> int:
    """Runs of poll cycles with an active taxel, none of which is right."""
    first = min(int(part.board.cycle.min()) for part in parts)
    cycles = max(int(part.board.cycle.max()) for part in parts) - first + 1
    active, right = np.zeros(cycles, dtype=bool), np.zeros(cycles, dtype=bool)
    for part in parts:
        np.logical_or.at(active, part.board.cycle - first, part.board.active.any(axis=1))
        np.logical_or.at(right, part.board.cycle - first, part.right.any(axis=1))
    run = np.cumsum(active & ~np.append(False, active[:-1]))
    return len(set(run[active].tolist()) - set(run[right].tolist()))


def _fullest_map(n_taxels: int, boards: Sequence[DecodedBoard]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Signal and activity of the whole skin in the poll cycle with the most active taxels."""
    cycles = np.concatenate([board.cycle for board in boards])
    counts = np.concatenate([board.active.sum(axis=1) for board in boards])
    known, index = np.unique(cycles, return_inverse=True)
    fullest = known[np.argmax(np.bincount(index, counts))]
    signal, active = np.full(n_taxels, np.nan), np.zeros(n_taxels, dtype=bool)
    for board in boards:
        for frame in np.flatnonzero(board.cycle == fullest)[:1].tolist():
            signal[board.taxels] = board.signal_counts[frame]
            active[board.taxels] = board.active[frame]
    return signal, active
