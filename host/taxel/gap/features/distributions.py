"""Survival functions and quantiles of the distributions that p-values and intervals require.

`scipy.stats` contains them, too, but its import takes 0.2 s, as long as a small diagnosis needs to read its files.
"""

from __future__ import annotations

from scipy.special import chdtri, fdtrc, stdtr, stdtrit


def compute_student_survival(value: float, degrees_of_freedom: float) -> float:
    """Return the probability that Student's t exceeds a value."""
    return float(stdtr(degrees_of_freedom, -value))


def compute_student_quantile(probability: float, degrees_of_freedom: float) -> float:
    """Return the quantile of Student's t at a probability."""
    return float(stdtrit(degrees_of_freedom, probability))


def compute_fisher_survival(ratio: float, numerator: float, denominator: float) -> float:
    """Return the probability that Fisher's F exceeds a ratio. numerator, denominator: degrees of freedom."""
    return float(fdtrc(numerator, denominator, ratio))


def compute_chi2_quantile(probability: float, degrees_of_freedom: float) -> float:
    """Return the quantile of the chi-squared distribution at a probability."""
    return float(chdtri(degrees_of_freedom, 1.0 - probability))
