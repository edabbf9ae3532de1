"""Factors of the variance for each condition and place, learnt from the reference.

The Student t distribution of `null_model.py` is the mixture of normal distributions whose variances differ from
condition to condition and place to place: with the degrees of freedom nu, the variance relative to the model has a
scaled inverse chi-square distribution. The statistics z of the repeats of one condition at one place (in standard
deviations of the model) determine its own factor: (nu + sum of z squared) / (nu + number of z) (Gelman et al., Bayesian
Data Analysis, 2013, section 2.6). A contact at the edge of two boards, for example, varies more than others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from taxel.twin.null_model import NullModel, NullModels
from taxel.twin.schedule import Condition
from taxel.twin.statistics import OF_CONTACTS, Scores
from taxel.types import FloatArray, IntArray

Key = tuple[str, Condition]
"""Quantity and condition."""


@dataclass(eq=False)
class VarianceFactors:
    """Factors of the variances. squares, number: f64[P], sum of z squared and number of z, by quantity and condition.

    models: of the statistics. level: i64[P].
    """

    models: NullModels
    level: IntArray
    squares: dict[Key, FloatArray] = field(default_factory=dict)
    number: dict[Key, FloatArray] = field(default_factory=dict)

    @classmethod
    def learn(
        cls, samples: Sequence[tuple[Condition | None, Scores]], models: NullModels, level: IntArray
    ) -> VarianceFactors:
        """Learn the factors from the statistics of the steps of a reference, with their conditions."""
        found = cls(models, level)
        for condition, scores in samples:
            for name, (estimate, information) in scores.items():
                if condition is None or name not in OF_CONTACTS:
                    continue
                key = (name, condition)
                squares = found.squares.setdefault(key, np.zeros(len(level)))
                number = found.number.setdefault(key, np.zeros(len(level)))
                for rows, model in found._divide(name, information):
                    squares[rows] += (estimate[rows] / model.compute_deviation(information[rows])) ** 2
                    number[rows] += 1.0
        for key, number in found.number.items():
            # Each repeat was compared with the mean of the others: one degree of freedom is lost.
            share = np.maximum(number - 1.0, 0.0) / np.maximum(number, 1.0)
            found.squares[key] *= share
            found.number[key] = number * share
        return found

    def apply(self, scores: Scores, condition: Condition | None, novelty: FloatArray) -> Scores:
        """Return the statistics of a step, f64[P] each, with the information that corresponds to their own variance.

        novelty: f64[P], variance of the error of the expected signal relative to that of a contact, beyond the usual
        one: a place that has been learnt again has an expectation from few contacts, whose common error counts too.
        """
        result: Scores = {}
        for name, (estimate, information) in scores.items():
            own = information.copy()
            if condition is not None and (key := (name, condition)) in self.squares:
                for rows, model in self._divide(name, information):
                    nu = model.degrees_of_freedom
                    factor = (nu + self.squares[key][rows]) / (nu + self.number[key][rows])
                    # The model adds its common variance once: the part of it beyond that is added here.
                    beyond = (np.maximum(factor, 1.0) * (1.0 + novelty[rows]) - 1.0) * model.common
                    own[rows] = 1.0 / (factor / information[rows] + beyond)
            result[name] = (estimate, own)
        return result

    def get_repeats(self, name: str, condition: Condition | None) -> FloatArray | None:
        """Number of statistics of each place from which its factor is known, f64[P]; None: unknown."""
        return None if condition is None else self.number.get((name, condition))

    def _divide(self, name: str, information: FloatArray) -> list[tuple[IntArray, NullModel]]:
        """Rows with information, with the model of their level."""
        return [
            (np.flatnonzero((self.level == number) & (information > 0.0)), model)
            for number, model in self.models.get(name, {}).items()
        ]
