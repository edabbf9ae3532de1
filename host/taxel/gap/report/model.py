"""What it takes to add an effect elsewhere: its form and scope, and every value of every block with its unit."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from taxel.gap.data.pair import Pair
from taxel.gap.effects.dropout import Dropout
from taxel.gap.effects.effect import BOARD, HAND, OBJECT
from taxel.gap.features.features import known_mean
from taxel.gap.fitting.composite import FittedEffect
from taxel.gap.fitting.state import State
from taxel.types import FloatArray

NOISE_PARTS: Final = ("white_counts", "tx_counts", "rx_counts", "board_counts")
"""Standard deviations of independent parts: each taxel's own, and common to a TX line, an RX line, a board."""

COMMON_LEAST: Final = 0.01
"""Share of the added variance below which a common part is chance."""


def model_of(state: State, link: FittedEffect) -> dict[str, Any]:
    """An effect as the field `model` of its entry.

    until_s: seconds from the beginning of closing over which it was fitted; a drift's counts are reached then. shift_s:
    by which all boards are later than the simulator besides, because of how the frames fell.
    """
    pair, effect, values = state.pair, link.effect, link.values
    units = {parameter.name: parameter.unit for parameter in effect.parameters()}
    rows = dict(zip(units, values, strict=True))
    if effect.name == "noise":
        units = dict.fromkeys(NOISE_PARTS, "counts")
        rows = dict(zip(NOISE_PARTS, noise_parts(pair, link), strict=True))
    model: dict[str, Any] = {
        "form": effect.variant,
        "scope": effect.scope,
        "order": effect.order,
        "until_s": float(pair.clock.since_start[-1]),
        "shift_s": state.shift_s,
        "blocks": block_names(pair, effect.scope)[: values.shape[1]],
        "parameters": {name: {"unit": unit, "values": rows[name].tolist()} for name, unit in units.items()},
    }
    if isinstance(effect, Dropout):
        missing = effect.dropped.missing
        model["missing"] = {"blocks": block_names(pair, BOARD)[: len(missing)], "values": missing.tolist()}
        model["shorts"] = [[one.address, one.axis, one.index, one.share] for one in effect.dropped.shorts]
        model["stuck"] = np.flatnonzero(effect.dropped.stuck).tolist()
    return model


def block_names(pair: Pair, scope: str) -> list[int | str]:
    """What the blocks of a scope are called: "hand", addresses of boards, names of objects, or indices of taxels."""
    if scope == HAND:
        return [HAND]
    if scope == BOARD:
        return [int(address) for address in pair.sensors.address]
    if scope == OBJECT:
        return list(pair.object_names)
    return [*range(pair.n)]


def noise_parts(pair: Pair, link: FittedEffect) -> FloatArray:
    """The variance that noise adds, parted as the covariances of successive frames tell: deviations f64[4, G].

    Taxels on a common line share what the line and what the board has; others of the board only the latter.
    """
    total = (link.values**2).sum(axis=0)
    covariance = known_mean(pair.real.common, 0) - known_mean(pair.sim.common, 0)
    on_tx, on_rx, apart = np.nan_to_num(covariance).tolist()
    board = max(apart, 0.0)
    shared = np.array([max(on_tx - board, 0.0), max(on_rx - board, 0.0), board])
    if shared.sum() < COMMON_LEAST * total.mean():
        shared[:] = 0.0  # what pairs of taxels share by chance
    whole = max(float(shared.sum()), 1e-300)
    common = shared[:, None] * np.minimum(total / whole, 1.0)
    white = np.maximum(total - common.sum(axis=0), 0.0)
    return np.asarray(np.sqrt(np.vstack([white, common])))
