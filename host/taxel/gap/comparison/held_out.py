"""Prediction of each part of the features by a fit that did not use this part."""

from __future__ import annotations

from typing import Final

import numpy as np

from taxel.gap.chain import Chain
from taxel.gap.equations import gradient_of, system_of
from taxel.gap.fit import start_of
from taxel.gap.judge import Judge
from taxel.types import FloatArray

RIDGE: Final = 1e-6
"""Share of each diagonal element that is added to the normal equations: a parameter that only the held-out part
determines keeps its value."""


def predict_held_out(judge: Judge, chain: Chain, fixed: tuple[str, ...]) -> FloatArray:
    """Predict every part of the features, f64[C, F, n], by the fit to all other parts.

    The fit to all features is linearised: without part k the parameters move by (H - H_k)^-1 (g - g_k), with the normal
    equations H and the gradient g of all features and those of the part, H_k and g_k (one Gauss-Newton step). The
    features follow from the derivatives. Parts: `Judge.parts`. fixed: effects whose values are not fitted.
    """
    start = start_of(judge.state, chain, fixed)
    if not start.columns:
        return start.features
    precision = np.diag(np.concatenate([column.precision for column in start.columns]))
    whole = judge.problem()
    system, gradient = system_of(whole, start.columns), gradient_of(whole, start.columns, start.features)
    result = start.features.copy()
    for number in range(int(judge.parts.max()) + 1):
        held = judge.parts == number
        part = judge.problem(held)
        rest = system - system_of(part, start.columns) + precision
        rest[np.diag_indices_from(rest)] += RIDGE * np.diag(system) + np.finfo(float).tiny
        missing = gradient - gradient_of(part, start.columns, start.features)
        step = _limit_step(chain, fixed, np.asarray(np.linalg.solve(rest, missing), np.float64))
        change, first = np.zeros_like(result), 0
        for column in start.columns:
            change += column.change * step[first : first + column.count][column.blocks][:, None]
            first += column.count
        np.moveaxis(result, 1, 2)[held] += np.moveaxis(change, 1, 2)[held]
    return result


def _limit_step(chain: Chain, fixed: tuple[str, ...], step: FloatArray) -> FloatArray:
    """Shorten a step of the free parameters f64[p], so that every parameter stays within its bounds."""
    result, first = step.copy(), 0
    for link in chain.links:
        if link.effect.name in fixed:
            continue
        for row, parameter in enumerate(link.effect.parameters()):
            values = link.values[row]
            own = slice(first, first + len(values))
            result[own] = np.clip(values + step[own], parameter.low, parameter.high) - values
            first += len(values)
    return result
