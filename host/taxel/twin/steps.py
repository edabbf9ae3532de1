"""Steps: the sums of the frames of one contact, or of one interval without announced contact.

All sums are exact integers and every boundary is a time of the stream, so that a step does not depend on how the frames
arrive: a live skin and a replay at any speed give the same bits.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from typing import Final

import numpy as np

from taxel.twin.schedule import Contact, ContactSchedule
from taxel.types import BoolArray, CountArray, FloatArray, IntArray

REST_S: Final = 10.0
"""Length of an interval without contact, seconds. The rate of the skin averages noise over some hundred frames in this
time; a longer interval delays alarms, a shorter one gives correlated steps (the 1/f noise of the front end)."""

BINS_PER_PHASE: Final = (1, 4, 2, 2, 1)
"""Number of time bins of equal length in each phase of a contact: baseline, closing, hold, release, recovery. Several
bins in the closing and release phases resolve delays that are a fraction of these phases."""

REST: Final = 0
CLOSING: Final = slice(1, 5)
HOLD: Final = slice(5, 7)
RELEASE: Final = slice(7, 9)
RECOVERY: Final = 9
BEFORE: Final = 10
BINS: Final = sum(BINS_PER_PHASE) + 1
"""Indices of the time bins of a contact, and their number. The bin `REST` contains all frames before the contact. The
bin `BEFORE` contains the last seconds of these frames once more: the baseline of the contact. Drift between the
baseline and the contact adds to the variance of a signal; therefore the baseline has the same length in the reference
and in the stream."""


@dataclass(eq=False)
class Step:
    """Sums over the frames of one step; n taxels, s boards.

    start_s, end_s: interval of the stream, seconds. contact: the announced contact, or None. count: i64[BINS, n],
    number of valid frames; an interval without contact has only the bin `REST`. total: i64[BINS, n], sum of the raw
    counts. squared_difference: i64[n], sum of the squared differences of consecutive raw counts in the bin `REST`.
    pairs: i64[n], number of these differences. received, expected: i64[s], number of received frames of each board, and
    number of poll cycles. seconds: for each second of the bin `REST`, sum of the raw counts and number of valid frames,
    i64[n] each.
    """

    start_s: float
    end_s: float
    contact: Contact | None
    count: IntArray
    total: IntArray
    squared_difference: IntArray
    pairs: IntArray
    received: IntArray
    expected: IntArray
    seconds: list[tuple[IntArray, IntArray]] = field(default_factory=list)

    @classmethod
    def empty(cls, start_s: float, n: int, s: int) -> Step:
        """Return a step without frames that starts at `start_s`. n, s: number of taxels and of boards."""
        return cls(
            start_s,
            start_s,
            None,
            np.zeros((BINS, n), np.int64),
            np.zeros((BINS, n), np.int64),
            np.zeros(n, np.int64),
            np.zeros(n, np.int64),
            np.zeros(s, np.int64),
            np.zeros(s, np.int64),
        )

    def add(self, other: Step) -> None:
        """Add the sums of another step without contact, which precedes this step."""
        for name in ("count", "total", "squared_difference", "pairs", "received", "expected"):
            getattr(self, name).__iadd__(getattr(other, name))
        self.seconds = [*other.seconds, *self.seconds]

    def compute_rest(self) -> tuple[FloatArray, FloatArray]:
        """Return the median and the minimum of the one-second means of the raw count without announced contact, f64[n].

        Both are NaN without frames. A touch during less than half of the interval does not change the median, but
        lowers the minimum.
        """
        if not self.seconds:
            unknown = np.full(self.count.shape[1], np.nan)
            return unknown, unknown
        total, count = (np.stack([part[number] for part in self.seconds]) for number in (0, 1))
        means = np.where(count > 0, total / np.maximum(count, 1), np.nan)
        known = (count > 0).any(axis=0)
        filled = np.where(known, means, 0.0)  # numpy warns of taxels that have only NaN
        return np.where(known, np.nanmedian(filled, axis=0), np.nan), np.where(known, np.nanmin(filled, axis=0), np.nan)

    def compute_means(self) -> FloatArray:
        """Compute the mean raw count of each time bin, f64[BINS, n]; NaN for a bin without a valid frame."""
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.asarray(self.total / self.count)


@dataclass(eq=False)
class StepBuilder:
    """Divides a stream into steps.

    schedule: the announced contacts. taxel_board: i64[n], column of each taxel's board. boards: number of boards.
    baseline_s: length of the baseline of a contact, seconds.

    The contact-free interval before a contact ends when the closing phase begins and belongs to the step of the
    contact. The complete interval before it, if one has ended since the previous contact, is added to this step: every
    contact then has enough frames without contact.
    """

    schedule: ContactSchedule
    taxel_board: IntArray
    boards: int
    baseline_s: float = REST_S
    _current: Step | None = None
    _earlier: Step | None = None
    _next: int = 0
    _previous: CountArray | None = None
    _previous_valid: BoolArray | None = None
    _finished: list[Step] = field(default_factory=list)

    def take(self, time_s: FloatArray, raw_counts: CountArray, valid: BoolArray) -> list[Step]:
        """Add poll cycles in order of time; return the steps that are complete.

        time_s: f64[T], seconds. raw_counts: u16[T, n]. valid: bool[T, s], whether each board delivered its frame.
        Raises ValueError for a time that is not finite.
        """
        if not np.isfinite(time_s).all():
            raise ValueError("time_s: expected finite times")
        first = 0
        while first < len(time_s):
            step = self._open(float(time_s[first]))
            last = first + int(np.searchsorted(time_s[first:], self._limit(step)))
            if last > first:
                self._add(step, time_s[first:last], raw_counts[first:last], valid[first:last])
            if last < len(time_s):
                self._close(step)
                self._skip_gap(float(time_s[last]))
            first = last
        done, self._finished = self._finished, []
        return done

    def advance(self, time_s: float) -> list[Step]:
        """Return the steps that have ended by a time, seconds, at which the stream continues after an interruption.

        The interval without contact that is not complete is left out.
        """
        while self._current is not None and self._current.expected.any() and self._limit(self._current) <= time_s:
            self._close(self._current)
        self._current = self._earlier = self._previous = self._previous_valid = None
        done, self._finished = self._finished, []
        return done

    def finish(self) -> list[Step]:
        """Return the steps that end with the stream.

        A contact that continues at the end is left out. A step without contact is kept if a contact was expected in it,
        because it shows a missed contact.
        """
        step = self._current
        if step is not None and step.contact is None and step.expected.any():
            self._close(step)
        done, self._finished = self._finished, []
        return done

    def skip_announced(self) -> None:
        """Ignore all contacts that have been announced so far."""
        self._next = len(self.schedule)

    @property
    def contact(self) -> Contact | None:
        """The announced contact of the current step; None outside a contact."""
        return self._current.contact if self._current else None

    @property
    def current(self) -> Step | None:
        """The current step, which is not complete."""
        return self._current

    def _open(self, time_s: float) -> Step:
        """Return the current step; without one, start a step at `time_s` and skip contacts that have begun by then."""
        if self._current is None:
            while self._next < len(self.schedule) and self.schedule[self._next].start_s <= time_s:
                self._next += 1  # began before the stream, or in a gap of the stream
            self._current = Step.empty(time_s, len(self.taxel_board), self.boards)
        return self._current

    def _limit(self, step: Step) -> float:
        """Return the end of a step, seconds: that of its contact; without contact, the earlier of the start of the next
        announced contact and `REST_S` after the start of the step.
        """
        if step.contact is not None:
            return step.contact.end_s
        due = self.schedule[self._next].start_s if self._next < len(self.schedule) else np.inf
        return float(min(step.start_s + REST_S, due))

    def _close(self, step: Step) -> None:
        """End the current step and start the next step at its end; a contact that begins now continues the same
        step.
        """
        limit = self._limit(step)
        self._current = None
        if step.contact is None and self._next < len(self.schedule) and self.schedule[self._next].start_s <= limit:
            self._begin_contact(step)
            return
        step.end_s = limit
        self._finished.append(step)
        self._earlier = step if step.contact is None else None
        self._previous = None
        self._current = Step.empty(limit, len(self.taxel_board), self.boards)

    def _skip_gap(self, time_s: float) -> None:
        """Discard the empty current step if no frame arrives for at least `REST_S`. time_s: time of the next frame."""
        step = self._current
        if step is not None and not step.expected.any() and time_s >= self._limit(step) + REST_S:
            self._current = self._earlier = None

    def _begin_contact(self, step: Step) -> None:
        """Turn a step without contact into the step of the next announced contact; its frames become the baseline.

        The sums of the preceding step are added, unless a contact or a gap of the stream lies between both steps.
        """
        if self._earlier is not None:
            step.add(self._earlier)
        step.contact = self.schedule[self._next]
        self._next += 1
        self._earlier = None
        self._current = step

    def _add(self, step: Step, time_s: FloatArray, raw: CountArray, valid: BoolArray) -> None:
        """Add T poll cycles that all belong to `step`. time_s: f64[T]. raw: u16[T, n]. valid: bool[T, s], by board."""
        wide = valid[:, self.taxel_board]
        step.received += valid.sum(axis=0)
        step.expected += len(time_s)
        bins = find_bins(step.contact, time_s)
        for number in np.unique(bins).tolist():
            self._add_to_bin(step, number, bins == number, raw, wide)
        if step.contact is None:
            self._add_seconds(step, time_s, raw, wide)
            if self._next < len(self.schedule):
                # The frames shortly before the contact are its baseline; they belong to both bins, `REST` and `BEFORE`.
                late = time_s >= self.schedule[self._next].start_s - self.baseline_s
                self._add_to_bin(step, BEFORE, late, raw, wide)
            self._add_differences(step, raw, wide)
        step.end_s = float(time_s[-1])

    @staticmethod
    def _add_seconds(step: Step, time_s: FloatArray, raw: CountArray, wide: BoolArray) -> None:
        """Add poll cycles to the one-second sums of a step. wide: bool[T, n], whether each taxel's frame is valid."""
        number = np.floor(time_s - step.start_s).astype(np.int64)
        for second in np.unique(number).tolist():
            while len(step.seconds) <= second:
                step.seconds.append((np.zeros(raw.shape[1], np.int64), np.zeros(raw.shape[1], np.int64)))
            cycles = number == second
            total, count = step.seconds[second]
            total += np.where(wide[cycles], raw[cycles], 0).sum(axis=0, dtype=np.int64)
            count += wide[cycles].sum(axis=0)

    @staticmethod
    def _add_to_bin(step: Step, number: int, cycles: BoolArray, raw: CountArray, wide: BoolArray) -> None:
        """Add the poll cycles that `cycles` bool[T] selects to the time bin `number` of a step.

        wide: bool[T, n], whether each taxel's frame is valid.
        """
        if cycles.any():
            step.count[number] += wide[cycles].sum(axis=0)
            step.total[number] += np.where(wide[cycles], raw[cycles], 0).sum(axis=0, dtype=np.int64)

    def _add_differences(self, step: Step, raw: CountArray, wide: BoolArray) -> None:
        """Add the squared differences of consecutive frames to a step.

        The first frame is compared with the last frame of the previous call, so that the sums do not depend on the
        blocks in which frames arrive. wide: bool[T, n], whether each taxel's frame is valid.
        """
        if self._previous is not None and self._previous_valid is not None:
            raw = np.vstack([self._previous, raw])
            wide = np.vstack([self._previous_valid, wide])
        both = wide[1:] & wide[:-1]
        steps = np.where(both, np.diff(raw.astype(np.int32), axis=0), 0).astype(np.int64)
        step.squared_difference += (steps * steps).sum(axis=0)
        step.pairs += both.sum(axis=0)
        self._previous, self._previous_valid = raw[-1], wide[-1]


