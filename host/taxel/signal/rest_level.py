"""Count at rest of each taxel, tracked from step to step.

The count at rest (the level) is the expected count of an untouched taxel; a step is one measurement of mean counts.
Temperature changes the levels of all taxels of a board together, each with a factor of its own (its loading). The
common change of a board is the median over its taxels, which a fault of some taxels does not move. The levels follow
the common change at once, and the loadings are estimated by recursive least squares. The remaining change of a level is
slow and is measured with an error; it is followed by a Kalman filter of a local level (Durbin and Koopman, Time Series
Analysis by State Space Methods, 2012, section 2.2), whose prediction errors are independent from step to step.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from taxel.signal.noise import MAD_TO_SIGMA
from taxel.types import BoolArray, FloatArray, IntArray

CLIPPED: Final = 3.0
"""Largest deviation that a level and a loading follow, in standard deviations, so that a single disturbed step hardly
changes them."""

LOADING_VARIANCE: Final = 0.25
"""Prior variance of a loading, whose prior mean is 1 (assumed: half of the taxels differ by less than a third)."""

LEAST_LOADING: Final = 0.2
"""Smallest loading of a taxel that takes part in the median: a smaller one would amplify its noise fivefold."""

LEAST_WALK: Final = 1e-3
"""Smallest variance of the change of a level in a step, counts^2; with 0 the filter would stop following the level."""

LEAST_COMMON: Final = 0.3
"""Smallest standard deviation of the common change of a board, counts: the rounding of a count."""

UNKNOWN_VARIANCE: Final = 1e8
"""Variance of a level that no step has defined, counts^2: wider than the range of a count."""


@dataclass(frozen=True)
class RestSettings:
    """Variability of a skin's counts at rest from one step to the next.

    measured: variance of a step's mean in addition to the white noise of its frames, counts^2. walk: variance of the
    change of a level in a step, counts^2. common: standard deviation of the common change of a board in a step, counts.
    """

    measured: float = 0.25
    walk: float = 0.05
    common: float = 3.0


@dataclass(eq=False)
class RestLevel:
    """Tracked count at rest of n taxels.

    noise_variance: f64[n], variance of the noise of one frame, counts^2. board: i64[n], number of the board of each
    taxel, from 0. loading: f64[n], change of a taxel relative to the common change of its board. loading_variance:
    f64[n], variance of the error of the loading. correlated: number of successive deviations that are treated as one in
    the estimate of a loading. level, variance: f64[n], count at rest and variance of its error, counts^2. unchecked:
    f64[n], sum of the common changes since the deviation of the taxel itself was last used, counts. common: f64[s],
    common change of each board in the latest step, counts. idle_s: f64[s], time since the last step in which each board
    was compared, seconds.
    """

    noise_variance: FloatArray
    board: IntArray
    loading: FloatArray
    loading_variance: FloatArray
    settings: RestSettings = RestSettings()
    correlated: float = 1.0
    level: FloatArray = field(init=False)
    variance: FloatArray = field(init=False)
    unchecked: FloatArray = field(init=False)
    common: FloatArray = field(init=False)
    idle_s: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        """Start without known levels; the first step with data of a taxel defines its level."""
        self.level = np.zeros(len(self.board))
        self.variance = np.full(len(self.board), UNKNOWN_VARIANCE)
        self.unchecked = np.zeros(len(self.board))
        self.common = np.zeros(int(self.board.max()) + 1)
        self.idle_s = np.zeros(len(self.common))

    @classmethod
    def start(cls, noise_variance: FloatArray, board: IntArray, settings: RestSettings = RestSettings()) -> RestLevel:
        """Return the start state of a skin whose loadings have not been estimated yet.

        noise_variance: f64[n], variance of one frame, counts^2. board: i64[n], board of each taxel.
        """
        return cls(noise_variance, board, np.ones(len(board)), np.full(len(board), LOADING_VARIANCE), settings=settings)

    @property
    def is_known(self) -> BoolArray:
        """Whether a step has defined the level of each taxel, bool[n]."""
        return np.asarray(self.variance < UNKNOWN_VARIANCE)

    def find_touched(self, mean: FloatArray, lowest: FloatArray, threshold: float) -> BoolArray:
        """Return the taxels of all boards that are touched in a step without an announced contact, bool[n].

        A board is touched if at least one of its taxels is active. The common change of the board, multiplied by the
        loading of the taxel (its relative response to this change), does not count as signal. Taxels of a board whose
        common change reaches the threshold are not returned: such a change is a change of the board and no contact.

        mean, lowest: f64[n], mean and lowest count of each taxel in the step. threshold: signal above which a taxel is
        active, counts.
        """
        usable = self.is_known & np.isfinite(mean)
        common = self.find_common(np.where(usable, self.level - mean, 0.0), usable)
        change = np.where(usable, self.level - lowest, 0.0)
        active = change - (self.loading * common[self.board]) > threshold
        boards = np.bincount(self.board, active, len(common)) > 0
        return np.asarray((boards & (np.abs(common) < threshold))[self.board])

    def update(
        self, mean: FloatArray, count: IntArray, skip: BoolArray, common: FloatArray | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Update the levels with the means of a step; return (prediction errors, their variances), f64[n] each.

        A level is expected to change by the common change of its board times the loading of the taxel. A Kalman filter
        corrects level and loading by the deviation from the expected mean, which is clipped at `CLIPPED` standard
        deviations.

        mean: f64[n], NaN without data. count: i64[n], number of averaged frames. skip: bool[n], taxels that only follow
        the common change of their board, such as taxels in contact. common: f64[s], common change of the boards; None:
        the median of their taxels. A taxel without a known level has an error of 0 and a variance of at least
        `UNKNOWN_VARIANCE`.
        """
        finite = np.isfinite(mean) & ~skip
        known = self.is_known
        usable = finite & known
        change = np.where(usable, mean - self.level, 0.0)
        self.common = self.find_common(change, usable) if common is None else common
        shared = self.common[self.board]
        expected = np.where(known, self.loading * shared, 0.0)
        residual = np.where(usable, change - expected, 0.0)
        measured = self.compute_measured_variance(count)
        # `unchecked` is the common change since the taxel's own deviation was last used. The error of the loading acts
        # on this whole change.
        predicted = self.variance + max(self.settings.walk, LEAST_WALK)
        settled = predicted + self.loading_variance * self.unchecked**2
        # The loadings describe the response to temperature. A faster common change may have another cause, to which the
        # taxels respond with other factors.
        unusual = np.maximum(np.abs(shared) - CLIPPED * self.settings.common, 0.0)
        total = settled + measured + self.loading_variance * shared**2 + LOADING_VARIANCE * unusual**2
        bound = CLIPPED * np.sqrt(total)
        followed = np.clip(residual, -bound, bound)
        self.level += expected + np.where(usable, settled / total, 0.0) * followed
        self.variance = np.where(usable, settled * (1.0 - settled / total), np.minimum(predicted, UNKNOWN_VARIANCE))
        gain = np.where(
            usable, self.loading_variance * shared / (self.correlated * total + self.loading_variance * shared**2), 0.0
        )
        self.loading += gain * followed
        self.loading_variance *= 1.0 - gain * shared
        self.unchecked = np.where(finite, 0.0, self.unchecked + shared)
        first = finite & ~known
        self.level[first], self.variance[first] = mean[first], measured[first]
        return residual, np.asarray(total)

    def compute_measured_variance(self, count: IntArray) -> FloatArray:
        """Compute the variance of a step's mean around the level, f64[n], counts^2. count: i64[n], averaged frames."""
        return np.asarray(self.noise_variance / np.maximum(count, 1) + self.settings.measured)

    def forget(self, taxels: BoolArray) -> None:
        """Mark the levels of the taxels bool[n] as unknown, so that the next step defines them."""
        self.variance[taxels] = UNKNOWN_VARIANCE

    def find_common(self, change: FloatArray, usable: BoolArray) -> FloatArray:
        """Return the common change of each board, f64[s]: median over its usable taxels of change divided by loading.

        0 for a board without a usable taxel. change: f64[n], counts. usable: bool[n].
        """
        ratio = change / np.maximum(self.loading, LEAST_LOADING)
        common = []
        for number in range(int(self.board.max()) + 1):
            of_board = usable & (self.board == number) & (self.loading > LEAST_LOADING)
            common.append(float(np.median(ratio[of_board])) if of_board.any() else 0.0)
        return np.array(common)


