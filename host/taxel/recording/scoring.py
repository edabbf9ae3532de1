"""Comparison of decoded taxels with the touches of the replayed recording.

A board converts its taxels one after another while the recording changes from frame to frame, so that no frame of the
recording corresponds to a whole snapshot. Therefore each taxel sample is compared with the frame at the time of its
conversion. This time has an uncertainty of `STEP_TOLERANCE_S`. If the frames before and after it disagree, both values
are correct, and the sample is counted as "at a step".
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from taxel.types import BoolArray, FloatArray, IntArray

STEP_TOLERANCE_S = 1.5e-3
"""Uncertainty of the time of a conversion, seconds: the mapping of three clocks onto one, and the duration of a
conversion (0.14 ms), with a margin. A larger value excludes more samples from the comparison.
"""

EXACT_COUNTS = 0.5
"""Largest difference between a signal and the source's value that counts as equal; counts are integers."""


class SourceTouches:
    """The touches in a recording of a touch panel: which taxel is touched at which time.

    A frame is valid until the next one. Before the first frame no taxel is touched. A touch is a maximal run of frames
    with at least one active taxel.
    """

    def __init__(self, time_s: FloatArray, values: IntArray, threshold: float) -> None:
        """Find the touches in the recorded frames of a touch panel.

        time_s: f64[T], seconds, not decreasing. values: int[T, n], counts; a touch raises the value. threshold: a taxel
        is active where its value is above this number of counts. Of several frames with the same time only the last one
        is used. Raises ValueError for inconsistent shapes.
        """
        if values.ndim != 2 or time_s.shape != values.shape[:1] or not len(time_s):
            found = f"{time_s.shape} and {values.shape}"
            raise ValueError(f"expected time_s [T] and values [T, n] with T > 0, found {found}")
        is_last = np.append(np.diff(time_s) > 0.0, True)
        self.time_s = time_s[is_last]
        before = np.zeros((1, values.shape[1]), dtype=np.int64)
        self.values = np.concatenate([before, values[is_last]])
        self.active: BoolArray = self.values > threshold
        is_touched = np.asarray(self.active.any(axis=1))
        is_onset = is_touched & ~np.append(False, is_touched[:-1])
        self.touch_of_row = np.where(is_touched, np.cumsum(is_onset) - 1, -1)
        self.onset_s = self.time_s[np.flatnonzero(is_onset) - 1]  # - 1: row 0 is the state before the first frame

    @property
    def n_touches(self) -> int:
        """Number of touches. Touches are numbered from 0 in the order of their onsets `onset_s`, f64[n_touches]."""
        return len(self.onset_s)

    def find_rows_at(self, time_s: FloatArray) -> IntArray:
        """Return for each of k times the row of `values` and `active` that is valid at this time, int[k].

        Row 0 is the state without touch before the first frame.
        """
        return np.searchsorted(self.time_s, time_s, side="right")


@dataclass(frozen=True, eq=False)
class DecodedBoard:
    """The samples of one board with k taxels in F decoded frames.

    taxels: indices of the board's taxels among those of the hand. cycle: int64[F], poll cycle of each frame. sampled_s:
    f64[F, k], time of each taxel's conversion on the clock of the replayed recording. signal_counts: f64[F, k],
    baseline minus raw count. active: bool[F, k], whether the signal exceeds the activation threshold.
    """

    taxels: slice
    cycle: IntArray
    sampled_s: FloatArray
    signal_counts: FloatArray
    active: BoolArray


