"""The field `model` of an effect: form, scope and all values with units, as needed to add the effect to other data."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from taxel.gap.data.pair import Pair
from taxel.gap.effects.dropout import Dropout
from taxel.gap.effects.effect import BOARD, HAND, OBJECT
from taxel.gap.features.features import compute_known_mean
from taxel.gap.fitting.composite import FittedEffect
from taxel.gap.fitting.state import State
from taxel.types import FloatArray

NOISE_COMPONENTS: Final = ("white_counts", "tx_counts", "rx_counts", "board_counts")
"""Names of the standard deviations of the independent parts of noise, counts: white noise of each taxel, and noise
common to a TX line, to an RX line, and to a board."""

MIN_COMMON_SHARE: Final = 0.01
"""Share of the added variance below which the common noise is set to 0, because chance produces such covariances."""


def describe_model(state: State, fitted_effect: FittedEffect) -> dict[str, Any]:
    """Return the field `model` of the entry of a fitted effect.

    Its field `until_s` is the end of the fitted data, seconds from the beginning of closing; a drift reaches its counts
    at this time. Its field `shift_s` is the delay, seconds, by which the time alignment has shifted the simulation for
    all boards together. The total delay of a board is its fitted latency plus `shift_s`.
    """
    pair, effect, values = state.pair, fitted_effect.effect, fitted_effect.values
    units = {parameter.name: parameter.unit for parameter in effect.parameters()}
    rows = dict(zip(units, values, strict=True))
    if effect.name == "noise":
        units = dict.fromkeys(NOISE_COMPONENTS, "counts")
        rows = dict(zip(NOISE_COMPONENTS, split_noise(pair, fitted_effect), strict=True))
    model: dict[str, Any] = {
        "form": effect.variant,
        "scope": effect.scope,
        "order": effect.order,
        "until_s": float(pair.time_grid.time_since_start_s[-1]),
        "shift_s": state.shift_s,
        "blocks": list_block_names(pair, effect.scope)[: values.shape[1]],
        "parameters": {name: {"unit": unit, "values": rows[name].tolist()} for name, unit in units.items()},
    }
    if isinstance(effect, Dropout):
        missing = effect.defects.missing
        model["missing"] = {"blocks": list_block_names(pair, BOARD)[: len(missing)], "values": missing.tolist()}
        model["shorts"] = [[one.address, one.axis, one.index, one.share] for one in effect.defects.shorts]
        model["stuck"] = np.flatnonzero(effect.defects.stuck).tolist()
    return model


def list_block_names(pair: Pair, scope: str) -> list[int | str]:
    """Return the names of the blocks (parts of the hand, or objects) for which an effect has values of its own.

    scope: kind of the blocks. The names are "hand", addresses of boards, names of objects, or indices of taxels.
    """
    if scope == HAND:
        return [HAND]
    if scope == BOARD:
        return [int(address) for address in pair.sensors.address]
    if scope == OBJECT:
        return list(pair.object_names)
    return [*range(pair.n)]


def split_noise(pair: Pair, fitted_effect: FittedEffect) -> FloatArray:
    """Return the independent components of the noise that an effect adds: standard deviations f64[4, G], counts.

    The rows are in the order of `NOISE_COMPONENTS`, the columns are the G blocks of the effect. The common components
    follow from the covariances of the differences of successive frames: taxels on a common line share the noise of the
    line and of the board, other taxels of a board only that of the board.
    """
    total = (fitted_effect.values**2).sum(axis=0)
    covariance = compute_known_mean(pair.real.common_covariance, 0) - compute_known_mean(pair.sim.common_covariance, 0)
    on_tx, on_rx, on_board = np.nan_to_num(covariance).tolist()
    board = max(on_board, 0.0)
    # The covariance on a line also contains the noise of the board, which is subtracted.
    shared = np.array([max(on_tx - board, 0.0), max(on_rx - board, 0.0), board])
    if shared.sum() < MIN_COMMON_SHARE * total.mean():
        shared[:] = 0.0  # covariances by chance
    shared_sum = max(float(shared.sum()), 1e-300)
    # The common variance of a block is at most the total variance that the effect adds to this block.
    common = shared[:, None] * np.minimum(total / shared_sum, 1.0)
    white = np.maximum(total - common.sum(axis=0), 0.0)
    return np.asarray(np.sqrt(np.vstack([white, common])))