def estimate_settings(
    changes: Sequence[FloatArray], noise: Sequence[FloatArray], common: Sequence[FloatArray]
) -> RestSettings:
    """Estimate the variability of counts at rest (`RestSettings`) from the changes of the counts from step to step.

    changes: for each step f64[n], changes of the means without the common part, counts, NaN where unknown. noise: for
    each step f64[n], variance of the mean by the white noise of its frames. common: for each step f64[s], common
    changes. With R as the variance of a measured mean, the change of a level has the variance walk + 2 R, and its
    covariance with the next change is -R. Medians over the taxels exclude disturbed taxels. Fewer than 3 steps give the
    default settings.
    """
    if len(changes) < 3:
        return RestSettings()
    values, noise_variances = np.stack(changes), np.stack(noise)
    usable = np.isfinite(values).all(axis=0)
    if not usable.any():
        return RestSettings()
    values, noise_variances = values[:, usable], noise_variances[:, usable]
    square = float(np.median(np.mean(values**2, axis=0)))
    product = float(np.median(np.mean(values[1:] * values[:-1], axis=0)))
    measured = min(max(-product, 0.0), 0.5 * square)
    white = float(np.median(noise_variances))
    usual = MAD_TO_SIGMA * float(np.median(np.abs(np.stack(common))))
    return RestSettings(max(measured - white, 0.0), max(square - 2.0 * measured, LEAST_WALK), max(usual, LEAST_COMMON))


