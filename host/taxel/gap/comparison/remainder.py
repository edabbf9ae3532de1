"""Generic remainder: held-out prediction of a flexible regression beyond a set of effects.

A cause outside the catalogue leaves a deviation that depends on the simulated contact in some systematic way. The
regression expresses the deviation of each board as a linear function of generic functions of the simulated signal. It
competes with the sets of effects as one further hypothesis.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.gap.fitting.fit_data import FitData
from taxel.recording.grasp_format import Phase
from taxel.types import FloatArray

COEFFICIENT_STD: Final = 0.5
"""Prior standard deviation of a regression coefficient (chosen): a deviation half as large as the signal."""

CONSTANT_COUNTS: Final = 100.0
"""Value of the constant functions in counts (chosen), so that the same prior applies to their coefficients."""

SMALL_COUNTS: Final = 150.0
"""Scale of small signals in counts: the limit of an active taxel."""

NEIGHBOURS: Final = 8
"""Number of nearest taxels of the same board whose mean signal is a generic function (chosen)."""


def predict_remainder(fit_data: FitData, in_sample: FloatArray, held_out: FloatArray) -> FloatArray:
    """Return the features that a set of effects and the generic remainder together predict, f64[C, F, n] (C conditions,
    F features, n taxels), counts.

    The generic remainder is a linear combination of the functions of `build_functions`, with coefficients for each
    board; it stands for a cause outside the catalogue. Each fold is predicted by regressions on the other folds.

    in_sample, held_out: features that the set alone predicts, from the fit to all data and from the held-out
    prediction, f64[C, F, n].
    """
    bins, pair = fit_data.layout.bins, fit_data.state.pair
    functions = build_functions(fit_data, in_sample)
    deviation = (fit_data.target - in_sample)[:, :bins]
    weight = fit_data.weight[:, :bins]
    result = held_out.copy()
    folds = fit_data.taxel_folds
    for board in (layout.taxels for layout in pair.boards):
        board_functions = functions[:, :, :, board]
        # Normal equations for each condition and taxel. Axes: p, q functions; c conditions; f time bins; n taxels.
        weighted = board_functions * weight[None, :, :, board]
        system = np.einsum("pcfn,qcfn->cnpq", weighted, board_functions, optimize=True)
        gradient = np.einsum("pcfn,cfn->cnp", weighted, deviation[:, :, board], optimize=True)
        full_system, full_gradient = system.sum(axis=(0, 1)), gradient.sum(axis=(0, 1))
        # The weights are 1 / variance, so that the prior precision is comparable with the information of the data.
        prior = np.eye(len(board_functions)) / COEFFICIENT_STD**2
        functions_by_taxel = np.moveaxis(board_functions, 2, 3)  # axes p, c, n, f
        part = np.moveaxis(result[:, :bins][:, :, board], 1, 2)
        for fold in np.unique(folds[:, board]).tolist():
            is_held_out = folds[:, board] == fold
            remaining_system = full_system - system[is_held_out].sum(axis=0) + prior
            coefficients = np.linalg.solve(remaining_system, full_gradient - gradient[is_held_out].sum(axis=0))
            part[is_held_out] += np.tensordot(coefficients, functions_by_taxel[:, is_held_out], axes=1)
        result[:, :bins, board] = np.moveaxis(part, 2, 1)
    return result


def build_functions(fit_data: FitData, features: FloatArray) -> FloatArray:
    """Compute the p generic functions of the predicted signal, counts, f64[p, C, B, n] (C conditions, B time bins, n
    taxels).

    features: f64[C, F, n] (F features), predicted features. The functions are: the signal, its square over the full
    scale, a function of small signals; means over neighbours, TX line, RX line and board; the rise since the previous
    bin, the decrease from the largest earlier signal; a constant for closing and hold, and a constant for the time
    after release.
    """
    state, layout, bins = fit_data.state, fit_data.layout, fit_data.layout.bins
    signal = features[:, :bins]
    phase = layout.phase[:bins]
    previous = np.concatenate([np.zeros_like(signal[:, :1]), signal[:, :-1]], axis=1)
    largest_earlier = np.maximum.accumulate(np.abs(previous), axis=1)
    groups = state.pair.groups
    is_contact = np.broadcast_to(np.isin(phase, [Phase.CLOSING, Phase.HOLD])[:, None], signal.shape[1:])
    functions = [
        signal,
        signal**2 / float(np.max(state.full_scale)),
        signal * SMALL_COUNTS / (SMALL_COUNTS + np.abs(signal)),
        signal @ _build_neighbour_means(fit_data),
        *(signal @ _build_group_means(one) for one in (groups.tx, groups.rx, groups.sensor)),
        signal - previous,
        np.maximum(largest_earlier - np.abs(signal), 0.0),
        CONSTANT_COUNTS * np.broadcast_to(is_contact, signal.shape),
        CONSTANT_COUNTS * np.broadcast_to(~is_contact, signal.shape),
    ]
    return np.stack(functions)


def _build_group_means(group: NDArray[np.intp]) -> FloatArray:
    """Return the matrix of means over the other taxels of the same group, f64[n, n] (n taxels): row is the source,
    column the result. group: number of the group of each taxel.
    """
    is_other_member = (group[:, None] == group).astype(np.float64)
    np.fill_diagonal(is_other_member, 0.0)
    return np.asarray(is_other_member / np.maximum(is_other_member.sum(axis=0), 1.0))


def _build_neighbour_means(fit_data: FitData) -> FloatArray:
    """Return the matrix of means over the nearest taxels of the same board, f64[n, n] (n taxels): row is the source,
    column the result.
    """
    result = np.zeros((fit_data.state.pair.n, fit_data.state.pair.n))
    for board in fit_data.state.pair.boards:
        count = min(NEIGHBOURS, len(board.taxels) - 1)
        if count < 1:
            continue
        nearest = np.argsort(board.distance_m, axis=1)[:, 1 : count + 1]  # without column 0, the taxel itself
        for column, rows in zip(board.taxels, nearest, strict=True):
            result[board.taxels[rows], column] = 1.0 / count
    return result
