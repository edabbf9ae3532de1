"""Dead or stuck taxels, broken lines, boards that go silent."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from taxel.gap.effects.effect import TAXEL, Array, Effect, Parameter
from taxel.gap.features import COUNTS_MISSING
from taxel.gap.state import Signal, State


@dataclass(frozen=True, eq=False)
class Dropped:
    """What was found. taxels: bool[n], that answer to nothing, on no found line. lines: (sensor column, axis, index).
    sensors: columns that frames are missing of, and the share that is: f64[s].
    """

    taxels: NDArray[np.bool_]
    lines: tuple[tuple[int, str, int], ...]
    missing: Array
    dead: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, bool))
    stuck: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, bool))

    @property
    def found(self) -> bool:
        """Whether anything was."""
        return bool(self.taxels.any() or self.lines or self.missing.any())


class Dropout(Effect):
    """Dead taxels show a share `left` of their drop; frames of silent boards are missing."""

    name = "dropout"
    order = 85

    def __init__(self, dropped: Dropped) -> None:
        self.dropped = dropped
        self.scope = TAXEL

    def parameters(self) -> tuple[Parameter, ...]:
        """What is left of the drop: 1 where the taxel lives."""
        return (Parameter("left", "1", 0.0, 1.0, 1.0, 1.0),)

    def found_values(self, state: State) -> Array:
        """Values f64[1, n] for what was found."""
        values = self.neutral(state)
        values[0, self.dropped.dead] = 0.0
        return values

    def apply(self, state: State, signal: Signal, values: Array) -> Signal:
        """See `Effect`."""
        if (values == 1.0).all():
            return signal
        (left,) = self.spread_out(state, values)
        return signal.with_drop(state.to_drop(signal) * left)

    def features(self, state: State, features: Array, values: Array) -> Array:
        """See `Effect`."""
        if (values == 1.0).all() and not self.dropped.missing.any():
            return features
        result = features.copy()
        missing = state.layout.missing
        result[:, missing] += COUNTS_MISSING * self.dropped.missing[state.pair.groups.sensor]
        result[:, state.layout.noise, self.dropped.stuck] = 0.0
        return result
