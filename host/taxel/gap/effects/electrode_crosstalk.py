"""Taxels that share a TX or RX electrode disturb each other."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from taxel.gap.data.boards import columns_of, groups_of
from taxel.gap.data.lacking import LINES
from taxel.gap.data.pair import Pair
from taxel.gap.data.reading import Groups
from taxel.gap.effects.effect import BOARD, HAND, Effect, Parameter
from taxel.gap.fitting.state import Signal, State
from taxel.recording.grasp_tables import TaxelTable
from taxel.types import FloatArray

OWN_PRIOR = 1.0
"""Expected size of what a taxel's own drop loses, over the fractions that it passes on."""


class ElectrodeCrosstalk(Effect):
    """Each taxel's drop gains a fraction of the mean drop of the other taxels on its TX line, and on its RX line.

    variant "network": besides, fractions of the drops at the same place of the neighbouring TX and RX lines, as where
    traces run side by side, and the taxel's own drop, which lines with resistance weaken:
    by `own_ratio` times the sum of those fractions' sizes, so that nothing happens to a taxel without crosstalk.
    """

    name = "electrode_crosstalk"
    order = 70
    needs: ClassVar[frozenset[str]] = frozenset({LINES})

    def __init__(self, variant: str = "lines", scope: str = "hand") -> None:
        self.variant, self.scope = variant, scope

    def own_parameters(self) -> tuple[Parameter, ...]:
        """Fractions of either axis."""
        names = ["tx_fraction", "rx_fraction"]
        if self.variant == "network":
            names += ["tx_neighbour_fraction", "rx_neighbour_fraction"]
        fractions = [Parameter(name, "1", -1.0, 1.5, 0.0, 0.02) for name in names]
        own = [Parameter("own_ratio", "1", -1.0, 1.0, 0.0, 0.0, OWN_PRIOR)] if self._loses else []
        return (*fractions, *own)

    @property
    def _loses(self) -> bool:
        """With a value for each board it could not be told from the boards' gains."""
        return self.variant == "network" and self.scope == HAND

    def apply(self, state: State, signal: Signal, values: FloatArray) -> Signal:
        """See `Effect`."""
        if not values.any():
            return signal
        signal_counts = state.to_signal_counts(signal)
        result = signal_counts.copy()
        for number, board in enumerate(lines_of(state.pair)):
            own = values[:, number if self.scope == BOARD else 0]
            mix = np.tensordot(own[: len(board.passed)], board.passed[: len(own)], axes=1)
            if self._loses:
                mix[np.diag_indices_from(mix)] += own[4] * np.abs(own[:4]).sum()
            result[:, :, board.columns] += signal_counts[:, :, board.columns] @ mix
        return signal.with_signal_counts(result)


@dataclass(frozen=True, eq=False)
class BoardLines:
    """One board's taxels, [m], and what each (row) passes to the others (column) by a fraction of 1, f64[4, m, m]: mean
    of the others on a taxel's TX line, on its RX line, sum of those on the TX lines beside, and on the RX lines beside.
    """

    taxels: NDArray[np.intp]
    passed: FloatArray

    @cached_property
    def columns(self) -> NDArray[np.intp] | slice:
        """Its taxels, see `columns_of`."""
        return columns_of(self.taxels)


def lines_of(pair: Pair) -> tuple[BoardLines, ...]:
    """Of every board."""
    return _lines_of(pair.groups, pair.taxels)


@lru_cache(maxsize=8)
def _lines_of(groups: Groups, table: TaxelTable) -> tuple[BoardLines, ...]:
    made = []
    for taxels in groups_of(groups.sensor):
        tx, rx = (np.asarray(line[taxels], dtype=np.intp) for line in (table.tx, table.rx))
        apart = [np.abs(line[:, None] - line) for line in (tx, rx)]
        same = [gap == 0 for gap in apart]
        means = []
        for line in same:
            others = (line & ~np.eye(len(taxels), dtype=bool)).astype(np.float64)
            means.append(others / np.maximum(others.sum(axis=0), 1.0))
        beside = [(apart[axis] == 1) & same[1 - axis] for axis in (0, 1)]
        made.append(BoardLines(taxels, np.stack([*means, *beside]).astype(np.float64)))
    return tuple(made)
