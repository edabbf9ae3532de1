"""Probability that a taxel is in contact, from the mean counts of successive intervals.

The model is a hidden Markov model with the states free and contact (forward algorithm: Rabiner, Proc. IEEE 77 (1989)
257). Without contact, the count is near the count at rest, the expected count of an untouched taxel. In contact, the
count stays near that of the interval before (a Kalman filter of a local level), or changes because the force changes.
Contact lowers a count, so a count above the count at rest is no contact: the taxel was touched while its baseline was
taken, or its board has changed.

A rare deviation of the noise can resemble a light contact. During a contact, a second filter therefore follows the
count under the hypothesis that there is no contact; when this hypothesis becomes more probable, the contact is
withdrawn.
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
"""Smallest probability of each state: rounding to 0 would exclude the state for ever."""


@dataclass(frozen=True, eq=False)
class Interval:
    """Measurement of n taxels in one interval.

    mean: f64[n], mean counts, NaN without data: such a taxel keeps its state. residual: f64[n], mean minus the expected
    count at rest. variance: f64[n], variance of the residual without contact, counts^2. measured: f64[n], variance of
    the mean by noise, counts^2. walk: variance by which a count at rest changes in the interval, counts^2. elapsed_s:
    length of the interval, seconds. begin: probability that a contact begins in the interval; None: that of
    `CONTACTS_PER_S`.
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
    """State of n taxels after an interval.

    contact: f64[n], probability of a contact. level, variance: f64[n], estimated count in contact and variance of its
    error. has_risen: bool[n], whether the count rose above the count at rest in the latest interval. log_evidence:
    f64[n], logarithm of the probability density of the latest count; 0 without data. free_level, free_variance: f64[n],
    estimated count, and variance of its error, under the hypothesis that there is no contact. log_odds: f64[n],
    logarithm of the odds of the contact against this hypothesis. has_ceased: bool[n], whether the contact was withdrawn
    in the latest interval.
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
        """Return the state of n taxels without contact."""
        zero, no = np.zeros(n), np.zeros(n, bool)
        return cls(np.full(n, LEAST_PROBABILITY), zero, np.ones(n), no, zero, zero, np.ones(n), zero, no)

    @property
    def is_contact(self) -> BoolArray:
        """Whether a contact is more probable than none, bool[n]."""
        return np.asarray(self.contact > 0.5)

    def update(self, interval: Interval) -> ContactState:
        """Return the state after a further interval; the state itself is not changed.

        A taxel without data keeps its contact probability and levels. Four joint densities of state and count are
        compared: the contact continues with its force (`stays`), the contact begins or changes its force (`moves`),
        there is no contact (`free`), and there is no contact but the count at rest has risen (`risen`).
        """
        known = np.isfinite(interval.mean)
        count, residual = np.where(known, interval.mean, 0.0), np.where(known, interval.residual, 0.0)
        change = to_probability(CHANGES_PER_S, interval.elapsed_s)
        rise = to_probability(RISES_PER_S, interval.elapsed_s)
        begin = to_probability(CONTACTS_PER_S, interval.elapsed_s) if interval.begin is None else interval.begin
        predicted = self.variance + interval.walk + CONTACT_WALK * interval.elapsed_s
        total = predicted + interval.measured
        # `change` is the probability that a contact ends, and also the probability that its force changes.
        stays = self.contact * (1.0 - change) ** 2 * _normal_density(count - self.level, total)
        moves = (self.contact * (1.0 - change) * change + (1.0 - self.contact) * begin) * _signal_density(-residual)
        was_free = (1.0 - self.contact) * (1.0 - begin) + self.contact * change
        free = was_free * (1.0 - rise) * _normal_density(residual, interval.variance)
        risen = was_free * rise * _signal_density(residual)
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
            *self._follow_as_free(count, residual, pressed, begin, interval),
            np.zeros(len(known), bool),
        )
        return found._withdraw_improbable(known)

    def _follow_as_free(
        self, count: FloatArray, residual: FloatArray, pressed: FloatArray, begin: float, interval: Interval
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Update the filter of the hypothesis that there is no contact.

        Returns (estimated count, variance of its error, log odds of the contact against the hypothesis), f64[n] each.
        count, residual: f64[n], mean and residual of the interval, 0 without data. pressed: f64[n], probability density
        of the count with contact. begin: probability that a contact begins.
        """
        is_new = ~self.is_contact
        known = np.isfinite(interval.mean)
        level = np.where(is_new, count - residual, self.free_level)
        variance = np.where(is_new, interval.variance - interval.measured, self.free_variance + interval.walk)
        total = variance + interval.measured
        free = (1.0 - begin) * _normal_density(count - level, total)
        odds = np.log(np.maximum(pressed, TINY)) - np.log(np.maximum(free, TINY))
        gain = variance / total
        return (
            np.where(known, level + gain * (count - level), level),
            np.where(known, variance * (1.0 - gain), variance),
            np.where(known, np.where(is_new, odds, self.log_odds + odds), self.log_odds),
        )

    def _withdraw_improbable(self, known: BoolArray) -> ContactState:
        """Return the state without the contacts that are less probable than the hypothesis of no contact.

        known: bool[n], taxels with data in the latest interval; contacts of others are kept.
        """
        ceased = known & self.is_contact & (self.log_odds < 0.0)
        return replace(self, contact=np.where(ceased, LEAST_PROBABILITY, self.contact), has_ceased=ceased)

    @classmethod
    def select(cls, states: Sequence[ContactState], chosen: IntArray) -> ContactState:
        """Combine states taxel by taxel: taxel i gets its values from `states[chosen[i]]`. chosen: i64[n]."""
        return cls(*(np.choose(chosen, [getattr(state, item.name) for state in states]) for item in fields(cls)))


def to_probability(rate: float, elapsed_s: float) -> float:
    """Return the probability of at least one event in an interval. rate: events per second of a Poisson process."""
    return float(-np.expm1(-rate * elapsed_s))


def _normal_density(value: FloatArray, variance: FloatArray) -> FloatArray:
    """Compute the density of the normal distribution with mean 0."""
    return np.asarray(np.exp(-0.5 * value**2 / variance) / np.sqrt(2.0 * np.pi * variance))


def _signal_density(signal: FloatArray) -> FloatArray:
    """Compute the probability density of a contact's signal, per count; 0 for a negative signal.

    The distribution is a gamma distribution of shape 2 with the mean `USUAL_SIGNAL`.
    """
    scale = USUAL_SIGNAL / 2.0
    positive = np.maximum(signal, 0.0)
    return np.asarray(positive / scale**2 * np.exp(-positive / scale))
