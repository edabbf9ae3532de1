"""Average of a likelihood over the uncertain pose of an object, by adaptive importance sampling.

A pose is a shift (metres) and a rotation about the centre of the object (rotation vector times TURN_ARM_M, so that all
six numbers are metres). The prior is a mixture of normal distributions around the pose that the dataset states
(POSE_STD_M). The likelihood of some hundred taxels is far narrower than the prior, so that samples of the prior alone
would miss it. Later samples are therefore taken where earlier samples had a high likelihood, and every sample has the
weight prior density / density of the mixture of all sampling distributions (adaptive multiple importance sampling,
Cornuet et al. 2012, with the deterministic mixture weights of Owen and Zhou 2000). With these weights the result
estimates the average over the prior for any choice of sampling distributions.
"""

from collections.abc import Callable
from functools import lru_cache
from typing import Final

import numpy as np
from scipy.special import ndtri

from taxel.types import FloatArray

POSE_STD_M: Final = (0.001, 0.0035)
"""Standard deviations of the six numbers of a pose in the two equally likely parts of the prior: an object placed by a
machine and an object placed by hand. For rotations they correspond to 0.8 and 2.7 degrees. A prior with heavy tails
would permit a model to explain the contacts of another shape with a distant pose."""

TURN_ARM_M: Final = 0.075
"""Lever arm by which a rotation vector in radians is multiplied to become a length: the distance from the centre to the
ends of objects that a hand grasps, metres."""

PRIOR_SAMPLES: Final = 128
"""Number of samples from each part of the prior; a power of 2, as Sobol points require."""

ITERATIONS: Final = 12
ITERATION_SAMPLES: Final = 64
"""Number of further sampling distributions, and number of samples from each of them."""

MIN_EFFECTIVE_SAMPLES: Final = 25.0
"""Smallest effective sample size (Kish 1965) to which a normal distribution is fitted. If it is smaller, the likelihood
is raised to a power below 1 for the fit."""

COVARIANCE_FACTOR: Final = 1.3
MIN_STD_M: Final = 0.0002
"""The next sampling distribution has the fitted covariance times COVARIANCE_FACTOR, plus MIN_STD_M squared on the
diagonal."""

LogLikelihood = Callable[[FloatArray], FloatArray]
"""Function of poses f64[n, 6] that returns log likelihoods f64[n, K] for K settings of other parameters."""


def average_over_poses(log_likelihood: LogLikelihood, seed: int) -> FloatArray:
    """Compute the log of a likelihood's mean over the prior of object poses, f64[K], by importance sampling.

    The first samples follow the prior; each iteration adds samples of a normal distribution that is fitted to the
    weighted samples so far. log_likelihood: function of poses f64[n, 6] with result f64[n, K]. seed: seed of the
    samples. With a different seed for each grasp of a cloud, the sampling errors of the grasps are independent.
    """
    distributions = list(_PRIOR)
    counts = np.array([PRIOR_SAMPLES] * len(distributions) + [ITERATION_SAMPLES] * ITERATIONS)
    standard = np.split(_sample_standard_normal(int(counts.sum()), seed), np.cumsum(counts)[:-1])
    poses = np.concatenate([part.transform(standard[row]) for row, part in enumerate(distributions)])
    densities = np.stack([part.log_density(poses) for part in distributions])  # f64[distributions, samples]
    values = log_likelihood(poses)
    totals = log_sum_exp(values, axis=1)
    for row in range(len(distributions), len(counts)):
        distributions.append(_fit_proposal(poses, _log_prior_ratio(densities, counts[:row]), totals))
        new_poses = distributions[-1].transform(standard[row])
        new_densities = np.stack([part.log_density(new_poses) for part in distributions])
        densities = np.hstack([np.vstack([densities, distributions[-1].log_density(poses)]), new_densities])
        poses = np.concatenate([poses, new_poses])
        values = np.concatenate([values, log_likelihood(new_poses)])
        totals = np.concatenate([totals, log_sum_exp(values[-ITERATION_SAMPLES:], axis=1)])
    weighted = values + _log_prior_ratio(densities, counts)[:, None]
    return np.asarray(log_sum_exp(weighted, axis=0) - np.log(len(poses)))