def estimate_slow_settings(
    changes: Sequence[FloatArray], noise: Sequence[FloatArray], common: Sequence[FloatArray], lag: int
) -> RestSettings:
    """Estimate the variability of counts at rest (`RestSettings`) from changes over one step and over `lag` steps.

    changes: for each step f64[n], changes of the means of the taxels without the common part, counts, NaN where
    unknown. noise: for each step f64[n], variance of the mean by the white noise of its frames. common: for each step
    f64[s], changes that the taxels of each board have in common. lag: number of steps.

    With R as the variance of a measured mean, the change over k steps has the variance k walk + 2 R. R consists of the
    white noise, which is subtracted, and of slower noise, which the settings contain. With 1/f noise, changes of
    neighbouring steps alone would give a value of walk that is too large over long times. The default settings are
    returned if no taxel has `lag` successive known changes.
    """
    values = np.stack(changes)
    short = _compute_mean_square(values, 1)
    long = _compute_mean_square(values, lag)
    if not (np.isfinite(short) and np.isfinite(long)):
        return RestSettings()
    walk = max((long - short) / (lag - 1), LEAST_WALK)
    measured = max(0.5 * (short - walk), 0.0)
    usual = MAD_TO_SIGMA * float(np.median(np.abs(np.stack(common))))
    return RestSettings(max(measured - float(np.nanmedian(np.stack(noise))), 0.0), walk, max(usual, LEAST_COMMON))


def _compute_mean_square(changes: FloatArray, lag: int) -> float:
    """Compute the mean square of each taxel's change over `lag` steps, and return the median over the taxels.

    changes: f64[K, n], changes over one step, NaN where unknown. NaN if no taxel has `lag` successive known changes.
    """
    known = np.isfinite(changes)
    total, count = (
        np.cumsum(np.vstack([np.zeros(changes.shape[1]), part]), axis=0)
        for part in (np.where(known, changes, 0.0), known)
    )
    sums, complete = total[lag:] - total[:-lag], count[lag:] - count[:-lag] == lag
    number = complete.sum(axis=0)
    enough = number > 0
    if not enough.any():
        return float("nan")
    squares = np.where(complete, sums**2, 0.0).sum(axis=0)
    return float(np.median(squares[enough] / number[enough]))
