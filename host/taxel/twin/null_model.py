"""Distribution of every statistic without a fault, fitted to the reference.

The estimate of a change at a place has a Student t distribution with the squared scale s (1 / w + common), where w is
the information of the estimate. s corrects the variance model, `common` is the variance that the taxels of a place
share (force, position), and the degrees of freedom describe rare large deviations. All three are fitted by maximum
likelihood for each quantity and each level of places (taxel, TX line, RX line, board, skin).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.optimize import minimize
from scipy.special import gammaln

from taxel.twin.places import LEVELS
from taxel.twin.statistics import QUANTITIES, Estimates, Quantity
from taxel.types import FloatArray, IntArray

DEGREES_OF_FREEDOM: Final = (3.0, 60.0)
"""Limits of the degrees of freedom of the Student t distribution: with the lower limit the variance is still finite,
with the upper limit the distribution is almost normal."""

PRIOR_STATISTICS: Final = 30.0
"""Weight of the prior in the fit, as an equivalent number of statistics: with few contacts the fitted variance stays
near the variance of the model."""

LEAST_POWER: Final = 0.05
"""A statistic is used if its standard deviation is at most the largest amplitude of the quantity divided by this
value."""

WIDE: Final = (10.0, 100.0)
"""Scales of the alternatives without a fixed amplitude, in standard deviations; in the unit of the quantity, a scale is
at least the smallest fixed amplitude. The fixed amplitudes are a factor of about three apart, which is too coarse for a
change of many standard deviations."""

USED_FOR_FIT: Final = 20_000
"""Largest number of statistics in a fit; more do not change it."""


@dataclass(frozen=True)
class NullModel:
    """Student t distribution of the estimates of one quantity at the places of one level, without a fault.

    scale: factor s of the variance. common: variance that the taxels of a place share, in squared units of the
    quantity.
    """

    scale: float = 1.0
    common: float = 0.0
    degrees_of_freedom: float = 8.0

    def compute_deviation(self, information: FloatArray) -> FloatArray:
        """Return the scale (standard deviation) of estimates with this information; infinite for information 0."""
        with np.errstate(divide="ignore"):
            return np.asarray(np.sqrt(self.scale * (1.0 / information + self.common)))


NullModels = dict[str, dict[int, NullModel]]
"""Null models by name of the quantity and level of the place (index in `LEVELS`)."""


def fit_null_models(samples: Sequence[Estimates], level: IntArray, seed: int = 0) -> NullModels:
    """Fit the distributions of the estimates without a fault (null models), for all quantities and levels of places.

    samples: for each time step of the reference recording, the estimates of the changes at all places: pairs (estimate,
    information) of f64[P] each, by name of the quantity. level: i64[P], level of each of P places (taxel, line, board,
    skin) as an index in `LEVELS`. seed: seed of the random selection if a model has more than `USED_FOR_FIT` estimates.
    Returns a model for each quantity name and level; a quantity without estimates has none.
    """
    rng = np.random.default_rng(seed)
    models: NullModels = {}
    for quantity in QUANTITIES:
        models[quantity.name] = {}
        pairs = [sample[quantity.name] for sample in samples if quantity.name in sample]
        for number, name in enumerate(LEVELS):
            if name not in quantity.levels or not pairs:
                continue
            places = level == number
            estimate = np.concatenate([value[places] for value, _ in pairs]) if places.any() else np.zeros(0)
            information = np.concatenate([weight[places] for _, weight in pairs]) if places.any() else np.zeros(0)
            models[quantity.name][number] = _fit(quantity, estimate, information, rng)
    return models


def _fit(quantity: Quantity, estimate: FloatArray, information: FloatArray, rng: np.random.Generator) -> NullModel:
    """Fit the null model of one quantity and level by penalised maximum likelihood.

    estimate, information: f64[m], m statistics. Statistics with too little information (`LEAST_POWER`) are left out;
    without any other statistic the default model is returned.
    """
    largest = max(abs(value) for value in quantity.amplitudes)
    used = np.flatnonzero(information > (LEAST_POWER / largest) ** 2)
    if len(used) > USED_FOR_FIT:
        used = rng.choice(used, USED_FOR_FIT, replace=False)
    if not len(used):
        return NullModel()
    value, variance = estimate[used], 1.0 / information[used]
    start_common = max(float(np.mean(value**2) - np.mean(variance)), 1e-3 * float(np.median(variance)))

    def loss(parameters: FloatArray) -> float:
        """Return the negative log posterior of the logarithms of scale, common variance and degrees of freedom."""
        scale, common, degrees_of_freedom = np.exp(parameters)
        spread = scale * (variance + common)
        # Log-normal priors: scale 1 (log variance 2 / PRIOR_STATISTICS), degrees of freedom 8 (4 / PRIOR_STATISTICS).
        prior = 0.5 * PRIOR_STATISTICS * (parameters[0] ** 2 / 2.0 + (parameters[2] - np.log(8.0)) ** 2 / 4.0)
        return float(prior - log_density(value, np.sqrt(spread), float(degrees_of_freedom)).sum())

    bounds = [(-3.0, 4.0), (np.log(1e-8 * start_common), np.log(1e3 * start_common)), tuple(np.log(DEGREES_OF_FREEDOM))]
    found = minimize(loss, [0.0, np.log(start_common), np.log(8.0)], method="L-BFGS-B", bounds=bounds).x
    return NullModel(*np.exp(found).tolist())


def log_density(value: FloatArray, deviation: FloatArray, degrees_of_freedom: float) -> FloatArray:
    """Return the log density at `value` of a Student t distribution with mean 0 and scale `deviation`."""
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
    pair: tuple[FloatArray, FloatArray],
    models: Mapping[int, NullModel],
    level: IntArray,
    repeats: FloatArray | None = None,
) -> FloatArray:
    """Compute the log likelihood ratio of each alternative of a quantity against no change, f64[P, G].

    The G alternatives are the fixed amplitudes of the quantity, and then one change of unknown amplitude for each scale
    in `WIDE`: the estimates have the distribution of the null model, widened by this factor. pair: estimate and
    information of each of P places, f64[P] each; a place with too little information (`LEAST_POWER`) has the ratio 0.
    level: i64[P]. repeats: f64[P], number of statistics from which the variance of each place is known (see
    `variance_factors.py`); they add to the degrees of freedom.
    """
    estimate, information = pair
    result = np.zeros((len(estimate), count_alternatives(quantity)))
    largest = max(abs(value) for value in quantity.amplitudes)
    amplitudes = np.array(quantity.amplitudes)
    least = float(np.abs(amplitudes).min())
    for number, model in models.items():
        places = np.flatnonzero((level == number) & (information > (LEAST_POWER / largest) ** 2))
        if len(places):
            deviation = model.compute_deviation(information[places])
            degrees = model.degrees_of_freedom + (np.zeros(len(places)) if repeats is None else repeats[places])
            # Log densities of Student t distributions; their equal constants cancel in the ratio.
            base = (estimate[places] / deviation) ** 2 / degrees
            moved = ((estimate[places, None] - amplitudes) / deviation[:, None]) ** 2 / degrees[:, None]
            half = 0.5 * (degrees + 1.0)
            result[places, : len(amplitudes)] = half[:, None] * (np.log1p(base)[:, None] - np.log1p(moved))
            if quantity.is_one_sided:
                base = np.where(estimate[places] > 0.0, base, 0.0)
            for column, scale in enumerate(WIDE, start=len(amplitudes)):
                # A change far below the smallest amplitude is of no interest, even if it is certain.
                width = np.maximum(scale, least / deviation)
                result[places, column] = half * (np.log1p(base) - np.log1p(base / width**2)) - np.log(width)
    return result


def count_alternatives(quantity: Quantity) -> int:
    """Count the alternatives of a quantity's test: its fixed amplitudes, and the scales of `WIDE`."""
    return len(quantity.amplitudes) + len(WIDE)
