"""Crosstalk between taxels that share a TX or RX line, or lie on neighbouring lines."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from taxel.gap.data.boards import list_group_members, make_column_index
from taxel.gap.data.missing_inputs import LINES
from taxel.gap.data.pair import Pair
from taxel.gap.data.reading import TaxelGroups
from taxel.gap.effects.effect import BOARD, HAND, Effect, Parameter
from taxel.gap.fitting.state import Signal, State
from taxel.recording.grasp_tables import TaxelTable
from taxel.types import FloatArray

OWN_RATIO_PRIOR = 1.0
"""Standard deviation of the prior of `own_ratio`, a ratio without unit.

Chosen: the relative change of the taxel's own signal is as large as the sum of the fractions.
"""


class ElectrodeCrosstalk(Effect):
    """Each taxel gains a fraction of the mean signal of the other taxels on its TX line, and on its RX line.

    variant "network": in addition, each taxel gains fractions of the signals at the same place of the neighbouring TX
    and RX lines, because traces are routed side by side. The form for the hand also changes the taxel's own signal by
    `own_ratio` times the sum of the absolute fractions, because the resistance of the lines attenuates the own signal.
    Without crosstalk the own signal does not change.
    """

    name = "electrode_crosstalk"
    order = 70
    needs: ClassVar[frozenset[str]] = frozenset({LINES})

    def __init__(self, variant: str = "lines", scope: str = "hand") -> None:
        self.variant, self.scope = variant, scope

    def own_parameters(self) -> tuple[Parameter, ...]:
        """Return the coupling fractions of both axes, and `own_ratio` if the form changes the taxel's own signal."""
        names = ["tx_fraction", "rx_fraction"]
        if self.variant == "network":
            names += ["tx_neighbour_fraction", "rx_neighbour_fraction"]
        # name, unit, lower and upper bound, neutral value, start value, standard deviation of the prior
        fractions = [Parameter(name, "1", -1.0, 1.5, 0.0, 0.02) for name in names]
        own_ratio = [Parameter("own_ratio", "1", -1.0, 1.0, 0.0, 0.0, OWN_RATIO_PRIOR)] if self._has_own_loss else []
        return (*fractions, *own_ratio)

    @property
    def _has_own_loss(self) -> bool:
        """Whether the form changes the taxel's own signal.

        With a value for each board this change is not identifiable from the gains of the boards.
        """
        return self.variant == "network" and self.scope == HAND

    def apply(self, state: State, signal: Signal, values: FloatArray) -> Signal:
        """Return the signal with the crosstalk added; `signal` itself if all values are 0. values: f64[P, G] (P
        parameters, G blocks), the parameters of `own_parameters` for each block.
        """
        if not values.any():
            return signal
        signal_counts = state.to_signal_counts(signal)
        result = signal_counts.copy()
        for number, board in enumerate(find_board_lines(state.pair)):
            board_counts = signal_counts[:, :, board.columns]
            rows = np.flatnonzero(board_counts.any(axis=(1, 2)))  # many boards of a hand have no signal
            if not len(rows):
                continue
            block_values = values[:, number if self.scope == BOARD else 0]
            mixing = np.tensordot(block_values[: len(board.coupling)], board.coupling[: len(block_values)], axes=1)
            if self._has_own_loss:  # own_ratio (row 4) times the sum of the absolute fractions (rows 0 to 3)
                mixing[np.diag_indices_from(mixing)] += block_values[4] * np.abs(block_values[:4]).sum()
            board_result = result[:, :, board.columns]  # a view or a copy, see `make_column_index`
            board_result[rows] += board_counts[rows] @ mixing
            result[:, :, board.columns] = board_result
        return signal.with_signal_counts(result)


@dataclass(frozen=True, eq=False)
class BoardLines:
    """Coupling of the m taxels of one board by its lines.

    taxels: [m], indices in the recording. coupling: f64[4, m, m], share of the signal of a taxel (row) that another
    taxel (column) gains at a fraction of 1. The four matrices are: mean of the other taxels on the TX line, mean of the
    other taxels on the RX line, sum over the neighbouring TX lines, sum over the neighbouring RX lines.
    """

    taxels: NDArray[np.intp]
    coupling: FloatArray

    @cached_property
    def columns(self) -> NDArray[np.intp] | slice:
        """Index of the taxels in the recording, see `make_column_index`."""
        return make_column_index(self.taxels)


def find_board_lines(pair: Pair) -> tuple[BoardLines, ...]:
    """Return the coupling of each board of a pair, in the order of the boards."""
    return _find_board_lines(pair.groups, pair.taxels)


@lru_cache(maxsize=8)
def _find_board_lines(groups: TaxelGroups, table: TaxelTable) -> tuple[BoardLines, ...]:
    """Return the coupling of each board from the boards (`groups`) and lines (`table`) of all taxels. Cached.

    The four matrices of a board are the means over the TX line and over the RX line, and the neighbours on the adjacent
    TX and RX lines.
    """
    boards = []
    for taxels in list_group_members(groups.sensor):
        tx, rx = (np.asarray(line[taxels], dtype=np.intp) for line in (table.tx, table.rx))
        distances = [np.abs(line[:, None] - line) for line in (tx, rx)]
        is_same_line = [distance == 0 for distance in distances]
        means = []
        for is_same in is_same_line:
            others = (is_same & ~np.eye(len(taxels), dtype=bool)).astype(np.float64)
            means.append(others / np.maximum(others.sum(axis=0), 1.0))
        neighbours = [(distances[axis] == 1) & is_same_line[1 - axis] for axis in (0, 1)]
        boards.append(BoardLines(taxels, np.stack([*means, *neighbours]).astype(np.float64)))
    return tuple(boards)
