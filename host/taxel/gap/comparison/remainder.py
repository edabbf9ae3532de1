"""The generic remainder: what a flexible regression explains beyond a set of effects, in features that it did not use.

A cause outside the catalogue leaves a deviation that depends on the simulated contact in some systematic way. The
regression expresses the deviation of each board as a linear function of generic functions of the simulated signal. It
competes with the sets of effects as one further hypothesis.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.gap.fitting.judge import Judge
from taxel.recording.grasp_format import Phase
from taxel.types import FloatArray

COEFFICIENT_STD: Final = 0.5
"""Prior standard deviation of a coefficient of the regression: a deviation half as large as the signal."""

CONSTANT_COUNTS: Final = 100.0
"""Counts by which constants are multiplied, so that the same prior applies to them."""

SMALL_COUNTS: Final = 150.0
"""Scale of small signals: the limit of an active taxel."""

NEIGHBOURS: Final = 8
"""Number of nearest taxels of the same board whose mean is a generic function."""


def predict_remainder(judge: Judge, in_sample: FloatArray, held_out: FloatArray) -> FloatArray:
    """Predict the features with the generic remainder beyond a set of effects, f64[C, F, n], each part by the others.

    inside, held_out: features with the set, of the fit and of the held-out prediction, f64[C, F, n].
    """
    bins, pair = judge.layout.bins, judge.state.pair
    functions = build_functions(judge, in_sample)
    deviation = (judge.target - in_sample)[:, :bins]
    weight = judge.weight[:, :bins]
    result = held_out.copy()
    parts = judge.parts
    for board in (layout.taxels for layout in pair.boards):
        own = functions[:, :, :, board]
        weighted = own * weight[None, :, :, board]
        system = np.einsum("pcfn,qcfn->cnpq", weighted, own, optimize=True)
        gradient = np.einsum("pcfn,cfn->cnp", weighted, deviation[:, :, board], optimize=True)
        whole, pull = system.sum(axis=(0, 1)), gradient.sum(axis=(0, 1))
        # The unit of the weights: one feature known as well as the others, so that the prior is relative to the data.
        prior = np.eye(len(own)) / COEFFICIENT_STD**2
        for number in np.unique(parts[:, board]).tolist():
            held = parts[:, board] == number
            rest = whole - system[held].sum(axis=0) + prior
            coefficients = np.linalg.solve(rest, pull - gradient[held].sum(axis=0))
            change = np.einsum("p,pcfn->cfn", coefficients, own)
            target = np.moveaxis(result[:, :bins][:, :, board], 1, 2)
            target[held] += np.moveaxis(change, 1, 2)[held]
            result[:, :bins, board] = np.moveaxis(target, 2, 1)
    return result


def build_functions(judge: Judge, features: FloatArray) -> FloatArray:
    """Generic functions of the signal in features f64[C, F, n], in counts, f64[p, C, B, n].

    Signal, its square over the full scale, a function of small signals; means over neighbours, lines and board; rise
    since the previous bin, largest earlier signal; a constant for closing and hold, and one for the time after release.
    """
    state, layout, bins = judge.state, judge.layout, judge.layout.bins
    signal = features[:, :bins]
    phase = layout.phase[:bins]
    before = np.concatenate([np.zeros_like(signal[:, :1]), signal[:, :-1]], axis=1)
    largest = np.maximum.accumulate(np.abs(before), axis=1)
    groups = state.pair.groups
    touch = np.broadcast_to(np.isin(phase, [Phase.CLOSING, Phase.HOLD])[:, None], signal.shape[1:])
    functions = [
        signal,
        signal**2 / float(np.max(state.full_scale)),
        signal * SMALL_COUNTS / (SMALL_COUNTS + np.abs(signal)),
        signal @ _neighbour_means(judge),
        *(signal @ _group_means(one) for one in (groups.tx, groups.rx, groups.sensor)),
        signal - before,
        np.maximum(largest - np.abs(signal), 0.0),
        CONSTANT_COUNTS * np.broadcast_to(touch, signal.shape),
        CONSTANT_COUNTS * np.broadcast_to(~touch, signal.shape),
    ]
    return np.stack(functions)


def _group_means(group: NDArray[np.intp]) -> FloatArray:
    """Mean over the other taxels of a group, f64[n, n]: from taxels, to taxels."""
    same = (group[:, None] == group).astype(np.float64)
    np.fill_diagonal(same, 0.0)
    return np.asarray(same / np.maximum(same.sum(axis=0), 1.0))


def _neighbour_means(judge: Judge) -> FloatArray:
    """Mean over the nearest taxels of the same board, f64[n, n]: from taxels, to taxels."""
    result = np.zeros((judge.state.pair.n, judge.state.pair.n))
    for board in judge.state.pair.boards:
        count = min(NEIGHBOURS, len(board.taxels) - 1)
        if count < 1:
            continue
        near = np.argsort(board.apart_m, axis=1)[:, 1 : count + 1]
        for column, rows in zip(board.taxels, near, strict=True):
            result[board.taxels[rows], column] = 1.0 / count
    return result