@dataclass(frozen=True, eq=False)
class ReplayScore:
    """Result of the comparison of decoded samples with the touches of the replayed recording (the source).

    A sample is one taxel in one board frame. true_positives, false_positives, false_negatives, true_negatives: samples
    away from a step; positive means active. at_steps: samples at a step of the source, for which both states are
    correct. wrong_counts: samples whose signal equals the source's value neither before nor after the time of
    conversion.

    touches: touches of the source. touches_unsampled: touches that ended before any of their taxels was converted,
    which no decoder can detect. touches_spurious: runs of poll cycles with an active taxel none of which is correct.
    onset_delay_s: f64[touches_found], for each detected touch the time from its first frame to its first correct
    sample, without the time to read and send that sample.

    duration_s: from the first to the last sample. frames: board frames. map_signal f64[n], map_active bool[n]: the
    whole skin in the poll cycle with the most active taxels; NaN and False where the frame of a board is missing.
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
    onset_delay_s: FloatArray
    duration_s: float
    boards: int
    frames: int
    map_signal: FloatArray
    map_active: BoolArray

    @property
    def samples(self) -> int:
        """Number of compared taxel samples; a sample is one taxel in one board frame."""
        decided = self.true_positives + self.false_positives + self.false_negatives + self.true_negatives
        return decided + self.at_steps

    @property
    def precision(self) -> float:
        """Share of the active samples that are correct; 1 without active samples."""
        return _compute_ratio(self.true_positives, self.false_positives)

    @property
    def recall(self) -> float:
        """Share of the touched samples that are active; 1 without touched samples."""
        return _compute_ratio(self.true_positives, self.false_negatives)

    @property
    def f1(self) -> float:
        """Harmonic mean of precision and recall; 1 without touched and active samples."""
        return _compute_ratio(2 * self.true_positives, self.false_positives + self.false_negatives)

    @property
    def touches_found(self) -> int:
        """Touches of the source with a correct active sample."""
        return len(self.onset_delay_s)

    @property
    def touches_missed(self) -> int:
        """Touches of the source without a correct active sample."""
        return self.touches - self.touches_found

    def __str__(self) -> str:
        """Return one line of text with F1 score, precision, recall, found and missed touches, and onset delay."""
        onset = "no onset"
        if self.touches_found:
            delays = 1e3 * self.onset_delay_s
            onset = f"onset {np.median(delays):.0f} ms (median), {delays.max():.0f} ms (largest)"
        return (
            f"F1 {self.f1:.4f} (precision {self.precision:.4f}, recall {self.recall:.4f}) over {self.samples:,} taxel "
            f"samples in {self.duration_s:.1f} s, {self.at_steps:,} at a step; touches {self.touches_found} of "
            f"{self.touches} found, {self.touches_missed} missed, {self.touches_spurious} spurious; {onset}"
        )


def _compute_ratio(correct: int, incorrect: int) -> float:
    """Return correct / (correct + incorrect); 1 if both are 0."""
    return correct / (correct + incorrect) if correct + incorrect else 1.0


class _BoardComparison:
    """Comparison of the decoded samples of one board with the touches of the source."""

    def __init__(self, source: SourceTouches, board: DecodedBoard, tolerance_s: float) -> None:
        """Compare the samples of one board with the touches of the source.

        tolerance_s: tolerance of the sampling times. The source is read at each sampling time minus and plus the
        tolerance.
        """
        self.board = board
        self._source = source
        self._taxel = np.arange(source.values.shape[1])[board.taxels]
        self._row_before = source.find_rows_at(board.sampled_s - tolerance_s)
        self._row_after = source.find_rows_at(board.sampled_s + tolerance_s)
        self._active_before = source.active[self._row_before, self._taxel]
        self._active_after = source.active[self._row_after, self._taxel]

    @cached_property
    def is_at_step(self) -> BoolArray:
        """Whether the source is active either just before or just after each sample of the board, but not both."""
        return self._active_before ^ self._active_after

    @cached_property
    def is_touched(self) -> BoolArray:
        """Whether the source is active both just before and just after each sample of the board."""
        return self._active_before & self._active_after

    @cached_property
    def is_correct(self) -> BoolArray:
        """Whether each sample of the board is active and the source is active just before or just after its time."""
        is_correct: BoolArray = self.board.active & (self._active_before | self._active_after)
        return is_correct

    def count_wrong(self) -> int:
        """Count the samples whose signal equals the source's value neither just before nor just after their time."""
        values, signal = self._source.values, self.board.signal_counts
        differs_before = np.abs(values[self._row_before, self._taxel] - signal) > EXACT_COUNTS
        differs_after = np.abs(values[self._row_after, self._taxel] - signal) > EXACT_COUNTS
        return int((differs_before & differs_after).sum())

    def find_touches(self, samples: BoolArray) -> IntArray:
        """Return the index of the source's touch to which each selected sample belongs, int[selected samples].

        samples: bool[F, k], selection of the board's samples. At each selected sample, the source must be active just
        before or just after the time of the sample.
        """
        row = np.where(self._active_before, self._row_before, self._row_after)
        touches: IntArray = self._source.touch_of_row[row[samples]]
        return touches