def find_bins(contact: Contact | None, time_s: FloatArray) -> IntArray:
    """Return the index of the time bin of each time, i64[T]; without a contact, all times are in the bin `REST`."""
    if contact is None:
        return np.zeros(len(time_s), np.int64)
    edges: list[float] = []
    for begin, end, parts in zip(contact.times_s[:-1], contact.times_s[1:], BINS_PER_PHASE[1:], strict=True):
        edges += [begin + (end - begin) * part / parts for part in range(parts)]
    return np.asarray(np.searchsorted(edges, time_s, side="right"), np.int64)


def find_bin_position(contact: Contact, time_s: float) -> float:
    """Return the position of a time among the middles of a contact's time bins: 2.5 is midway between bins 2 and 3."""
    edges = [contact.times_s[0] - 1e-9]
    for begin, end, parts in zip(contact.times_s[:-1], contact.times_s[1:], BINS_PER_PHASE[1:], strict=True):
        edges += [begin + (end - begin) * (part + 1) / parts for part in range(parts)]
    # Bin 0, the baseline, has no start of its own: the start of the contact is used in place of the middle of this bin.
    middles = [edges[0], *(0.5 * (low + high) for low, high in pairwise(edges))]
    return float(np.interp(time_s, middles, np.arange(len(middles))))
