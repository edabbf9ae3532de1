"""Factors that correct the variance for each condition and place, learnt from the reference.

The Student t distribution of `null_model.py` is the mixture of normal distributions whose variances differ from
condition to condition and place to place: with the degrees of freedom nu, the variance relative to the model has a
scaled inverse chi-square distribution. The statistics z of the repeats of one condition at one place (in standard
deviations of the model) determine the factor of this place and condition: (nu + sum of z squared) / (nu + number of z)
(Gelman et al., Bayesian Data Analysis, 2013, section 2.6). A contact at the edge of two boards, for example, varies
more than others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from taxel.twin.null_model import NullModel, NullModels
from taxel.twin.schedule import Condition
from taxel.twin.statistics import OF_CONTACTS, Estimates
from taxel.types import FloatArray, IntArray

Key = tuple[str, Condition]
"""Name of the quantity, and condition."""


@dataclass(eq=False)
class VarianceFactors:
    """Sums from which the factors of the variances follow, for P places.

    models: null models of the statistics. level: i64[P], level of each place. squares, number: f64[P], sum of z squared
    and number of z, by quantity and condition.
    """

    models: NullModels
    level: IntArray
    squares: dict[Key, FloatArray] = field(default_factory=dict)
    number: dict[Key, FloatArray] = field(default_factory=dict)

    @classmethod
    def learn(
        cls, samples: Sequence[tuple[Condition | None, Estimates]], models: NullModels, level: IntArray
    ) -> VarianceFactors:
        """Learn the factors of the variances from the steps of a reference.

        samples: for each step, its condition (None: no contact) and its estimates. models: null models, whose variances
        the factors correct. level: i64[P], level of each of the P places.
        """
        found = cls(models, level)
        for condition, estimates in samples:
            for name, (estimate, information) in estimates.items():
                if condition is None or name not in OF_CONTACTS:
                    continue
                key = (name, condition)
                squares = found.squares.setdefault(key, np.zeros(len(level)))
                number = found.number.setdefault(key, np.zeros(len(level)))
                for places, model in found._split_by_level(name, information):
                    squares[places] += (estimate[places] / model.compute_deviation(information[places])) ** 2
                    number[places] += 1.0
        for key, number in found.number.items():
            # Each repeat was compared with the mean of the others: one degree of freedom is lost.
            share = np.maximum(number - 1.0, 0.0) / np.maximum(number, 1.0)
            found.squares[key] *= share
            found.number[key] = number * share
        return found

    def apply(self, estimates: Estimates, condition: Condition | None, novelty: FloatArray) -> Estimates:
        """Return the estimates of a step with their information corrected by the factors of the step's condition.

        novelty: f64[P], excess variance of the expected signal, relative to the variance of a contact. It is above 0 at
        a place whose expected signal has been learnt again from few contacts: their common error adds to the variance.
        """
        result: Estimates = {}
        for name, (estimate, information) in estimates.items():
            corrected = information.copy()
            if condition is not None and (key := (name, condition)) in self.squares:
                for places, model in self._split_by_level(name, information):
                    # Mean of the variance factor: `nu` statistics of the null model and those of this condition.
                    nu = model.degrees_of_freedom
                    factor = (nu + self.squares[key][places]) / (nu + self.number[key][places])
                    # The null model adds its common variance once; only the excess over it is added here.
                    excess = (np.maximum(factor, 1.0) * (1.0 + novelty[places]) - 1.0) * model.common
                    corrected[places] = 1.0 / (factor / information[places] + excess)
            result[name] = (estimate, corrected)
        return result

    def get_repeats(self, name: str, condition: Condition | None) -> FloatArray | None:
        """Return the number of statistics from which the factor of each place was learnt, f64[P]; None if no factor.

        name: name of the quantity.
        """
        return None if condition is None else self.number.get((name, condition))

    def _split_by_level(self, name: str, information: FloatArray) -> list[tuple[IntArray, NullModel]]:
        """Return for each level of places the indices of the places with information, and the level's null model.

        name: name of the quantity.
        """
        return [
            (np.flatnonzero((self.level == number) & (information > 0.0)), model)
            for number, model in self.models.get(name, {}).items()
        ]
