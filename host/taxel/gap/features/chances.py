"""Tails and quantiles of the distributions that p-values and intervals come from.

`scipy.stats` has them too, and takes a fifth of a second to import: as long as a small diagnosis reads its files.
"""

from __future__ import annotations

from scipy.special import chdtri, fdtrc, stdtr, stdtrit


def compute_student_survival(value: float, degrees_of_freedom: float) -> float:
    """Chance that Student's t is above a value."""
    return float(stdtr(degrees_of_freedom, -value))


def student_quantile(share: float, degrees_of_freedom: float) -> float:
    """Value below which so much of Student's t lies."""
    return float(stdtrit(degrees_of_freedom, share))


def compute_fisher_survival(ratio: float, above: float, below: float) -> float:
    """Chance that Fisher's F with so many degrees of freedom above and below the line exceeds a ratio."""
    return float(fdtrc(above, below, ratio))


def chi2_quantile(share: float, degrees_of_freedom: float) -> float:
    """Value below which so much of a chi-squared lies."""
    return float(chdtri(degrees_of_freedom, 1.0 - share))
