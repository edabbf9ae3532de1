"""Gap, floor and excess in counts, with intervals from the sessions (docs/gap-diagnosis.md).

gap^2 is the weighted mean squared difference of the means of the conditions. floor^2 is the variance of the real means
that repeats and sessions alone cause. excess = gap^2 - floor^2. With the difference D_s in session s, the excess equals
the mean of D_s D_t over s != t: only the part of the difference that sessions have in common contributes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.gap.features.distributions import compute_student_quantile, compute_student_survival
from taxel.gap.features.features import FeatureLayout, SessionMeans
from taxel.types import FloatArray

SIDES: Final = (0.025, 0.975)
"""Probabilities of the quantiles that limit a central interval of 95 %."""


@dataclass(frozen=True, eq=False)
class GapTerms:
    """Weighted parts of gap^2 and floor^2 for each feature of each taxel in each condition, counts^2, f64[C, F, n] (C
    conditions, F features, n taxels).

    The sum over features of the mean over conditions and taxels is gap^2 or floor^2.
    """

    gap2: FloatArray
    floor2: FloatArray

    @property
    def excess(self) -> FloatArray:
        """Weighted parts of the excess, counts^2, f64[C, F, n] (C conditions, F features, n taxels)."""
        return self.gap2 - self.floor2


@dataclass(frozen=True)
class Interval:
    """A value with its 95 % interval (None below 3 sessions), standard error and degrees of freedom of the error."""

    value: float
    low: float | None
    high: float | None
    error: float | None
    degrees_of_freedom: float = np.inf

    @property
    def ci95(self) -> list[float] | None:
        """Lower and upper end of the interval for the report, or None."""
        return None if self.low is None or self.high is None else [self.low, self.high]

    @property
    def non_negative(self) -> Interval:
        """The interval of a value that cannot be negative: the lower end is at least 0."""
        return replace(self, low=None if self.low is None else max(self.low, 0.0))

    def widen_to_samples(self, samples: FloatArray) -> Interval:
        """Return the interval, widened to contain the central 95 % of the samples f64[d] of the value.

        The samples also contain the variance of the data. Therefore the wider of the two intervals is used, and the
        variances are not added. Without samples, or without an interval, the result is this object itself.
        """
        if self.low is None or self.high is None or not len(samples):
            return self
        low, high = np.quantile(samples, SIDES).tolist()
        return replace(self, low=min(self.low, low), high=max(self.high, high))


def compute_terms(real: SessionMeans, model: FloatArray, layout: FeatureLayout) -> GapTerms:
    """Return the parts of gap^2 and floor^2. model: features of the simulator, f64[C, F, n] (C conditions, F features,
    n taxels), counts.

    The parts of a feature that is unknown on either side are 0.
    """
    weight = layout.weight[:, None]
    number = np.maximum(real.is_known.sum(axis=1), 1)
    gap2 = np.nan_to_num(weight * (real.mean - model) ** 2)
    floor2 = np.where(np.isfinite(real.mean - model), np.nan_to_num(weight * real.variance / number), 0.0)
    return GapTerms(gap2, floor2)


def compute_off_diagonal_mean(gram: FloatArray) -> FloatArray:
    """Return the mean product of the residuals of two different sessions, which is the excess, f64[...].

    gram: f64[..., S, S], products of the residuals of each pair of sessions. With one session, the result is the
    product of its residuals with themselves.
    """
    sessions = gram.shape[-1]
    if sessions < 2:
        return np.asarray(gram.sum(axis=(-1, -2)))
    return np.asarray((gram.sum(axis=(-1, -2)) - np.trace(gram, axis1=-2, axis2=-1)) / (sessions * (sessions - 1)))


def make_leave_one_out_masks(sessions: int) -> list[NDArray[np.bool_]]:
    """Return one mask bool[S] for each session, which excludes this session."""
    return [np.arange(sessions) != s for s in range(sessions)]


def sum_terms(term: FloatArray) -> float:
    """Return the sum over features of the mean over conditions and taxels, counts^2.

    term: f64[C, F, n] (C conditions, F features, n taxels), weighted parts of a squared gap (`GapTerms`).
    """
    return float(term.sum(axis=1).mean())


def compute_gap_of_change(change: FloatArray, layout: FeatureLayout) -> float:
    """Return the gap in counts that a change of the features produces.

    change: f64[C, F, n] (C conditions, F features, n taxels), counts, with 0 for unknown features.
    """
    return float(np.sqrt(sum_terms(layout.weight[:, None] * change**2)))


def compute_jackknife_error(values: FloatArray) -> FloatArray:
    """Return the jackknife standard error (Tukey 1958) of a value over S sessions.

    values: f64[S, ...], replicates: each is computed without one of the sessions.
    """
    count = len(values)
    return np.asarray(np.sqrt((count - 1) / count * np.sum((values - values.mean(axis=0)) ** 2, axis=0)))


def compute_jackknife_interval(values: FloatArray, whole: float) -> Interval:
    """Return the t interval from the jackknife over sessions (Tukey 1958), with S - 1 degrees of freedom.

    values: f64[S], replicates: each is computed without one of the sessions. whole: the value from all sessions. With
    fewer than 3 replicates the result has no interval.
    """
    count = len(values)
    if count < 3:
        return Interval(whole, None, None, None)
    error = float(compute_jackknife_error(values))
    half = compute_student_quantile(0.975, count - 1) * error
    return Interval(whole, whole - half, whole + half, error, count - 1)


def combine_errors(first: Interval, other: Interval, further_error: float = 0.0) -> Interval:
    """Return the interval of the value of `first` whose error variance is the sum of independent error variances.

    The degrees of freedom are those of the sum (Welch 1947). other: interval whose error is added. further_error:
    standard error that is added, with infinite degrees of freedom. If `first` has no error, the result is `first`
    itself.
    """
    if first.error is None:
        return first
    errors2 = np.array([first.error, other.error or 0.0, further_error]) ** 2
    total2 = float(errors2.sum())
    if total2 == 0.0:
        return Interval(first.value, first.value, first.value, 0.0)
    degrees_of_freedom = total2**2 / float(
        np.sum(errors2**2 / np.array([first.degrees_of_freedom, other.degrees_of_freedom, np.inf])) or 1e-300
    )
    half = compute_student_quantile(0.975, degrees_of_freedom) * float(np.sqrt(total2))
    return Interval(first.value, first.value - half, first.value + half, float(np.sqrt(total2)), degrees_of_freedom)


def compute_root_interval(interval: Interval) -> Interval:
    """Return the interval of the root of a value, with negative values replaced by 0 and without a standard error."""
    low, high = (None if end is None else float(np.sqrt(max(end, 0.0))) for end in (interval.low, interval.high))
    return Interval(float(np.sqrt(max(interval.value, 0.0))), low, high, None)


def compute_upper_bound(interval: Interval, sessions: int) -> float:
    """Return the one-sided upper 95 % bound of a value; the value itself below 3 sessions."""
    if interval.error is None:
        return interval.value
    return interval.value + compute_student_quantile(0.95, sessions - 1) * interval.error


@dataclass(frozen=True, eq=False)
class Gap:
    """Size of the gap.

    gap, floor: counts. excess: counts^2. excess_bound: one-sided upper 95 % bound of the excess, counts^2. p_value:
    probability of an excess at least this large if the expected excess is 0. terms: parts of gap and floor.
    """

    gap: Interval
    floor: float
    excess: Interval
    excess_bound: float
    p_value: float
    terms: GapTerms


def measure_gap(real: SessionMeans, model: FloatArray, layout: FeatureLayout) -> Gap:
    """Return gap, floor and excess between the real sessions and predicted features. model: f64[C, F, n] (C conditions,
    F features, n taxels), counts.
    """
    whole = compute_terms(real, model, layout)
    sessions = real.value.shape[1]
    replicates = (
        [compute_terms(real.select_sessions(stay), model, layout) for stay in make_leave_one_out_masks(sessions)]
        if sessions >= 3
        else []
    )
    gap2 = compute_jackknife_interval(np.array([sum_terms(part.gap2) for part in replicates]), sum_terms(whole.gap2))
    excess = compute_jackknife_interval(
        np.array([sum_terms(part.excess) for part in replicates]), sum_terms(whole.excess)
    )
    floor = float(np.sqrt(max(sum_terms(whole.floor2), 0.0)))
    return Gap(
        compute_root_interval(gap2),
        floor,
        excess,
        compute_upper_bound(excess, sessions),
        _compute_p_value(excess, sessions),
        whole,
    )


def compute_shrink(before2: float, after2: float) -> float:
    """Return the relative reduction of the gap, (before - after) / before, from squared gaps; 0 if there is no gap."""
    return float(1.0 - np.sqrt(after2 / before2)) if before2 > 0 else 0.0


def compute_shrink_interval(
    real: SessionMeans, before: FloatArray, after: FloatArray, layout: FeatureLayout
) -> Interval:
    """Return the shrink of the gap from one prediction to another, with its interval over the sessions.

    before, after: features of the two predictions, f64[C, F, n] (C conditions, F features, n taxels), counts.
    """

    def compute_value(sessions: SessionMeans) -> float:
        return compute_shrink(*(sum_terms(compute_terms(sessions, model, layout).gap2) for model in (before, after)))

    return compute_jackknife_interval(
        np.array([compute_value(real.select_sessions(stay)) for stay in make_leave_one_out_masks(real.value.shape[1])]),
        compute_value(real),
    )


def _compute_p_value(excess: Interval, sessions: int) -> float:
    """Return the one-sided p-value of the excess against 0 (t test).

    Without a standard error the p-value is 0.5 for a positive excess, otherwise 1.
    """
    if excess.error is None:
        return 1.0 if excess.value <= 0 else 0.5
    if excess.error == 0:
        return 0.0 if excess.value > 0 else 1.0
    return compute_student_survival(excess.value / excess.error, sessions - 1)
