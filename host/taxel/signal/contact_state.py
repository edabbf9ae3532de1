"""Probability that a taxel is in contact, from the mean counts of successive intervals.

A hidden Markov model with the states free and contact (forward algorithm: Rabiner, Proc. IEEE 77 (1989) 257). Without
contact the count is the expected count at rest. In contact it stays near the count of the interval before (a Kalman
filter of a local level), or changes to another force. A count above the one at rest is no contact: contact lowers a
count. Such a rise means that the taxel was touched while its baseline was taken, or that its board has changed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Final

import numpy as np

from taxel.types import BoolArray, FloatArray, IntArray

CONTACTS_PER_S: Final = 1.0 / 60.0
"""Rate at which a contact begins on a taxel (assumed: one in a minute)."""

CHANGES_PER_S: Final = 0.1
"""Rate at which a contact ends, and rate at which its force changes (assumed: a grasp of ten seconds)."""

RISES_PER_S: Final = 1.0 / 3600.0
"""Rate at which the count at rest rises by itself (assumed: once in an hour)."""

USUAL_SIGNAL: Final = 300.0
"""Mean signal of a contact, counts (assumed: twice the activation threshold). The signal has a gamma distribution of
shape 2: signals near 0 are rare."""

CONTACT_WALK: Final = 1.0
"""Variance of the change of a constant contact in a second, counts^2 (assumed: creep of the layer)."""

LEAST_PROBABILITY: Final = 1e-9
"""Probability that each state keeps, so that rounding never excludes a state."""


@dataclass(eq=False)
class ContactState:
    """State of n taxels.

    contact: f64[n], probability of a contact. level, variance: f64[n], count in contact and variance of its error.
    has_risen: bool[n], the count rose above the one at rest in the latest interval. log_evidence: f64[n], logarithm of
    the probability density of the latest count; 0 without data.
    """

    contact: FloatArray
    level: FloatArray
    variance: FloatArray
    has_risen: BoolArray
    log_evidence: FloatArray

    @classmethod
    def start(cls, n: int) -> ContactState:
        """Start without contact."""
        return cls(np.full(n, LEAST_PROBABILITY), np.zeros(n), np.ones(n), np.zeros(n, bool), np.zeros(n))

    @property
    def is_contact(self) -> BoolArray:
        """Whether a contact is more probable than none, bool[n]."""
        return np.asarray(self.contact > 0.5)

    def update(
        self,
        mean: FloatArray,
        residual: FloatArray,
        variance: FloatArray,
        measured: FloatArray,
        elapsed_s: float,
        begin: float | None = None,
    ) -> ContactState:
        """Return the state after an interval.

        mean: f64[n], mean counts, NaN without data: such a taxel keeps its state. residual: f64[n], mean minus the
        expected count at rest. variance: f64[n], of the residual without contact. measured: f64[n], of the mean.
        elapsed_s: length of the interval, seconds. begin: probability that a contact begins; None: at the usual rate.
        """
        known = np.isfinite(mean)
        count, rest = np.where(known, mean, 0.0), np.where(known, residual, 0.0)
        change, rise = to_probability(CHANGES_PER_S, elapsed_s), to_probability(RISES_PER_S, elapsed_s)
        begin = to_probability(CONTACTS_PER_S, elapsed_s) if begin is None else begin
        predicted = self.variance + CONTACT_WALK * elapsed_s
        total = predicted + measured
        stays = self.contact * (1.0 - change) ** 2 * _normal(count - self.level, total)
        moves = (self.contact * (1.0 - change) * change + (1.0 - self.contact) * begin) * _signal_density(-rest)
        was_free = (1.0 - self.contact) * (1.0 - begin) + self.contact * change
        free = was_free * (1.0 - rise) * _normal(rest, variance)
        risen = was_free * rise * _signal_density(rest)
        sum_of_all = np.maximum(stays + moves + free + risen, np.finfo(np.float64).tiny)
        probability = np.clip((stays + moves) / sum_of_all, LEAST_PROBABILITY, 1.0 - LEAST_PROBABILITY)
        gain = predicted / total
        has_moved = moves > stays
        level = np.where(has_moved, count, self.level + gain * (count - self.level))
        return ContactState(
            np.where(known, probability, self.contact),
            np.where(known, level, self.level),
            np.where(known, np.where(has_moved, measured, predicted * (1.0 - gain)), self.variance),
            known & (risen > free) & (risen > stays + moves),
            np.where(known, np.log(sum_of_all), 0.0),
        )

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
