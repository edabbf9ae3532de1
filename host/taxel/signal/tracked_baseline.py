"""Baseline that follows drift for hours and holds under a lasting contact.

Model: without contact, the mean count of a taxel in an interval is near its count at rest; contact lowers it. The count
at rest follows the common change of its board and also changes slowly by itself (`rest_level.py`). Whether a taxel is
in contact is a hidden state (`contact_state.py`). The count at rest of a free taxel is corrected by its own mean; the
count at rest of a taxel in contact only follows the free taxels of its board.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt

from taxel.signal._arrays import check_positive, check_shape, to_raw_count_array, to_validity_mask
from taxel.signal.contact_state import CONTACTS_PER_S, ContactState, Interval, to_probability
from taxel.signal.rest_level import RestLevel, RestSettings, estimate_slow_settings
from taxel.types import BoolArray, FloatArray, IntArray

INTERVAL_S: Final = 1.0
"""Length of an interval whose mean count is compared, seconds: shorter than a grasp, and long enough to average some
frames."""

ROUNDING_SIGMA: Final = 12.0**-0.5
"""Smallest standard deviation of one frame, counts: that of the rounding to integers."""

STORED: Final = 120
LEAST_STORED: Final = 30
"""Largest and smallest number of intervals from which the variability of the counts at rest is estimated. The estimate
is renewed after every `LEAST_STORED` intervals."""

MEDIAN_VARIANCE: Final = np.pi / 2.0
"""Variance of the median of many normal values, relative to that of their mean (Kenney and Keeping, Mathematics of
Statistics, 1962)."""

CORRELATED: Final = 10.0
"""Number of successive deviations that are treated as one in the estimate of a loading, because 1/f noise is correlated
(assumed)."""

LONG_LAG: Final = 20
"""Number of intervals over which the slow change of a level is measured: the variance of 1/f noise hardly grows with
time, that of a random walk does."""

COMMON_FREEDOM: Final = 10.0
"""Degrees of freedom of the Student t distribution of a board's common change: a temperature change ten times as fast
as usual is possible, one a thousand times as fast is not."""

JOINT_CONTACT: Final = 0.3
"""Probability that a contact of a board begins on a given taxel of the board (assumed: a contact covers a third)."""

PER_INTERVAL: Final = RestSettings(measured=1.0, walk=0.01, common=1.0)
"""Variability before it has been estimated (assumed: 1/f noise of one count, and a warm-up of one count per second)."""


@dataclass(frozen=True, eq=False)
class TrackedState:
    """Present state of n taxels.

    mean: f64[n], count at rest (the baseline) of each taxel. sigma: f64[n], its standard deviation, counts. is_contact:
    bool[n], whether contact is more probable than no contact. contact_s: f64[n], time since the contact began, seconds;
    0 without contact.
    """

    mean: FloatArray
    sigma: FloatArray
    is_contact: BoolArray
    contact_s: FloatArray


class TrackedBaseline:
    """Baseline of n taxels of one or several boards, corrected once in each interval.

    Start with the baseline of the first frames (`Baseline`); then call `update` with each frame. The result depends on
    the frames only, not on the time at which they are processed.
    """

    def __init__(
        self,
        baseline_mean: npt.ArrayLike,
        noise: npt.ArrayLike,
        board: npt.ArrayLike | None = None,
        interval_s: float = INTERVAL_S,
    ) -> None:
        """Start the tracking at a measured baseline.

        baseline_mean: f64[n], counts, finite. noise: f64[n], standard deviation of one frame, counts. board: i64[n],
        number of the board of each taxel, from 0; None: all taxels are on one board. interval_s: length of an interval,
        seconds. Raises ValueError for a wrong shape or a parameter out of range.
        """
        mean, sigma = (np.array(value, dtype=np.float64) for value in (baseline_mean, noise))
        check_shape("baseline_mean", mean, (1,), None)
        check_shape("noise", sigma, (1,), mean.size)
        if not (np.isfinite(mean).all() and np.isfinite(sigma).all() and (sigma >= 0.0).all()):
            raise ValueError("baseline_mean, noise: expected finite counts; complete the baseline")
        columns = np.zeros(mean.size, np.int64) if board is None else np.array(board, dtype=np.int64)
        check_shape("board", columns, (1,), mean.size)
        if columns.min() < 0:
            raise ValueError(f"board: expected 0 or more, found {columns.min()}")
        self.interval_s = check_positive("interval_s", interval_s)
        self._rest = RestLevel.start(np.maximum(sigma, ROUNDING_SIGMA) ** 2, columns, PER_INTERVAL)
        self._rest.correlated = CORRELATED
        self._rest.level, self._rest.variance = mean, self._rest.noise_variance.copy()
        self._contact = ContactState.start(mean.size)
        self._contact_s = np.zeros(mean.size)
        self._stored: deque[tuple[FloatArray, FloatArray, FloatArray]] = deque(maxlen=STORED)
        self._intervals = 0
        self._unseen = np.zeros(len(self._rest.common))
        self._previous = np.full(mean.size, np.nan)
        self._begin_s: float | None = None
        self._clear()

    def update(
        self, time_s: float, raw_counts: npt.ArrayLike, valid: npt.ArrayLike | None = None
    ) -> TrackedState | None:
        """Add one frame; return the corrected state if this frame starts a new interval, else None.

        time_s: finite, on the clock of the stream; a step back of the clock ends the interval. raw_counts: u16[n].
        valid: bool for the whole frame or bool[n]. Raises ValueError for a wrong shape, dtype or time.
        """
        if not np.isfinite(time_s):
            raise ValueError(f"time_s: expected a finite time, found {time_s}")
        raw = to_raw_count_array(raw_counts, 1, self._total.size)
        mask = to_validity_mask(valid, raw.shape)
        state = None
        if self._begin_s is not None and not 0.0 <= time_s - self._begin_s < self.interval_s:
            elapsed = time_s - self._begin_s if time_s > self._begin_s else self.interval_s
            state = self._end_interval(elapsed)
            self._begin_s = None
        if self._begin_s is None:
            self._begin_s = float(time_s)
        self._total += np.where(mask, raw, 0)
        self._count += mask
        return state

    @property
    def state(self) -> TrackedState:
        """The state after the last complete interval."""
        return TrackedState(
            mean=self._rest.level.copy(),
            sigma=np.sqrt(self._rest.variance),
            is_contact=self._contact.is_contact,
            contact_s=self._contact_s.copy(),
        )

    def _clear(self) -> None:
        """Reset the sums of raw counts and frames for a new interval."""
        self._total: IntArray = np.zeros(len(self._contact_s), np.int64)
        self._count: IntArray = np.zeros(len(self._contact_s), np.int64)

    def _end_interval(self, elapsed_s: float) -> TrackedState:
        """Correct the counts at rest with the summed frames of the interval, and reset the sums; return the new state.

        elapsed_s: time from the start of the interval to the start of the next one, seconds.
        """
        state = self.correct(self._total, self._count, elapsed_s)
        self._clear()
        return state

    def correct(self, total: IntArray, count: IntArray, elapsed_s: float) -> TrackedState:
        """Correct the counts at rest with the frames of an interval that the caller has summed.

        total: i64[n], sum of the raw counts of the valid frames. count: i64[n], number of valid frames. elapsed_s:
        time from the start of the interval to the start of the next one, seconds. Returns the corrected state.
        """
        level = self._rest
        mean = np.where(count > 0, total / np.maximum(count, 1), np.nan)
        was_free = ~self._contact.is_contact
        self._contact, have_ended = self._find_contact(mean, count, elapsed_s)
        is_contact = self._contact.is_contact
        self._contact_s = np.where(is_contact, self._contact_s + elapsed_s, 0.0)
        level.forget(self._contact.has_risen)  # the count at rest was wrong; the next free interval defines a new one
        ceased = self._contact.has_ceased
        level.level[ceased], level.variance[ceased] = (
            self._contact.free_level[ceased],
            self._contact.free_variance[ceased],
        )
        level.unchecked[ceased] = 0.0
        # The level of a taxel that was in contact is uncertain: the taxel takes part in the common change only if all
        # contacts of its board have ended.
        change = np.where(np.isfinite(mean), mean - level.level, 0.0)
        usable = np.isfinite(mean) & level.is_known & ~is_contact
        common = level.find_common(change, usable & (was_free | have_ended[level.board]))
        level.update(mean, count, is_contact, common)
        has_free = np.bincount(level.board, ~is_contact & (count > 0), len(level.common)) > 0
        self._unseen = np.where(has_free, 0.0, self._unseen + elapsed_s / self.interval_s)
        self._estimate_variability(mean, count, is_contact)
        return self.state

    def _find_contact(self, mean: FloatArray, count: IntArray, elapsed_s: float) -> tuple[ContactState, BoolArray]:
        """Return (state of contact after an interval, whether all contacts of each board have ended, bool[s]).

        Four explanations of the interval are compared for each board:

        1. a common change (drift) that the taxels without contact show;
        2. a common change that all taxels show, so that all contacts have ended;
        3. no common change;
        4. no common change, and a contact that begins on many taxels of the board at once.

        The explanation with the largest posterior density is used. A common change is distinguished from a contact of
        the whole board, because it changes all taxels in proportion to their loadings. mean: f64[n], counts, NaN
        without data. count: i64[n], number of frames.
        """
        level = self._rest
        known = np.isfinite(mean)
        change = np.where(known, mean - level.level, 0.0)
        of_free = level.find_common(change, known & ~self._contact.is_contact)
        of_all = level.find_common(change, known)
        none = np.zeros(len(level.common))
        scale = level.settings.common * np.sqrt(self._unseen + max(1.0, elapsed_s / self.interval_s))
        joint = float(np.log(to_probability(CONTACTS_PER_S, elapsed_s)))
        states, posterior = [], []
        for common, begin, prior in (
            (of_free, None, 0.0),
            (of_all, None, 0.0),
            (none, None, 0.0),
            (none, JOINT_CONTACT, joint),
        ):
            states.append(state := self._compute_contact(mean, count, common, elapsed_s, begin))
            # log density of the common change: Student t distribution with the scale of the usual drift
            density = -0.5 * (COMMON_FREEDOM + 1.0) * np.log1p((common / scale) ** 2 / COMMON_FREEDOM)
            posterior.append(prior + density + np.bincount(level.board, state.log_evidence, len(common)))
        chosen = np.argmax(posterior, axis=0)
        return ContactState.select(states, chosen[level.board]), chosen == 1  # 1: index of `of_all`

    def _compute_contact(
        self, mean: FloatArray, count: IntArray, common: FloatArray, elapsed_s: float, begin: float | None
    ) -> ContactState:
        """Return the state of contact after an interval under the assumption of a common change of the boards.

        mean: f64[n], counts. count: i64[n], number of frames. common: f64[s], assumed common change of each board,
        counts. begin: probability that a contact begins; None: the usual one.
        """
        level, change = self._rest, common[self._rest.board]
        measured = level.compute_measured_variance(count)
        variance = level.variance + self._compute_unchecked_variance(common, count) + measured
        shift = level.loading * change
        moved = replace(self._contact, level=self._contact.level + shift, free_level=self._contact.free_level + shift)
        walk = level.settings.walk * elapsed_s / self.interval_s
        residual = mean - level.level - shift
        return moved.update(Interval(mean, residual, variance, measured, walk, elapsed_s, begin))

    def _compute_unchecked_variance(self, common: FloatArray, count: IntArray) -> FloatArray:
        """Compute the variance of the error that drift since a taxel was last free adds to its count at rest.

        The result is f64[n], counts^2. Two errors are multiplied by the whole drift: the error of the taxel's loading
        (its change relative to the common change of its board), and the error of the median loading of the free taxels,
        from which the drift is computed. common: f64[s], common change of the boards in this interval, counts. count:
        i64[n], number of frames.
        """
        level = self._rest
        drift = level.unchecked + common[level.board]
        free = np.bincount(level.board, ~self._contact.is_contact, len(common))[level.board]
        share = MEDIAN_VARIANCE / np.maximum(free, 1.0)
        median_error = share * level.compute_measured_variance(count)
        by_median = np.where(level.unchecked != 0.0, 2.0 * median_error, 0.0)
        return np.asarray(level.loading_variance * drift**2 * (1.0 + share) + by_median)

    def _estimate_variability(self, mean: FloatArray, count: IntArray, is_contact: BoolArray) -> None:
        """Store the changes of this interval, and after every `LEAST_STORED` intervals estimate the variability.

        mean: f64[n], counts. count: i64[n], number of frames. is_contact: bool[n], taxels that are left out.
        """
        level = self._rest
        change = np.where(is_contact, np.nan, mean - self._previous - level.loading * level.common[level.board])
        self._previous = np.where(is_contact, np.nan, mean)
        if np.isfinite(change).any():
            self._stored.append((change, level.noise_variance / np.maximum(count, 1), level.common.copy()))
        self._intervals += 1
        if self._intervals % LEAST_STORED == 0 and len(self._stored) >= LEAST_STORED:
            changes, noise, common = zip(*self._stored, strict=True)
            level.settings = estimate_slow_settings(changes, noise, common, LONG_LAG)
