"""Log predictive density of features, by condition, board and family of features."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from taxel.gap.comparison.settings import ComparisonSettings
from taxel.gap.features.metric import sum_terms
from taxel.gap.fitting.fit_data import FitData
from taxel.types import FloatArray

REPEAT_SHARES: Final = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Values that are compared for the share of the variance between simulated repeats that remains in their mean (chosen):
1 for random repeats, less for repeats that were planned such that their variation cancels in the mean."""


@dataclass(frozen=True, eq=False)
class UncertainChange:
    """Part of a prediction with an error in proportion to it.

    change: f64[C, F, n] (C conditions, F features, n taxels), counts; None: no such part. errors: standard deviations
    relative to the change, of which the density selects one.
    """

    change: FloatArray | None = None
    errors: tuple[float, ...] = (0.0,)


CERTAIN: Final = UncertainChange()


class BlockDensity:
    """Log density of the real features, given predicted features, for each block.

    A block consists of the features of one of 5 families (signal, noise, missing frames, onset, drift residual) on one
    board in one condition.

    The deviation of a block is the mean squared difference of its features, each divided by the variance of the real
    mean. The density of a block is that of a multivariate Student t distribution with S - 1 degrees of freedom for S
    sessions and `settings.dimensions` effective dimensions: a block that no set predicts, such as a faulty contact of
    the simulator, changes the comparison by a bounded amount.
    """

    def __init__(
        self, fit_data: FitData, settings: ComparisonSettings, model_error: float = 0.0, repeat_share: float = 1.0
    ) -> None:
        """Prepare the density for the real sessions of a pair; unknown and excluded features have weight 0.

        model_error: standard deviation of the error of the simulated signal, relative to the signal
        (`estimate_model_error`). repeat_share: share of the variance of the simulated mean (`State.mean_variance`) that
        is added to the variance.
        """
        self._fit_data, self._settings = fit_data, settings
        self.repeat_share = repeat_share
        real, layout = fit_data.sessions, fit_data.layout
        self._degrees_of_freedom = max(real.value.shape[1] - 1, 1)
        variance = real.mean_variance.copy()
        if fit_data.state.mean_variance is not None:
            variance += repeat_share * fit_data.state.mean_variance
        for family, resolution in zip(layout.families, settings.resolution_counts, strict=True):
            variance[:, family] += resolution**2
        self._variance = variance
        self._signal = np.maximum(np.abs(fit_data.state.mean), np.abs(fit_data.target))[:, : layout.bins]
        variance = variance.copy()
        variance[:, : layout.bins] += (model_error * self._signal) ** 2
        is_used = (fit_data.weight > 0) & real.is_known.any(axis=1)
        self._share = np.where(is_used, layout.weight[:, None], 0.0)
        self._used_variance = np.where(is_used, variance, 1.0)
        self._weight = self._share / self._used_variance
        sensor = fit_data.state.pair.groups.sensor
        # Matrix of zeros and ones, [n, s], that sums over the taxels of each board.
        self._boards = (sensor[:, None] == np.arange(int(sensor.max()) + 1)).astype(np.float64)
        self._total = self._sum_blocks(self._share)
        self._log_variance = self._average_blocks(self._share * np.log(variance))

    def estimate_model_error(self, features: FloatArray) -> float:
        """Estimate the relative error of the simulated signal.

        features: f64[C, F, n] (C conditions, F features, n taxels), features that the best set of effects predicts. The
        error of a block is the root of its mean square deviation beyond the variance of the real mean, relative to its
        mean square signal. The result is the median over the loaded blocks, so a few blocks with another kind of error
        do not determine it. It is at least `settings.smallest_model_error`.
        """
        bins = self._fit_data.layout.bins
        share = self._share[:, :bins]
        excess_squares = (self._fit_data.target - features)[:, :bins] ** 2 - self._variance[:, :bins]
        excess, mean_square = ((share * part).sum(axis=1) @ self._boards for part in (excess_squares, self._signal**2))
        is_loaded = mean_square > self._settings.loaded_share * max(float(mean_square.max()), np.finfo(float).tiny)
        error2 = float(np.median(excess[is_loaded] / mean_square[is_loaded])) if is_loaded.any() else 0.0
        return max(float(np.sqrt(max(error2, 0.0))), self._settings.smallest_model_error)

    def compute_simulated_floor2(self) -> float:
        """Compute the squared gap that the variation between simulated repeats alone causes, counts^2; 0 if the
        variation is unknown.

        A squared gap is the sum over features of the mean over conditions and taxels of weight times squared difference
        (`sum_terms`). The expected squared difference is here the variance of the simulated mean, counts^2, times
        `repeat_share`, the part of this variance that remains after planned repeats cancel each other (1 for random
        repeats). `_share` holds the weights of the features, 0 for features that are not used.
        """
        variance = self._fit_data.state.mean_variance
        if variance is None:
            return 0.0
        return self.repeat_share * sum_terms(np.where(self._share > 0.0, self._share * variance, 0.0))

    def compute_deviations(self, features: FloatArray) -> FloatArray:
        """Compute the mean squared standardised difference of each block, f64[C, s, 5] (C conditions, s boards, 5
        families of features), for predicted features f64[C, F, n] (F features, n taxels).

        A block contains the features of one family, such as signal or noise, on one board in one condition.

        The deviation is about 1 if only sessions and repeats vary, and 0 for a block without features.
        """
        return self._average_blocks(self._weight * (self._fit_data.target - features) ** 2)

    def compute_log_density(self, features: FloatArray, uncertain: UncertainChange = CERTAIN) -> FloatArray:
        """Compute the log density of each block for predicted features f64[C, F, n] (C conditions, F features, n
        taxels), up to a constant, f64[C, s, 5] (s boards, 5 families of features).

        A block contains the features of one family, such as signal or noise, on one board in one condition.

        uncertain: part of the predicted features with a relative error. Of its possible errors, the error with the
        largest sum of log densities over the blocks is used.
        """
        densities = [self._compute_one_density(features, uncertain.change, error) for error in uncertain.errors]
        return max(densities, key=lambda density: float(density.sum()))

    def _compute_one_density(self, features: FloatArray, change: FloatArray | None, error: float) -> FloatArray:
        """Compute the log density of each block, as `compute_log_density`, for one relative error of `change`,
        f64[C, F, n].

        The density is a multivariate Student t density with S - 1 degrees of freedom for S sessions.
        """
        dimensions, degrees_of_freedom = np.array(self._settings.dimensions), self._degrees_of_freedom
        weight, log_ratio = self._weight, np.zeros(1)
        if change is not None and error > 0.0:
            variance = self._used_variance + (error * change) ** 2
            weight = self._share / variance
            # The normalisation of the density decreases with the variance.
            log_ratio = self._average_blocks(self._share * np.log(variance / self._used_variance))
        deviations = self._average_blocks(weight * (self._fit_data.target - features) ** 2)
        density = -0.5 * (degrees_of_freedom + dimensions) * np.log1p(dimensions * deviations / degrees_of_freedom)
        return np.asarray(density - 0.5 * dimensions * log_ratio)

    def compute_normalised_density(self, features: FloatArray) -> float:
        """Compute the sum of the log densities of all signal blocks for predicted features f64[C, F, n] (C conditions,
        F features, n taxels).

        Unlike `compute_log_density`, the result contains the term of the variances, so densities with different
        variances can be compared.
        """
        dimensions = np.array(self._settings.dimensions)
        density = self.compute_log_density(features) - 0.5 * dimensions * self._log_variance
        return float(density[..., 0].sum())  # family 0: signal

    def _average_blocks(self, values: FloatArray) -> FloatArray:
        """Compute the means of weighted values f64[C, F, n] (C conditions, F features, n taxels) over each block,
        f64[C, s, 5] (s boards, 5 families of features such as signal and noise); 0 for an empty block.
        """
        sums = self._sum_blocks(values)
        return np.divide(sums, self._total, out=np.zeros_like(sums), where=self._total > 0.0)

    def _sum_blocks(self, values: FloatArray) -> FloatArray:
        """Compute the sums of values f64[C, F, n] (C conditions, F features, n taxels) over the features and taxels of
        each block, f64[C, s, 5] (s boards, 5 families of features such as signal and noise).
        """
        families = self._fit_data.layout.families
        return np.asarray(np.stack([values[:, family].sum(axis=1) @ self._boards for family in families], axis=-1))


def fit_density(fit_data: FitData, settings: ComparisonSettings, features: FloatArray) -> BlockDensity:
    """Return the density with the model error and the repeat share that fit best to the features of the best set of
    effects.

    features: f64[C, F, n] (C conditions, F features, n taxels). The repeat share (share of the variance between
    simulated repeats) is the element of `REPEAT_SHARES` with the largest density of the signal. The model error for
    each share is the result of `BlockDensity.estimate_model_error`.
    """
    shares = REPEAT_SHARES if fit_data.state.mean_variance is not None else REPEAT_SHARES[:1]
    densities = []
    for share in shares:
        error = BlockDensity(fit_data, settings, repeat_share=share).estimate_model_error(features)
        densities.append(BlockDensity(fit_data, settings, error, share))
    return max(densities, key=lambda density: density.compute_normalised_density(features))
