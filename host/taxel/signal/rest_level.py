"""Count at rest of each taxel, tracked from step to step.

Temperature changes all taxels of a board together, each with a factor of its own (its loading). The common part of a
board (a median, which a fault of some taxels does not move) is followed at once, and the loadings are estimated by
recursive least squares. The rest is a level that changes slowly and is measured with an error: a Kalman filter of a
local level (Durbin and Koopman, Time Series Analysis by State Space Methods, 2012, section 2.2), whose prediction
errors are independent from step to step.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from taxel.signal.noise import MAD_TO_SIGMA
from taxel.types import BoolArray, FloatArray, IntArray

CLIPPED: Final = 3.0
"""Largest deviation that a level and a loading follow, in standard deviations: a single disturbed interval moves them
little."""

LOADING_VARIANCE: Final = 0.25
"""Prior variance of a loading, whose prior mean is 1 (assumed: half of the taxels differ by less than a third)."""

LEAST_LOADING: Final = 0.2
"""Smallest loading of a taxel that takes part in the median: a smaller one would amplify its noise fivefold."""

LEAST_WALK: Final = 1e-3
"""Smallest variance of the change of a level in a step, counts^2: the filter never stops following."""

LEAST_COMMON: Final = 0.3
"""Smallest standard deviation of the common change of a board, counts: the rounding of a count."""

UNKNOWN_VARIANCE: Final = 1e8
"""Variance of a level that no step has defined, counts^2: wider than the range of a count."""


@dataclass(frozen=True)
class RestSettings:
    """Variability of a skin's counts at rest from one step to the next.

    measured: variance of a step's mean beyond the noise of its frames, which is not white, counts^2. walk: variance of
    the change of a level, counts^2. common: standard deviation of the common change of a board, counts.
    """

    measured: float = 0.25
    walk: float = 0.05
    common: float = 3.0


@dataclass(eq=False)
class RestLevel:
    """Tracked count at rest of n taxels.

    noise_variance: f64[n], of one frame. board: i64[n]. loading: f64[n], change of a taxel relative to the common
    change of its board. loading_variance: f64[n], of its estimate. correlated: successive deviations that count as one
    in the estimate of a loading. level, variance: f64[n], counts and counts^2.
    unchecked: f64[n], common change since a taxel's own deviation was used last, counts. common: f64[s], change that
    the taxels of each board shared in the latest step, counts. idle_s: f64[s], time since
    the last step in which the board was compared.
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
        """Begin without a level: the first step of a taxel defines it."""
        self.level = np.zeros(len(self.board))
        self.variance = np.full(len(self.board), UNKNOWN_VARIANCE)
        self.unchecked = np.zeros(len(self.board))
        self.common = np.zeros(int(self.board.max()) + 1)
        self.idle_s = np.zeros(len(self.common))

    @classmethod
    def start(cls, noise_variance: FloatArray, board: IntArray, settings: RestSettings = RestSettings()) -> RestLevel:
        """Create the level of a skin without experience. noise_variance: f64[n]. board: i64[n]."""
        return cls(noise_variance, board, np.ones(len(board)), np.full(len(board), LOADING_VARIANCE), settings=settings)

    @property
    def is_known(self) -> BoolArray:
        """Whether a step has defined the level of each taxel, bool[n]."""
        return np.asarray(self.variance < UNKNOWN_VARIANCE)

    def find_touched(self, mean: FloatArray, lowest: FloatArray, threshold: float) -> BoolArray:
        """Taxels of boards on which a taxel is active without an announced contact, bool[n].

        mean, lowest: f64[n], count at rest of a step, and its lowest count. threshold: counts of signal of an active
        taxel. A change that more than half of the taxels of a board share is a change of the board and not a contact.
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
        """Update the levels with the means f64[n] of a step; return prediction errors and their variances, f64[n] each.

        count: i64[n], averaged frames. skip: bool[n], taxels whose own deviation is not used. common: f64[s], change of
        the boards; None: the median of their taxels. A taxel without a known level has an error of 0 and a variance of
        at least `UNKNOWN_VARIANCE`.
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
        # The error of a loading acts on the whole change since the taxel's own deviation was used.
        predicted = self.variance + max(self.settings.walk, LEAST_WALK)
        settled = predicted + self.loading_variance * self.unchecked**2
        # The loadings are those of temperature. A faster common change may have another origin and other factors.
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
        """Variance of the mean of `count` i64[n] frames around the level, f64[n], counts^2."""
        return np.asarray(self.noise_variance / np.maximum(count, 1) + self.settings.measured)

    def forget(self, taxels: BoolArray) -> None:
        """Expect nothing of the taxels bool[n]: the next step defines their level."""
        self.variance[taxels] = UNKNOWN_VARIANCE

    def find_common(self, change: FloatArray, usable: BoolArray) -> FloatArray:
        """Median change of the usable taxels of each board at a loading of 1, f64[s]; 0 without one."""
        ratio = change / np.maximum(self.loading, LEAST_LOADING)
        found = []
        for number in range(int(self.board.max()) + 1):
            own = usable & (self.board == number) & (self.loading > LEAST_LOADING)
            found.append(float(np.median(ratio[own])) if own.any() else 0.0)
        return np.array(found)


def estimate_settings(
    changes: Sequence[FloatArray], noise: Sequence[FloatArray], common: Sequence[FloatArray]
) -> RestSettings:
    """Estimate the variability from the changes of counts at rest from step to step.

    changes: f64[n] of each step without the common part, NaN where unknown. noise: f64[n], variance of each mean from
    the noise of its frames. common: f64[s], common changes.
    A change of a level with variance walk that is measured with variance R has the variance walk + 2 R and, to the next
    change, the covariance -R. Medians over the taxels keep disturbed taxels out.
    """
    if len(changes) < 3:
        return RestSettings()
    values, own = np.stack(changes), np.stack(noise)
    usable = np.isfinite(values).all(axis=0)
    if not usable.any():
        return RestSettings()
    values, own = values[:, usable], own[:, usable]
    square = float(np.median(np.mean(values**2, axis=0)))
    product = float(np.median(np.mean(values[1:] * values[:-1], axis=0)))
    measured = min(max(-product, 0.0), 0.5 * square)
    white = float(np.median(own))
    usual = MAD_TO_SIGMA * float(np.median(np.abs(np.stack(common))))
    return RestSettings(max(measured - white, 0.0), max(square - 2.0 * measured, LEAST_WALK), max(usual, LEAST_COMMON))


def estimate_slow_settings(
    changes: Sequence[FloatArray], noise: Sequence[FloatArray], common: Sequence[FloatArray], lag: int
) -> RestSettings:
    """Estimate the variability from changes over one step and over `lag` steps; arguments as for `estimate_settings`.

    The change over k steps has the variance k walk + 2 R. With 1/f noise, changes of neighbouring steps alone would
    give a walk that is too large for a long time.
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
    """Mean square change over `lag` steps, f64[K, n] changes of one step: median over the taxels; NaN without one."""
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
