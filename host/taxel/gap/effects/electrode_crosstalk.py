"""Taxels that share a TX or RX electrode disturb each other."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.sparse import csr_array

from taxel.gap.effects.effect import Array, Effect, Parameter
from taxel.gap.pair import Pair
from taxel.gap.state import Signal, State


class ElectrodeCrosstalk(Effect):
    """Each taxel's drop gains a fraction of the mean drop of the other taxels on its TX line, and on its RX line.

    variant "network": besides, fractions of the drops at the same place of the neighbouring TX and RX lines, as where
    traces run side by side.
    """

    name = "electrode_crosstalk"
    order = 70

    def __init__(self, variant: str = "lines", scope: str = "hand") -> None:
        self.variant, self.scope = variant, scope

    def parameters(self) -> tuple[Parameter, ...]:
        """Fractions of either axis."""
        names = ["tx_fraction", "rx_fraction"]
        if self.variant == "network":
            names += ["tx_neighbour_fraction", "rx_neighbour_fraction"]
        return tuple(Parameter(name, "1", -1.0, 1.5, 0.0, 0.02) for name in names)

    def apply(self, state: State, signal: Signal, values: Array) -> Signal:
        """See `Effect`."""
        if not values.any():
            return signal
        drop = state.to_drop(signal)
        tx, rx, *beside = self.spread_out(state, values)
        sums = state.pair.groups.sums
        result = drop + tx * others_on_line(drop, sums[0]) + rx * others_on_line(drop, sums[1])
        for fraction, next_to in zip(beside, neighbours(state.pair), strict=False):
            result = result + fraction * (next_to @ drop.reshape(-1, drop.shape[2]).T).T.reshape(drop.shape)
        return signal.with_drop(result)


@lru_cache(maxsize=8)
def neighbours(pair: Pair) -> tuple[csr_array, csr_array]:
    """Which taxels lie on the next TX lines of the same RX line, and the other way round: [n, n] of ones."""
    taxels, n = pair.taxels, pair.n
    place = {
        (int(board), int(tx), int(rx)): index
        for index, (board, tx, rx) in enumerate(zip(pair.groups.sensor, taxels.tx, taxels.rx, strict=True))
    }
    made = []
    for step in ((1, 0), (0, 1)):
        pairs = [
            (index, place[board, tx + way * step[0], rx + way * step[1]])
            for (board, tx, rx), index in place.items()
            for way in (-1, 1)
            if (board, tx + way * step[0], rx + way * step[1]) in place
        ]
        rows, columns = np.array(pairs, dtype=np.intp).reshape(-1, 2).T
        made.append(csr_array((np.ones(len(rows)), (rows, columns)), shape=(n, n)))
    return made[0], made[1]


def others_on_line(drop: Array, line: csr_array) -> Array:
    """Mean drop of the other taxels on each taxel's line, f64[Q, K, n]; 0 where it is alone."""
    flat = drop.reshape(-1, drop.shape[2])
    size = np.asarray(line.sum(axis=1)).ravel()
    total = (line.T @ (line @ flat.T)).T - flat
    others = np.maximum((line.T @ size) - 1.0, 1.0)
    return np.asarray((total / others).reshape(drop.shape))
