"""What an effect is: parameters with units and bounds, and what it does to a signal. Neutral values change nothing."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from taxel.gap.pair import Pair
from taxel.gap.state import Signal, State

Array = NDArray[np.float64]

HAND: Final = "hand"
BOARD: Final = "board"
TAXEL: Final = "taxel"
OBJECT: Final = "object"


@dataclass(frozen=True)
class Parameter:
    """One parameter: unit, bounds, neutral value, where a search starts, and how much it is expected to be.

    prior: standard deviation about the neutral value; inf: anything within the bounds is as likely.
    """

    name: str
    unit: str
    low: float
    high: float
    neutral: float
    start: float
    prior: float = np.inf


class Effect(ABC):
    """A candidate.

    name: as the report page has it. variant: which of several forms, "" for the only one. order: place in the chain
    from contact to count. scope: whether its values hold for the hand, or each board, object or taxel has its own.
    memory: whether what comes out at a time depends on other times.
    """

    name: ClassVar[str]
    order: ClassVar[int]
    variant: str = ""
    scope: str = HAND
    needs_force: ClassVar[bool] = False
    memory: ClassVar[bool] = False

    @abstractmethod
    def parameters(self) -> tuple[Parameter, ...]:
        """The P parameters of one block."""

    @abstractmethod
    def apply(self, state: State, signal: Signal, values: Array) -> Signal:
        """The signal with the effect. values: f64[P, G], G blocks as `blocks` numbers them."""

    def features(self, state: State, features: Array, values: Array) -> Array:
        """What the effect does to features that are no drops; f64[C, F, n] to the same."""
        return features

    def unavailable(self, state: State) -> str:
        """Why it cannot be tried on this pair; empty if it can."""
        return "the simulation tells no contact force" if self.needs_force and not state.has_force else ""

    def blocks(self, state: State) -> NDArray[np.intp]:
        """Which block acts on a taxel in a cell, [C, n]."""
        return self.blocks_of(state.pair)

    def blocks_of(self, pair: Pair) -> NDArray[np.intp]:
        """The same for a pair."""
        cells, n = len(pair.cells), pair.n
        if self.scope == BOARD:
            return np.broadcast_to(pair.groups.sensor, (cells, n))
        if self.scope == TAXEL:
            return np.broadcast_to(np.arange(n), (cells, n))
        if self.scope == OBJECT:
            names = sorted({item for item, _ in pair.cells})
            own = np.array([names.index(item) for item, _ in pair.cells], dtype=np.intp)
            return np.broadcast_to(own[:, None], (cells, n))
        return np.zeros((cells, n), np.intp)

    def neutral(self, state: State) -> Array:
        """Values that change nothing, f64[P, G]."""
        count = int(self.blocks(state).max()) + 1
        return np.repeat([[parameter.neutral] for parameter in self.parameters()], count, axis=1)

    def typical(self, state: State) -> Array:
        """Values of a plain case, f64[P, G]: where the search starts, or a third of what the prior expects."""
        values = self.neutral(state)
        for row, parameter in enumerate(self.parameters()):
            step = parameter.start - parameter.neutral
            values[row] += step if step else min(0.3 * parameter.prior, 0.3 * (parameter.high - parameter.neutral))
        return values

    def is_idle(self, state: State, values: Array) -> bool:
        """Whether these values say nothing that is an effect, though they are not neutral."""
        return False

    def spread_out(self, state: State, values: Array) -> list[Array]:
        """Each parameter for every press and taxel, P arrays f64[Q, 1, n]."""
        blocks = self.blocks(state)[state.cell]
        return [row[blocks][:, None, :] for row in values]


def groups_of(index: NDArray[np.intp]) -> list[NDArray[np.intp]]:
    """Members of each group: positions of 0, of 1, ..."""
    order = np.argsort(index, kind="stable")
    return np.split(order, np.cumsum(np.bincount(index))[:-1])


def pitch_m(position: Array, size: Array) -> float:
    """Distance of neighbouring taxels of a board, metres. position: f64[m, 3], size: f64[m]."""
    if len(position) < 2:
        return float(size.mean())
    apart = np.linalg.norm(position[:, None] - position, axis=2)
    apart[apart == 0] = np.inf
    return float(np.median(apart.min(axis=1)))
