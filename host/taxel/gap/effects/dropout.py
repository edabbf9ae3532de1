"""Dead or stuck taxels, broken lines, boards that go silent."""

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
    """Two lines of a board that touch: `index` and the next, of "tx" or "rx". Either shows `share` of the sum. pairs:
    of their taxels on a common crossing line, those that should differ.
    """

    address: int
    axis: str
    index: int
    share: float
    pairs: int = 0


@dataclass(frozen=True, eq=False)
class Dropped:
    """What was found. taxels: bool[n], that answer to nothing, on no found line. lines: (sensor column, axis, index).
    missing: share of each board's frames, f64[s]. dead: bool[n], all of these. stuck: bool[n], without even noise.
    shorts: lines that carry the same. evident: a line or a patch shows nothing at all between others that answer, or
    two lines show the same on several crossings.
    """

    taxels: NDArray[np.bool_]
    lines: tuple[tuple[int, str, int], ...]
    missing: FloatArray
    dead: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, bool))
    stuck: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, bool))
    shorts: tuple[Short, ...] = ()
    evident: bool = False

    @property
    def certain(self) -> bool:
        """More than a single taxel whose drops are small: that may be chance."""
        several = self.taxels.sum() > 1 or self.stuck.any()
        return bool(several or self.lines or self.missing.any() or self.shorts)

    @property
    def found(self) -> bool:
        """Whether anything was."""
        return bool(self.taxels.any() or self.lines or self.missing.any() or self.shorts)


class Dropout(Effect):
    """Dead taxels show a share `left` of their drop; frames of silent boards are missing."""

    name = "dropout"
    order = 85

    def __init__(self, dropped: Dropped) -> None:
        self.dropped = dropped
        self.scope = TAXEL

    def own_parameters(self) -> tuple[Parameter, ...]:
        """What is left of the drop: 1 where the taxel lives."""
        return (Parameter("left", "1", 0.0, 1.0, 1.0, 1.0),)

    def found_values(self, state: State) -> FloatArray:
        """Values f64[1, n] for what was found."""
        values = self.neutral(state)
        values[0, self.dropped.dead] = 0.0
        return values

    def apply(self, state: State, signal: Signal, values: FloatArray) -> Signal:
        """See `Effect`."""
        if (values == 1.0).all() and not self.dropped.shorts:
            return signal
        (left,) = self.spread_out(state, values)
        signal_counts = state.to_signal_counts(signal)
        result = signal_counts * left
        for short in self.dropped.shorts:
            first, second = crossings(state.pair, short.address, short.axis, short.index)
            result[:, :, first] = result[:, :, second] = short.share * (
                signal_counts[:, :, first] + signal_counts[:, :, second]
            )
        return signal.with_signal_counts(result)

    def features(self, state: State, features: FloatArray, values: FloatArray) -> FloatArray:
        """See `Effect`."""
        if (values == 1.0).all() and not self.dropped.missing.any():
            return features
        result = features.copy()
        missing = state.layout.missing
        result[:, missing] += COUNTS_MISSING * self.dropped.missing[state.pair.groups.sensor]
        result[:, state.layout.noise, self.dropped.stuck] = 0.0
        return result


def crossings(pair: Pair, address: int, axis: str, index: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Taxels of a line, and those of the next one on the same crossing lines: [m] each."""
    along, across = (pair.taxels.tx, pair.taxels.rx) if axis == "tx" else (pair.taxels.rx, pair.taxels.tx)
    own = pair.taxels.sensor == address
    lines = [np.flatnonzero(own & (along == number)) for number in (index, index + 1)]
    both = np.intersect1d(across[lines[0]], across[lines[1]])
    first, second = (line[np.isin(across[line], both)] for line in lines)
    return first[np.argsort(across[first])], second[np.argsort(across[second])]
