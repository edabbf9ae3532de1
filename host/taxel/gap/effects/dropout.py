"""Dead or stuck taxels, open lines, shorted lines, and boards with missing frames."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from taxel.gap.data.pair import Pair
from taxel.gap.effects.effect import TAXEL, Effect, Parameter
from taxel.gap.features.features import COUNTS_MISSING
from taxel.gap.fitting.state import Signal, State
from taxel.types import FloatArray


@dataclass(frozen=True)
class Short:
    """A short circuit between line `index` and line `index + 1` of a board.

    address: I2C address of the board. axis: "tx" or "rx". share: each of the two lines shows this share of the sum of
    both expected signals. pairs: number of lines that cross both shorted lines and on which the expected signals of the
    two lines differ.
    """

    address: int
    axis: str
    index: int
    share: float
    pairs: int = 0


@dataclass(frozen=True, eq=False)
class Defects:
    """Defects of the real skin, found by inspection of s boards with n taxels.

    single_taxels: bool[n], dead taxels outside `lines`. lines: dead lines as (board column, axis, line index), with the
    axis "tx" or "rx". missing: f64[s], share of the frames of each board that are missing. dead: bool[n], all dead
    taxels, on lines or not. stuck: bool[n], taxels without noise. shorts: pairs of shorted lines. is_evident: whether a
    line or patch without any signal lies between responding taxels, or two lines show equal signals on several
    crossings.
    """

    single_taxels: NDArray[np.bool_]
    lines: tuple[tuple[int, str, int], ...]
    missing: FloatArray
    dead: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, bool))
    stuck: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, bool))
    shorts: tuple[Short, ...] = ()
    is_evident: bool = False

    @property
    def has_any(self) -> bool:
        """Whether there is at least one defect."""
        return bool(self.single_taxels.any() or self.lines or self.missing.any() or self.shorts)


class Dropout(Effect):
    """Dead taxels show the share `left` of their signal, shorted lines share their signals, and frames are missing."""

    name = "dropout"
    order = 85

    def __init__(self, defects: Defects) -> None:
        self.defects = defects
        self.scope = TAXEL

    def own_parameters(self) -> tuple[Parameter, ...]:
        """Return the share of the signal that remains; 1 for a taxel without a defect."""
        return (Parameter("left", "1", 0.0, 1.0, 1.0, 1.0),)

    def make_detected_values(self, state: State) -> FloatArray:
        """Return the share of the signal that remains on each taxel, f64[1, n] (n taxels): 0 for dead taxels, otherwise
        1.
        """
        values = self.make_neutral_values(state)
        values[0, self.defects.dead] = 0.0
        return values

    def apply(self, state: State, signal: Signal, values: FloatArray) -> Signal:
        """Return the signal with the dead taxels attenuated, and with equal signals on shorted lines.

        values: f64[1, n] (n taxels), share of the signal that remains on each taxel. Without dead taxels and shorts,
        `signal` itself is returned.
        """
        if (values == 1.0).all() and not self.defects.shorts:
            return signal
        (remaining_share,) = self.spread_out(state, values)
        signal_counts = state.to_signal_counts(signal)
        result = signal_counts * remaining_share
        for short in self.defects.shorts:
            first, second = find_crossing_pairs(state.pair, short.address, short.axis, short.index)
            result[:, :, first] = result[:, :, second] = short.share * (
                signal_counts[:, :, first] + signal_counts[:, :, second]
            )
        return signal.with_signal_counts(result)

    def apply_to_features(self, state: State, features: FloatArray, values: FloatArray) -> FloatArray:
        """Return the features with the missing frames of the boards added, and without noise on stuck taxels.

        features: f64[C, F, n] (C conditions, F features, n taxels), returned themselves if `values` f64[1, n] are all 1
        and no frames are missing. The feature of missing frames is their share times `COUNTS_MISSING`.
        """
        if (values == 1.0).all() and not self.defects.missing.any():
            return features
        result = features.copy()
        column = state.layout.missing
        result[:, column] += COUNTS_MISSING * self.defects.missing[state.pair.groups.sensor]
        result[:, state.layout.noise, self.defects.stuck] = 0.0
        return result


def find_crossing_pairs(pair: Pair, address: int, axis: str, index: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the taxels of line `index` and the taxels of line `index + 1` of a board, two arrays [m].

    Both arrays contain the taxels on the m lines that cross both lines, in the order of these crossing lines. address:
    I2C address of the board. axis: "tx" or "rx", the axis of the two lines.
    """
    along, across = (pair.taxels.tx, pair.taxels.rx) if axis == "tx" else (pair.taxels.rx, pair.taxels.tx)
    is_on_board = pair.taxels.sensor == address
    lines = [np.flatnonzero(is_on_board & (along == number)) for number in (index, index + 1)]
    common = np.intersect1d(across[lines[0]], across[lines[1]])
    first, second = (line[np.isin(across[line], common)] for line in lines)
    return first[np.argsort(across[first])], second[np.argsort(across[second])]
