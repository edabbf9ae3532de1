"""Distribution of every statistic without a fault, fitted to the reference.

The standardised estimate of a place has a Student t distribution with the variance s (1 / w + common). s corrects the
variance model, `common` is the variance that the taxels of a place share (force, position), and the degrees of freedom
describe rare large deviations. All three are fitted by maximum likelihood for each quantity and level.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.optimize import minimize
from scipy.special import gammaln

from taxel.twin.places import LEVELS
from taxel.twin.statistics import QUANTITIES, Quantity, Scores
from taxel.types import FloatArray, IntArray

DEGREES_OF_FREEDOM: Final = (3.0, 60.0)
"""Limits of the degrees of freedom: the lower one has a finite variance, the upper one is almost normal."""

PRIOR_STATISTICS: Final = 30.0
"""Weight of the prior in the fit, in statistics: with few contacts the variance stays near that of the model."""

LEAST_POWER: Final = 0.05
"""A statistic is used if its standard deviation is at most the largest amplitude of the quantity divided by this
value."""

WIDE: Final = (10.0, 100.0)
"""Scales of the alternatives without a fixed amplitude, in standard deviations; a scale is at least the smallest
amplitude. The fixed amplitudes are a factor of about three apart: too coarse for a change of many standard deviations.
"""

USED_FOR_FIT: Final = 20_000
"""Largest number of statistics in a fit; more do not change it."""


@dataclass(frozen=True)
class NullModel:
    """Student t model. scale: s. common: variance, in squared units of the quantity. degrees_of_freedom: degrees of
    freedom.
    """

    scale: float = 1.0
    common: float = 0.0
    degrees_of_freedom: float = 8.0

    def compute_deviation(self, information: FloatArray) -> FloatArray:
        """Standard deviation of an estimate with this information; infinite without information."""
        with np.errstate(divide="ignore"):
            return np.asarray(np.sqrt(self.scale * (1.0 / information + self.common)))


NullModels = dict[str, dict[int, NullModel]]
"""Models by quantity and level (index in `LEVELS`)."""


def fit_null_models(samples: Sequence[Scores], level: IntArray, seed: int = 0) -> NullModels:
    """Fit the models to the statistics of a reference.

    samples: estimate and information of each place of each step, by quantity. level: i64[P]. seed: selects the
    statistics of a fit if there are many.
    """
    rng = np.random.default_rng(seed)
    models: NullModels = {}
    for quantity in QUANTITIES:
        models[quantity.name] = {}
        own = [sample[quantity.name] for sample in samples if quantity.name in sample]
        for number, name in enumerate(LEVELS):
            if name not in quantity.levels or not own:
                continue
            rows = level == number
            estimate = np.concatenate([value[rows] for value, _ in own]) if rows.any() else np.zeros(0)
            information = np.concatenate([weight[rows] for _, weight in own]) if rows.any() else np.zeros(0)
            models[quantity.name][number] = _fit(quantity, estimate, information, rng)
    return models


def _fit(quantity: Quantity, estimate: FloatArray, information: FloatArray, rng: np.random.Generator) -> NullModel:
    """Fit one model to estimates and their information."""
    largest = max(abs(value) for value in quantity.amplitudes)
    used = np.flatnonzero(information > (LEAST_POWER / largest) ** 2)
    if len(used) > USED_FOR_FIT:
        used = rng.choice(used, USED_FOR_FIT, replace=False)
    if not len(used):
        return NullModel()
    value, variance = estimate[used], 1.0 / information[used]
    start_common = max(float(np.mean(value**2) - np.mean(variance)), 1e-3 * float(np.median(variance)))

    def loss(parameters: FloatArray) -> float:
        scale, common, degrees_of_freedom = np.exp(parameters)
        spread = scale * (variance + common)
        prior = 0.5 * PRIOR_STATISTICS * (parameters[0] ** 2 / 2.0 + (parameters[2] - np.log(8.0)) ** 2 / 4.0)
        return float(prior - log_density(value, np.sqrt(spread), float(degrees_of_freedom)).sum())

    bounds = [(-3.0, 4.0), (np.log(1e-8 * start_common), np.log(1e3 * start_common)), tuple(np.log(DEGREES_OF_FREEDOM))]
    found = minimize(loss, [0.0, np.log(start_common), np.log(8.0)], method="L-BFGS-B", bounds=bounds).x
    return NullModel(*np.exp(found).tolist())


def log_density(value: FloatArray, deviation: FloatArray, degrees_of_freedom: float) -> FloatArray:
    """Log density of a Student t distribution with scale `deviation`."""
    constant = (
        gammaln(0.5 * (degrees_of_freedom + 1.0))
        - gammaln(0.5 * degrees_of_freedom)
        - 0.5 * np.log(degrees_of_freedom * np.pi)
    )
    ratio = value / deviation
    return np.asarray(
        constant - np.log(deviation) - 0.5 * (degrees_of_freedom + 1.0) * np.log1p(ratio**2 / degrees_of_freedom)
    )


def compute_log_ratios(
    quantity: Quantity,
    scores: tuple[FloatArray, FloatArray],
    models: Mapping[int, NullModel],
    level: IntArray,
    repeats: FloatArray | None = None,
) -> FloatArray:
    """Log likelihood ratio of each alternative of a quantity against no change, f64[P, G]; 0 without information.

    The alternatives are the amplitudes of the quantity, then those of `WIDE`. scores: estimate and information, f64[P].
    level: i64[P]. repeats: f64[P], statistics from which the variance of each place is known (see
    `variance_factors.py`); they add to the degrees of freedom.
    """
    estimate, information = scores
    result = np.zeros((len(estimate), count_alternatives(quantity)))
    largest = max(abs(value) for value in quantity.amplitudes)
    amplitudes = np.array(quantity.amplitudes)
    least = float(np.abs(amplitudes).min())
    for number, model in models.items():
        rows = np.flatnonzero((level == number) & (information > (LEAST_POWER / largest) ** 2))
        if len(rows):
            deviation = model.compute_deviation(information[rows])
            degrees = model.degrees_of_freedom + (np.zeros(len(rows)) if repeats is None else repeats[rows])
            base = (estimate[rows] / deviation) ** 2 / degrees
            moved = ((estimate[rows, None] - amplitudes) / deviation[:, None]) ** 2 / degrees[:, None]
            half = 0.5 * (degrees + 1.0)
            result[rows, : len(amplitudes)] = half[:, None] * (np.log1p(base)[:, None] - np.log1p(moved))
            if quantity.is_one_sided:
                base = np.where(estimate[rows] > 0.0, base, 0.0)
            for column, scale in enumerate(WIDE, start=len(amplitudes)):
                # A change far below the smallest amplitude is of no interest, even if it is certain.
                own = np.maximum(scale, least / deviation)
                result[rows, column] = half * (np.log1p(base) - np.log1p(base / own**2)) - np.log(own)
    return result


def count_alternatives(quantity: Quantity) -> int:
    """Number of alternatives of a quantity."""
    return len(quantity.amplitudes) + len(WIDE)
