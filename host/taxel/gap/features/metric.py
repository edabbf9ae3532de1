"""Gap, floor and excess in counts, with intervals from the sessions.

gap^2 is the weighted mean squared difference of the cells' means; floor^2 the variance of the real means that repeats
and sessions alone cause; excess = gap^2 - floor^2. With D_s the difference in session s, the excess is the mean of
D_s D_t over s != t: what two sessions have in common is no scatter.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.gap.features.chances import compute_student_survival, student_quantile
from taxel.gap.features.features import Layout, SessionMeans
from taxel.types import FloatArray

SIDES: Final = (0.025, 0.975)
"""Quantiles between which 95 % lie."""


@dataclass(frozen=True, eq=False)
class Terms:
    """Where gap and floor come from, counts^2: f64[C, F, n], weighted; their sums over F, means over C and n, are gap^2
    and floor^2.
    """

    gap2: FloatArray
    floor2: FloatArray

    @property
    def excess(self) -> FloatArray:
        """f64[C, F, n]."""
        return self.gap2 - self.floor2


@dataclass(frozen=True)
class Interval:
    """A value and what is known of it: 95 % interval (None below 3 sessions), standard error and its degrees of
    freedom.
    """

    value: float
    low: float | None
    high: float | None
    error: float | None
    degrees_of_freedom: float = np.inf

    @property
    def ci95(self) -> list[float] | None:
        """For the report."""
        return None if self.low is None or self.high is None else [self.low, self.high]

    @property
    def positive(self) -> Interval:
        """Of what cannot be below 0."""
        return replace(self, low=None if self.low is None else max(self.low, 0.0))

    def at_least(self, draws: FloatArray) -> Interval:
        """On each side as wide as what holds 95 % of draws f64[d] of the value: what scatters is in them as well, so
        that they are no further error. No draws, or no interval: the same.
        """
        if self.low is None or self.high is None or not len(draws):
            return self
        below, above = np.abs(np.quantile(draws, SIDES) - self.value)
        return replace(self, low=min(self.low, self.value - below), high=max(self.high, self.value + above))


def terms(real: SessionMeans, model: FloatArray, layout: Layout) -> Terms:
    """Terms of gap and floor. model: f64[C, F, n], counts.

    A feature that is unknown on either side tells nothing: its terms are 0.
    """
    weight = layout.weight[:, None]
    number = np.maximum(real.known.sum(axis=1), 1)
    gap2 = np.nan_to_num(weight * (real.mean - model) ** 2)
    floor2 = np.where(np.isfinite(real.mean - model), np.nan_to_num(weight * real.variance / number), 0.0)
    return Terms(gap2, floor2)


def off_diagonal(gram: FloatArray) -> FloatArray:
    """Mean over s != t of products f64[..., S, S]: the excess, f64[...]. With one session, the product itself."""
    sessions = gram.shape[-1]
    if sessions < 2:
        return np.asarray(gram.sum(axis=(-1, -2)))
    return np.asarray((gram.sum(axis=(-1, -2)) - np.trace(gram, axis1=-2, axis2=-1)) / (sessions * (sessions - 1)))


def leave_one_out(sessions: int) -> list[NDArray[np.bool_]]:
    """Which sessions stay, each left out in turn, bool[S]."""
    return [np.arange(sessions) != s for s in range(sessions)]


def total(term: FloatArray) -> float:
    """Sum over features, mean over cells and taxels, counts^2."""
    return float(term.sum(axis=1).mean())


def gap_of_change(change: FloatArray, layout: Layout) -> float:
    """Gap in counts that a change of the features f64[C, F, n] produces; 0 where a feature is unknown."""
    return float(np.sqrt(total(layout.weight[:, None] * change**2)))


def jackknife_error(values: FloatArray) -> FloatArray:
    """Standard error of what was worked out without one of its S parts each (Tukey 1958). values: f64[S, ...]."""
    count = len(values)
    return np.asarray(np.sqrt((count - 1) / count * np.sum((values - values.mean(axis=0)) ** 2, axis=0)))


def jackknife(values: FloatArray, whole: float) -> Interval:
    """T interval on the jackknife over sessions (Tukey 1958). values: f64[S], each without one session."""
    count = len(values)
    if count < 3:
        return Interval(whole, None, None, None)
    error = float(jackknife_error(values))
    half = student_quantile(0.975, count - 1) * error
    return Interval(whole, whole - half, whole + half, error, count - 1)


def together(first: Interval, other: Interval, besides: float = 0.0) -> Interval:
    """The interval of a value whose error has independent parts, with the degrees of freedom of their sum (Welch 1947);
    no interval where the first is not known. besides: standard error of a third, known for sure.
    """
    if first.error is None:
        return first
    errors2 = np.array([first.error, other.error or 0.0, besides]) ** 2
    total2 = float(errors2.sum())
    if total2 == 0.0:
        return Interval(first.value, first.value, first.value, 0.0)
    degrees_of_freedom = total2**2 / float(
        np.sum(errors2**2 / np.array([first.degrees_of_freedom, other.degrees_of_freedom, np.inf])) or 1e-300
    )
    half = student_quantile(0.975, degrees_of_freedom) * float(np.sqrt(total2))
    return Interval(first.value, first.value - half, first.value + half, float(np.sqrt(total2)), degrees_of_freedom)


def root(interval: Interval) -> Interval:
    """The interval of a square as that of its root; what is below 0 becomes 0."""
    low, high = (None if end is None else float(np.sqrt(max(end, 0.0))) for end in (interval.low, interval.high))
    return Interval(float(np.sqrt(max(interval.value, 0.0))), low, high, None)


def upper_bound(interval: Interval, sessions: int) -> float:
    """One-sided 95 % bound above; the value itself below 3 sessions."""
    if interval.error is None:
        return interval.value
    return interval.value + student_quantile(0.95, sessions - 1) * interval.error


@dataclass(frozen=True, eq=False)
class Gap:
    """gap, floor: counts. gap2, excess: counts^2 with intervals; most: upper bound of the excess. p_value: of an excess
    this large without any.
    """

    gap: Interval
    floor: float
    excess: Interval
    most: float
    p_value: float
    terms: Terms


def measure(real: SessionMeans, model: FloatArray, layout: Layout) -> Gap:
    """Gap, floor and excess of a model, f64[C, F, n], against the real sessions."""
    whole = terms(real, model, layout)
    sessions = real.value.shape[1]
    left = [terms(real.only(stay), model, layout) for stay in leave_one_out(sessions)] if sessions >= 3 else []
    gap2 = jackknife(np.array([total(part.gap2) for part in left]), total(whole.gap2))
    excess = jackknife(np.array([total(part.excess) for part in left]), total(whole.excess))
    floor = float(np.sqrt(max(total(whole.floor2), 0.0)))
    return Gap(root(gap2), floor, excess, upper_bound(excess, sessions), _p_value(excess, sessions), whole)


def shrink(before2: float, after2: float) -> float:
    """(before - after) / before of squared gaps."""
    return float(1.0 - np.sqrt(after2 / before2)) if before2 > 0 else 0.0


def shrink_by(real: SessionMeans, before: FloatArray, after: FloatArray, layout: Layout) -> Interval:
    """Shrink of the gap from one model to another, f64[C, F, n] each, with its interval."""

    def of(sessions: SessionMeans) -> float:
        return shrink(*(total(terms(sessions, model, layout).gap2) for model in (before, after)))

    return jackknife(np.array([of(real.only(stay)) for stay in leave_one_out(real.value.shape[1])]), of(real))


def _p_value(excess: Interval, sessions: int) -> float:
    if excess.error is None:
        return 1.0 if excess.value <= 0 else 0.5
    if excess.error == 0:
        return 0.0 if excess.value > 0 else 1.0
    return compute_student_survival(excess.value / excess.error, sessions - 1)
