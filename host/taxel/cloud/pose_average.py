"""Averages over where an object may have lain: ln of the mean of a likelihood over poses, by importance sampling.

A pose is a shift, metres, and a turn about the object's middle, as a rotation vector times ARM_M, so that all six
numbers are metres. Before anything was felt it is distributed about the place that the dataset states, as a mixture of
normal distributions (ASIDE_M). A likelihood of some hundred taxels leaves far less room than that, so draws from the
prior alone would miss it. Draws are taken where earlier draws did well, and weighed by the prior over the density of
all that was drawn from (adaptive multiple importance sampling, Cornuet et al. 2012, with the deterministic mixture
weights of Owen and Zhou 2000): the average stays that over the prior, whatever the draws were.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Final

import numpy as np
from scipy.special import ndtri

from taxel.types import FloatArray

ASIDE_M: Final = (0.001, 0.0035)
"""Standard deviations of each of the six numbers, equally likely: an object put there by a machine, or by hand. Turns
of 0.8 and 2.7 degrees. Wide tails would let a shape be explained by another one far away."""

ARM_M: Final = 0.075
"""A turn moves what lies so far from the middle, as the ends of things that a hand holds do, by as much as a shift."""

FIRST_DRAWS: Final = 128
"""From each part of the prior; a power of 2, as Sobol points want."""

ROUNDS: Final = 12
NEXT_DRAWS: Final = 64

ENOUGH: Final = 25.0
"""Draws that share the weight (effective sample size, Kish 1965) before a normal distribution is fitted to them: until
then the likelihood is raised to a power below 1."""

WIDER: Final = 1.3
NARROWEST_M: Final = 0.0002
"""What is drawn from next: the covariance times WIDER, and at least this standard deviation."""

LogLikelihood = Callable[[FloatArray], FloatArray]
"""Of poses f64[n, 6]: f64[n, K], natural logarithms, for K settings of something else."""


def average_over_poses(log_likelihood: LogLikelihood, seed: int) -> FloatArray:
    """Natural logarithm of the mean of a likelihood over the prior of poses, f64[K].

    seed: of the draws; where each of some grasps that are alike has its own, their errors do not add up.
    """
    parts = list(_PRIOR)
    counts = np.array([FIRST_DRAWS] * len(parts) + [NEXT_DRAWS] * ROUNDS)
    normal = np.split(_standard(int(counts.sum()), seed), np.cumsum(counts)[:-1])
    poses = np.concatenate([part.of(normal[row]) for row, part in enumerate(parts)])
    densities = np.stack([part.log_density(poses) for part in parts])  # of each part at each draw
    told = log_likelihood(poses)
    known = log_sum(told, axis=1)
    for row in range(len(parts), len(counts)):
        parts.append(_where_it_does_well(poses, _ratio(densities, counts[:row]), known))
        fresh = parts[-1].of(normal[row])
        there = np.stack([part.log_density(fresh) for part in parts])
        densities = np.hstack([np.vstack([densities, parts[-1].log_density(poses)]), there])
        poses = np.concatenate([poses, fresh])
        told = np.concatenate([told, log_likelihood(fresh)])
        known = np.concatenate([known, log_sum(told[-NEXT_DRAWS:], axis=1)])
    return np.asarray(log_sum(told + _ratio(densities, counts)[:, None], axis=0) - np.log(len(poses)))


def log_sum(logs: FloatArray, axis: int) -> FloatArray:
    """Logarithm of the sum of what these are the logarithms of, all finite. SciPy's takes six times as long."""
    most = logs.max(axis=axis, keepdims=True)
    return np.asarray(np.log(np.exp(logs - most).sum(axis=axis)) + most.squeeze(axis))


class _Normal:
    """A normal distribution by its mean f64[6] and the root of its covariance, f64[6, 6], lower triangular."""

    def __init__(self, mean: FloatArray, root: FloatArray) -> None:
        self._mean, self._root = mean, root
        self._inverse = np.linalg.inv(root).T
        self._scale = float(np.log(np.diag(root)).sum())

    def log_density(self, poses: FloatArray) -> FloatArray:
        """At poses f64[n, 6]: f64[n], without the power of 2 pi, which cancels."""
        scaled = (poses - self._mean) @ self._inverse
        return np.asarray(-0.5 * np.einsum("ij,ij->i", scaled, scaled) - self._scale)

    def of(self, normal: FloatArray) -> FloatArray:
        """Draws f64[n, 6] of standard normal ones."""
        return np.asarray(self._mean + normal @ self._root.T)


_PRIOR: Final = tuple(_Normal(np.zeros(6), scale * np.eye(6)) for scale in ASIDE_M)


def _ratio(densities: FloatArray, counts: FloatArray) -> FloatArray:
    """Logarithm of the prior over the density of all that was drawn from, f64[n]. densities: of each distribution at
    each draw, those of the prior first; counts: of draws from each.
    """
    prior = log_sum(densities[: len(_PRIOR)], axis=0) - np.log(len(_PRIOR))
    drawn = log_sum(densities + np.log(counts)[:, None], axis=0) - np.log(counts.sum())
    return np.asarray(prior - drawn)


def _where_it_does_well(poses: FloatArray, ratio: FloatArray, told: FloatArray) -> _Normal:
    """Fitted to weighted draws, the likelihood to such a power that ENOUGH of them share the weight."""
    power, step = 1.0, 0.5
    weights = _shares(ratio + told)
    if _effective(weights) < ENOUGH:
        power = 0.0
        for _ in range(10):
            trial = _shares(ratio + (power + step) * told)
            power += step if _effective(trial) >= ENOUGH else 0.0
            step /= 2.0
        weights = _shares(ratio + power * told)
    mean = weights @ poses
    arms = poses - mean
    covariance: FloatArray = WIDER * (arms * weights[:, None]).T @ arms + NARROWEST_M**2 * np.eye(6)
    return _Normal(mean, np.asarray(np.linalg.cholesky(covariance), np.float64))


def _shares(logs: FloatArray) -> FloatArray:
    weights = np.exp(logs - logs.max())
    return np.asarray(weights / weights.sum())


def _effective(weights: FloatArray) -> float:
    return float(1.0 / (weights @ weights))


@lru_cache(maxsize=256)
def _standard(count: int, seed: int) -> FloatArray:
    """Standard normal draws f64[count, 6], evenly spread (Sobol, scrambled), and so is each 64 of them."""
    from scipy.stats import qmc  # half a second, which commands that draw nothing need not wait

    return np.asarray(ndtri(qmc.Sobol(6, rng=np.random.default_rng(seed)).random(count)))
