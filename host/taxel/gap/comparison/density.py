"""Log predictive density of features, by condition, board and family of features."""

from __future__ import annotations

from typing import Final

import numpy as np

from taxel.gap.comparison.settings import ComparisonSettings
from taxel.gap.features.metric import total
from taxel.gap.fitting.judge import Judge
from taxel.types import FloatArray

REPEAT_SHARES: Final = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Shares of the variance between simulated repeats that are compared: 1 for random repeats, less for repeats that were
planned such that their variation cancels in the mean."""


class BlockDensity:
    """Density of real features given predicted ones; a block consists of the features of one family on one board in one
    condition.

    The deviation of a block is the mean squared difference of its features, each divided by the variance of the real
    mean. The density of a block is that of a multivariate Student t distribution with S - 1 degrees of freedom for S
    sessions and `settings.dimensions` effective dimensions: a block that no set predicts, such as a faulty contact of
    the simulator, changes the comparison by a bounded amount.
    """

    def __init__(
        self, judge: Judge, settings: ComparisonSettings, model_error: float = 0.0, repeat_share: float = 1.0
    ) -> None:
        """Prepare the density for the real sessions of a pair; features that do not count have no weight.

        model_error: relative error of the simulated signal, of a taxel in a condition (`estimate_model_error`).
        repeat_share: share of the variance of the simulated mean (`State.mean_variance`) that applies.
        """
        self._judge, self._settings = judge, settings
        self.repeat_share = repeat_share
        real, layout = judge.sessions, judge.layout
        self._freedom = max(real.value.shape[1] - 1, 1)
        variance = real.mean_variance.copy()
        if judge.state.mean_variance is not None:
            variance += repeat_share * judge.state.mean_variance
        for family, resolution in zip(layout.families, settings.resolution_counts, strict=True):
            variance[:, family] += resolution**2
        self._variance = variance
        self._signal = np.maximum(np.abs(judge.state.mean), np.abs(judge.target))[:, : layout.bins]
        variance = variance.copy()
        variance[:, : layout.bins] += (model_error * self._signal) ** 2
        counts = (judge.weight > 0) & real.known.any(axis=1)
        self._share = np.where(counts, layout.weight[:, None], 0.0)
        self._weight = self._share / variance
        sensor = judge.state.pair.groups.sensor
        self._boards = (sensor[:, None] == np.arange(int(sensor.max()) + 1)).astype(np.float64)
        self._total = self._sum_blocks(self._share)
        self._log_variance = self._average_blocks(self._share * np.log(variance))

    def estimate_model_error(self, features: FloatArray) -> float:
        """Estimate the relative error of the simulated signal from features f64[C, F, n] with the best set of effects.

        The error of a block is the root of its mean square deviation beyond the variance of the real mean, relative to
        its mean square signal. The result is the median over the loaded blocks, at least
        `settings.smallest_model_error`, so that a few blocks with an error of another kind do not determine it.
        """
        bins = self._judge.layout.bins
        share = self._share[:, :bins]
        beyond = (self._judge.target - features)[:, :bins] ** 2 - self._variance[:, :bins]
        excess, power = ((share * part).sum(axis=1) @ self._boards for part in (beyond, self._signal**2))
        loaded = power > self._settings.loaded_share * max(float(power.max()), np.finfo(float).tiny)
        error2 = float(np.median(excess[loaded] / power[loaded])) if loaded.any() else 0.0
        return max(float(np.sqrt(max(error2, 0.0))), self._settings.smallest_model_error)

    def compute_simulated_floor2(self) -> float:
        """Squared gap that the variation between simulated repeats alone causes, counts^2."""
        variance = self._judge.state.mean_variance
        if variance is None:
            return 0.0
        return self.repeat_share * total(np.where(self._share > 0.0, self._share * variance, 0.0))

    def compute_deviations(self, features: FloatArray) -> FloatArray:
        """Mean squared standardised difference of each block from predicted features f64[C, F, n], f64[C, s, 5].

        About 1 where only sessions and repeats vary; 0 for a block without features.
        """
        return self._average_blocks(self._weight * (self._judge.target - features) ** 2)

    def compute_log_density(self, features: FloatArray) -> FloatArray:
        """Log density of each block given predicted features f64[C, F, n], up to a constant, f64[C, s, 5]."""
        dimensions, degrees_of_freedom = np.array(self._settings.dimensions), self._freedom
        deviations = self.compute_deviations(features)
        return np.asarray(
            -0.5 * (degrees_of_freedom + dimensions) * np.log1p(dimensions * deviations / degrees_of_freedom)
        )

    def compute_normalised(self, features: FloatArray) -> float:
        """Log density of all blocks of the signal given features f64[C, F, n], up to a constant that does not depend on
        the variances.
        """
        dimensions = np.array(self._settings.dimensions)
        density = self.compute_log_density(features) - 0.5 * dimensions * self._log_variance
        return float(density[..., 0].sum())

    def _average_blocks(self, values: FloatArray) -> FloatArray:
        """Means of weighted values f64[C, F, n] over each block, f64[C, s, 5]; 0 for an empty block."""
        sums = self._sum_blocks(values)
        return np.divide(sums, self._total, out=np.zeros_like(sums), where=self._total > 0.0)

    def _sum_blocks(self, values: FloatArray) -> FloatArray:
        """Sums of values f64[C, F, n] over the features and taxels of each block, f64[C, s, 5]."""
        families = self._judge.layout.families
        return np.asarray(np.stack([values[:, family].sum(axis=1) @ self._boards for family in families], axis=-1))


def fit_density(judge: Judge, settings: ComparisonSettings, features: FloatArray) -> BlockDensity:
    """Fit the two variances of the simulated mean to features f64[C, F, n] with the best set of effects.

    The share of the variance between repeats is the one of `REPEAT_SHARES` with the largest density of the signal; the
    model error of each share is that of `BlockDensity.estimate_model_error`.
    """
    shares = REPEAT_SHARES if judge.state.mean_variance is not None else REPEAT_SHARES[:1]
    fitted = []
    for share in shares:
        error = BlockDensity(judge, settings, repeat_share=share).estimate_model_error(features)
        fitted.append(BlockDensity(judge, settings, error, share))
    return max(fitted, key=lambda density: density.compute_normalised(features))