def log_sum_exp(logs: FloatArray, axis: int) -> FloatArray:
    """Compute the logarithm of the sum of exp(logs) over an axis without overflow; all values must be finite.

    `scipy.special.logsumexp` takes six times as long.
    """
    largest = logs.max(axis=axis, keepdims=True)
    return np.asarray(np.log(np.exp(logs - largest).sum(axis=axis)) + largest.squeeze(axis))


class _Normal:
    """A normal distribution of poses. mean: f64[6]. root: lower triangular root of the covariance, f64[6, 6]."""

    def __init__(self, mean: FloatArray, root: FloatArray) -> None:
        """Create a normal distribution of poses.

        mean: f64[6]. root: lower triangular root of the covariance, f64[6, 6].
        """
        self._mean, self._root = mean, root
        self._inverse = np.linalg.inv(root).T
        self._log_determinant = float(np.log(np.diag(root)).sum())

    def log_density(self, poses: FloatArray) -> FloatArray:
        """Return the log density f64[n] of this normal distribution at poses f64[n, 6].

        The constant term with log(2 pi) is omitted, because it cancels in the weights of the samples.
        """
        scaled = (poses - self._mean) @ self._inverse
        return np.asarray(-0.5 * np.einsum("ij,ij->i", scaled, scaled) - self._log_determinant)

    def transform(self, standard: FloatArray) -> FloatArray:
        """Convert standard normal samples f64[n, 6] to samples of this normal distribution, f64[n, 6]."""
        return np.asarray(self._mean + standard @ self._root.T)


_PRIOR: Final = tuple(_Normal(np.zeros(6), scale * np.eye(6)) for scale in POSE_STD_M)


def _log_prior_ratio(densities: FloatArray, counts: FloatArray) -> FloatArray:
    """Compute the log of the prior density divided by the density of the mixture of sampling distributions, f64[n].

    densities: log density of each distribution at each sample, the parts of the prior first. counts: number of samples
    from each distribution.
    """
    prior = log_sum_exp(densities[: len(_PRIOR)], axis=0) - np.log(len(_PRIOR))
    mixture = log_sum_exp(densities + np.log(counts)[:, None], axis=0) - np.log(counts.sum())
    return np.asarray(prior - mixture)


def _fit_proposal(poses: FloatArray, log_ratio: FloatArray, log_likelihood: FloatArray) -> _Normal:
    """Fit a normal distribution to weighted samples of poses; it is the next sampling distribution.

    poses: f64[n, 6]. log_ratio: logarithm of prior density divided by sampling density, f64[n]. log_likelihood: f64[n].
    The likelihood is raised to the largest power up to 1 at which the effective sample size is at least
    MIN_EFFECTIVE_SAMPLES; this power is found by bisection.
    """
    power, step = 1.0, 0.5
    weights = _normalise(log_ratio + log_likelihood)
    if _effective_samples(weights) < MIN_EFFECTIVE_SAMPLES:
        power = 0.0
        for _ in range(10):
            stepped_weights = _normalise(log_ratio + (power + step) * log_likelihood)
            power += step if _effective_samples(stepped_weights) >= MIN_EFFECTIVE_SAMPLES else 0.0
            step /= 2.0
        weights = _normalise(log_ratio + power * log_likelihood)
    mean = weights @ poses
    arms = poses - mean
    covariance: FloatArray = COVARIANCE_FACTOR * (arms * weights[:, None]).T @ arms + MIN_STD_M**2 * np.eye(6)
    return _Normal(mean, np.asarray(np.linalg.cholesky(covariance), np.float64))


def _normalise(logs: FloatArray) -> FloatArray:
    """Convert log weights f64[n] to weights with the sum 1."""
    weights = np.exp(logs - logs.max())
    return np.asarray(weights / weights.sum())


def _effective_samples(weights: FloatArray) -> float:
    """Compute the effective sample size 1 / sum(w^2) of weights f64[n] with the sum 1."""
    return float(1.0 / (weights @ weights))


@lru_cache(maxsize=256)
def _sample_standard_normal(count: int, seed: int) -> FloatArray:
    """Return standard normal samples f64[count, 6]: a scrambled Sobol sequence, transformed by the inverse normal CDF.

    Each block of 64 samples is evenly distributed, like the whole sequence.
    """
    from scipy.stats import qmc  # the import takes half a second, which commands without samples need not wait for

    return np.asarray(ndtri(qmc.Sobol(6, rng=np.random.default_rng(seed)).random(count)))