def score_replay(
    source: SourceTouches, boards: Sequence[DecodedBoard], tolerance_s: float = STEP_TOLERANCE_S
) -> ReplayScore:
    """Compare the decoded samples of all boards with the touches of the source.

    tolerance_s: uncertainty of the time of conversion; frames of the source that are shorter than twice this value are
    not resolved. Raises ValueError without any board frame.
    """
    if not boards or not any(len(board.cycle) for board in boards):
        raise ValueError("expected at least one board frame to score, found none")
    comparisons = [_BoardComparison(source, board, tolerance_s) for board in boards if len(board.cycle)]
    is_sampled, first_s = _find_first_samples(source, comparisons)
    is_found = np.isfinite(first_s)
    signal, active = _find_fullest_map(source.values.shape[1], boards)
    return ReplayScore(
        true_positives=sum(int((comparison.is_touched & comparison.board.active).sum()) for comparison in comparisons),
        false_positives=sum(
            int((comparison.board.active & ~comparison.is_correct).sum()) for comparison in comparisons
        ),
        false_negatives=sum(
            int((comparison.is_touched & ~comparison.board.active).sum()) for comparison in comparisons
        ),
        true_negatives=sum(
            int((~comparison.is_touched & ~comparison.is_at_step & ~comparison.board.active).sum())
            for comparison in comparisons
        ),
        at_steps=sum(int(comparison.is_at_step.sum()) for comparison in comparisons),
        wrong_counts=sum(comparison.count_wrong() for comparison in comparisons),
        touches=source.n_touches,
        touches_unsampled=int((~is_sampled).sum()),
        touches_spurious=_count_spurious_runs(comparisons),
        onset_delay_s=(first_s - source.onset_s)[is_found],
        duration_s=float(
            max(item.board.sampled_s.max() for item in comparisons)
            - min(item.board.sampled_s.min() for item in comparisons)
        ),
        boards=len(comparisons),
        frames=sum(len(comparison.board.cycle) for comparison in comparisons),
        map_signal=signal,
        map_active=active,
    )


def _find_first_samples(source: SourceTouches, comparisons: Sequence[_BoardComparison]) -> tuple[BoolArray, FloatArray]:
    """Find the first samples of each touch of the source; a sample is one taxel in one board frame.

    Returns (whether any sample of the touch exists, bool[touches]; time of its first correct sample, seconds,
    f64[touches], infinite without one). comparisons: comparison of each board with the source.
    """
    is_sampled = np.zeros(source.n_touches, dtype=bool)
    first_s = np.full(source.n_touches, np.inf)
    for comparison in comparisons:
        is_sampled[comparison.find_touches(comparison.is_touched)] = True
        is_sampled[comparison.find_touches(comparison.is_correct)] = True
        np.minimum.at(
            first_s, comparison.find_touches(comparison.is_correct), comparison.board.sampled_s[comparison.is_correct]
        )
    return is_sampled, first_s


def _count_spurious_runs(comparisons: Sequence[_BoardComparison]) -> int:
    """Count the runs of successive poll cycles that have active taxels, but no correctly active taxel."""
    first = min(int(comparison.board.cycle.min()) for comparison in comparisons)
    cycles = max(int(comparison.board.cycle.max()) for comparison in comparisons) - first + 1
    is_active, is_correct = np.zeros(cycles, dtype=bool), np.zeros(cycles, dtype=bool)
    for comparison in comparisons:
        np.logical_or.at(is_active, comparison.board.cycle - first, comparison.board.active.any(axis=1))
        np.logical_or.at(is_correct, comparison.board.cycle - first, comparison.is_correct.any(axis=1))
    run = np.cumsum(is_active & ~np.append(False, is_active[:-1]))
    return len(set(run[is_active].tolist()) - set(run[is_correct].tolist()))


def _find_fullest_map(n_taxels: int, boards: Sequence[DecodedBoard]) -> tuple[FloatArray, BoolArray]:
    """Return the map of the whole skin in the poll cycle with the most active taxels: (signal f64[n], active bool[n]).

    NaN and False for the taxels of boards without a frame in this cycle.
    """
    cycles = np.concatenate([board.cycle for board in boards])
    counts = np.concatenate([board.active.sum(axis=1) for board in boards])
    unique_cycles, index = np.unique(cycles, return_inverse=True)
    fullest = unique_cycles[np.argmax(np.bincount(index, counts))]
    signal, active = np.full(n_taxels, np.nan), np.zeros(n_taxels, dtype=bool)
    for board in boards:
        for frame in np.flatnonzero(board.cycle == fullest)[:1].tolist():
            signal[board.taxels] = board.signal_counts[frame]
            active[board.taxels] = board.active[frame]
    return signal, active
