"""Consistency of a predicted change over the sessions: do all sessions show the change?

A deviation that all taxels of one session have in common, such as a stronger grip, improves the prediction of every
condition of this session. Only a comparison of the sessions shows that it is a random deviation.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from taxel.gap.features.distributions import compute_student_survival
from taxel.gap.fitting.fit_data import FitData
from taxel.types import FloatArray


@dataclass(frozen=True)
class Consistency:
    """Consistency of a predicted change over independent units.

    amplitude: ratio of the real to the predicted change, 1 for a correct prediction. evidence: negative logarithm of
    the probability of such an amplitude, in relation to its variation between the units, if the real change is 0.
    """

    amplitude: float
    evidence: float


NO_EVIDENCE: Final = Consistency(0.0, float(np.log(2.0)))
"""Consistency of a change whose amplitude is 0, or of fewer than two units: a probability of one half."""


def compute_consistency(products: FloatArray, squares: FloatArray) -> Consistency:
    """Return the consistency of a change.

    products: f64[u], products of the predicted change and the real deviation, summed over the features of each of u
    units. squares: f64[u], sums of the squared predicted change. The amplitude is sum(products) / sum(squares), and its
    error is the jackknife error over the units (Tukey 1958). The evidence is the negative logarithm of the probability
    that a variable with a Student t distribution exceeds the ratio of both. The degrees of freedom are the effective
    number of units, sum(squares)^2 / sum(squares^2), minus 1: a change that occurs in one unit alone has no evidence.
    """
    is_used = squares > 0.0
    products, squares = products[is_used], squares[is_used]
    count = len(squares)
    if count < 2:
        return NO_EVIDENCE
    total = float(squares.sum())
    amplitude = float(products.sum()) / total
    without_one = (products.sum() - products) / (total - squares)
    error = np.sqrt((count - 1) / count * np.sum((without_one - without_one.mean()) ** 2))
    degrees_of_freedom = total**2 / float(np.sum(squares**2)) - 1.0
    ratio = amplitude / max(float(error), np.finfo(float).tiny)
    survival = compute_student_survival(ratio, max(degrees_of_freedom, 1e-3))
    # Sessions without any variation give a probability of 0: the smallest number keeps the evidence finite.
    return Consistency(amplitude, -math.log(max(survival, float(np.finfo(float).tiny))))


def compute_session_consistency(
    fit_data: FitData, with_change: Sequence[FloatArray], without: Sequence[FloatArray]
) -> Consistency:
    """Return the consistency over the sessions of the change between two predictions, see `compute_consistency`.

    with_change, without: predictions f64[C, F, n] (C conditions, F features, n taxels), counts, for each session: from
    fits that did not use this session.
    """
    sessions = fit_data.sessions
    products, squares = np.zeros(len(without)), np.zeros(len(without))
    for session, (prediction, reference) in enumerate(zip(with_change, without, strict=True)):
        is_known = sessions.is_known[:, session]
        change = np.where(is_known, prediction - reference, 0.0)
        weighted = fit_data.weight * change
        residual = np.where(is_known, sessions.value[:, session] - reference, 0.0)
        products[session], squares[session] = np.sum(weighted * residual), np.sum(weighted * change)
    return compute_consistency(products, squares)
