"""Prediction of each part of the features by a fit that did not use this part."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from taxel.gap.fitting.composite import CompositeModel
from taxel.gap.fitting.equations import gradient_of, system_of
from taxel.gap.fitting.fit import free_links, moved, start_of
from taxel.gap.fitting.judge import Judge
from taxel.types import FloatArray

RIDGE: Final = 1e-6
"""Share of each diagonal element that is added to the normal equations, so that they can be solved without the part."""


@dataclass(frozen=True, eq=False)
class HeldOutPrediction:
    """features: f64[C, F, n], each part as the fit to the other parts predicts it. chains: these fits, one a part."""

    features: FloatArray
    composites: tuple[CompositeModel, ...] = ()


def predict_held_out(judge: Judge, composite: CompositeModel, fixed: tuple[str, ...]) -> HeldOutPrediction:
    """Predict every part of the features by the fit to all other parts.

    The fit to all features is linearised: without part k the parameters move by (H - H_k + P)^-1 (g - g_k), with the
    normal equations H and the gradient g of all features, those of the part, H_k and g_k, and the precision P of the
    priors (one Gauss-Newton step). A parameter that only the part determines keeps its value, because the other parts
    do not contradict it: a set with many such parameters gains held-out density, which the calibration compensates by
    the number of parameters. The features follow from the derivatives. Parts: `Judge.parts`. fixed: effects whose
    values are not fitted.
    """
    start = start_of(judge.state, composite, fixed)
    if not start.columns:
        return HeldOutPrediction(start.features)
    precision = np.diag(np.concatenate([column.precision for column in start.columns]))
    whole = judge.problem()
    system, gradient = system_of(whole, start.columns), gradient_of(whole, start.columns, start.features)
    result, free = start.features.copy(), free_links(composite, fixed)
    composites = []
    for number in range(int(judge.parts.max()) + 1):
        held = judge.parts == number
        part = judge.problem(held)
        rest = system - system_of(part, start.columns) + precision
        rest[np.diag_indices_from(rest)] += RIDGE * np.diag(system) + np.finfo(float).tiny
        missing = gradient - gradient_of(part, start.columns, start.features)
        step = _limit_step(composite, fixed, np.asarray(np.linalg.solve(rest, missing), np.float64))
        change, first = np.zeros_like(result), 0
        for column in start.columns:
            change += column.change * step[first : first + column.count][column.blocks][:, None]
            first += column.count
        np.moveaxis(result, 1, 2)[held] += np.moveaxis(change, 1, 2)[held]
        composites.append(moved(composite, free, step))
    return HeldOutPrediction(result, tuple(composites))


def _limit_step(composite: CompositeModel, fixed: tuple[str, ...], step: FloatArray) -> FloatArray:
    """Shorten a step of the free parameters f64[p], so that every parameter stays within its bounds."""
    result, first = step.copy(), 0
    for link in composite.links:
        if link.effect.name in fixed:
            continue
        for row, parameter in enumerate(link.effect.parameters()):
            values = link.values[row]
            own = slice(first, first + len(values))
            result[own] = np.clip(values + step[own], parameter.low, parameter.high) - values
            first += len(values)
    return result
