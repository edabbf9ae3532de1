"""Probability that a taxel is in contact, from the mean counts of successive intervals.

A hidden Markov model with the states free and contact (forward algorithm: Rabiner, Proc. IEEE 77 (1989) 257). Without
contact the count is the expected count at rest. In contact it stays near the count of the interval before (a Kalman
filter of a local level), or changes to another force. A count above the one at rest is no contact: contact lowers a
count. Such a rise means that the taxel was touched while its baseline was taken, or that its board has changed.

A rare deviation of the noise can look like a light contact. Beside a contact, a second filter therefore follows the
count as if there had been none; when this history becomes more probable, the contact is withdrawn.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Final

import numpy as np

from taxel.types import BoolArray, FloatArray, IntArray

CONTACTS_PER_S: Final = 1.0 / 60.0
"""Rate at which a contact begins on a taxel (assumed: one in a minute)."""

CHANGES_PER_S: Final = 1.0 / 60.0
"""Rate at which a contact ends, and rate at which its force changes (assumed: a grasp of a minute)."""

RISES_PER_S: Final = 1.0 / 3600.0
"""Rate at which the count at rest rises by itself (assumed: once in an hour)."""

USUAL_SIGNAL: Final = 300.0
"""Mean signal of a contact, counts (assumed: twice the activation threshold). The signal has a gamma distribution of
shape 2: signals near 0 are rare."""

CONTACT_WALK: Final = 0.01
"""Variance of the change of a constant contact in a second, counts^2, beyond that of the count at rest (assumed: creep
of the layer)."""

TINY: Final = float(np.finfo(np.float64).tiny)

LEAST_PROBABILITY: Final = 1e-9
"""Probability that each state keeps, so that rounding never excludes a state."""


@dataclass(frozen=True, eq=False)
class Interval:
    """Measurement of an interval for n taxels.

    mean: f64[n], mean counts, NaN without data: such a taxel keeps its state. residual: f64[n], mean minus the expected
    count at rest. variance: f64[n], of the residual without contact, counts^2. measured: f64[n], of the mean. walk:
    variance of the change of a count at rest, counts^2. elapsed_s: length, seconds. begin: probability that a contact
    begins; None: at the usual rate.
    """

    mean: FloatArray
    residual: FloatArray
    variance: FloatArray
    measured: FloatArray
    walk: float
    elapsed_s: float
    begin: float | None = None


@dataclass(eq=False)
class ContactState:
    """State of n taxels.

    contact: f64[n], probability of a contact. level, variance: f64[n], count in contact and variance of its error.
    has_risen: bool[n], the count rose above the one at rest in the latest interval. log_evidence: f64[n], logarithm of
    the probability density of the latest count; 0 without data. free_level, free_variance: f64[n], count and variance
    of its error if the contact is none. log_odds: f64[n], of the contact against this history. has_ceased: bool[n], the
    contact was withdrawn in the latest interval.
    """

    contact: FloatArray
    level: FloatArray
    variance: FloatArray
    has_risen: BoolArray
    log_evidence: FloatArray
    free_level: FloatArray
    free_variance: FloatArray
    log_odds: FloatArray
    has_ceased: BoolArray

    @classmethod
    def start(cls, n: int) -> ContactState:
        """Start without contact."""
        zero, no = np.zeros(n), np.zeros(n, bool)
        return cls(np.full(n, LEAST_PROBABILITY), zero, np.ones(n), no, zero, zero, np.ones(n), zero, no)

    @property
    def is_contact(self) -> BoolArray:
        """Whether a contact is more probable than none, bool[n]."""
        return np.asarray(self.contact > 0.5)

    def update(self, interval: Interval) -> ContactState:
        """Return the state after an interval."""
        known = np.isfinite(interval.mean)
        count, rest = np.where(known, interval.mean, 0.0), np.where(known, interval.residual, 0.0)
        change = to_probability(CHANGES_PER_S, interval.elapsed_s)
        rise = to_probability(RISES_PER_S, interval.elapsed_s)
        begin = to_probability(CONTACTS_PER_S, interval.elapsed_s) if interval.begin is None else interval.begin
        predicted = self.variance + interval.walk + CONTACT_WALK * interval.elapsed_s
        total = predicted + interval.measured
        stays = self.contact * (1.0 - change) ** 2 * _normal(count - self.level, total)
        moves = (self.contact * (1.0 - change) * change + (1.0 - self.contact) * begin) * _signal_density(-rest)
        was_free = (1.0 - self.contact) * (1.0 - begin) + self.contact * change
        free = was_free * (1.0 - rise) * _normal(rest, interval.variance)
        risen = was_free * rise * _signal_density(rest)
        pressed = stays + moves
        sum_of_all = np.maximum(pressed + free + risen, TINY)
        probability = np.clip(pressed / sum_of_all, LEAST_PROBABILITY, 1.0 - LEAST_PROBABILITY)
        gain = predicted / total
        has_moved = moves > stays
        level = np.where(has_moved, count, self.level + gain * (count - self.level))
        found = ContactState(
            np.where(known, probability, self.contact),
            np.where(known, level, self.level),
            np.where(known, np.where(has_moved, interval.measured, predicted * (1.0 - gain)), self.variance),
            known & (risen > free) & (risen > pressed),
            np.where(known, np.log(sum_of_all), 0.0),
            *self._follow_as_free(count, rest, pressed, begin, interval),
            np.zeros(len(known), bool),
        )
        return found._withdraw(known)

    def _follow_as_free(
        self, count: FloatArray, rest: FloatArray, pressed: FloatArray, begin: float, interval: Interval
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Count and its variance if there is no contact, and log odds of the contact, f64[n] each."""
        is_new = ~self.is_contact
        known = np.isfinite(interval.mean)
        level = np.where(is_new, count - rest, self.free_level)
        variance = np.where(is_new, interval.variance - interval.measured, self.free_variance + interval.walk)
        total = variance + interval.measured
        free = (1.0 - begin) * _normal(count - level, total)
        odds = np.log(np.maximum(pressed, TINY)) - np.log(np.maximum(free, TINY))
        gain = variance / total
        return (
            np.where(known, level + gain * (count - level), level),
            np.where(known, variance * (1.0 - gain), variance),
            np.where(known, np.where(is_new, odds, self.log_odds + odds), self.log_odds),
        )

    def _withdraw(self, known: BoolArray) -> ContactState:
        """Withdraw the contacts that are less probable than none."""
        ceased = known & self.is_contact & (self.log_odds < 0.0)
        return replace(self, contact=np.where(ceased, LEAST_PROBABILITY, self.contact), has_ceased=ceased)

    @classmethod
    def select(cls, states: Sequence[ContactState], chosen: IntArray) -> ContactState:
        """Combine states: taxel i has the state `chosen[i]`, i64[n]."""
        return cls(*(np.choose(chosen, [getattr(one, part.name) for one in states]) for part in fields(cls)))


def to_probability(rate: float, elapsed_s: float) -> float:
    """Probability of at least one event in an interval."""
    return float(-np.expm1(-rate * elapsed_s))


def _normal(value: FloatArray, variance: FloatArray) -> FloatArray:
    """Normal density with mean 0."""
    return np.asarray(np.exp(-0.5 * value**2 / variance) / np.sqrt(2.0 * np.pi * variance))


def _signal_density(signal: FloatArray) -> FloatArray:
    """Density of the signal of a contact, per count; 0 below 0."""
    scale = USUAL_SIGNAL / 2.0
    positive = np.maximum(signal, 0.0)
    return np.asarray(positive / scale**2 * np.exp(-positive / scale))
