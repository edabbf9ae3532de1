"""What an effect is: parameters with units and bounds, and what it does to a signal. Neutral values change nothing."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from taxel.gap.data.lacking import FORCES, REASONS
from taxel.gap.data.pair import Pair
from taxel.gap.fitting.state import Signal, State
from taxel.types import FloatArray

HAND: Final = "hand"
BOARD: Final = "board"
TAXEL: Final = "taxel"
OBJECT: Final = "object"


@dataclass(frozen=True)
class Parameter:
    """One parameter: unit, bounds, neutral value, where a search starts, and how much it is expected to be.

    prior: standard deviation about `centre` (None: the neutral value); inf: anything within the bounds is as likely.
    """

    name: str
    unit: str
    low: float
    high: float
    neutral: float
    start: float
    prior: float = np.inf
    centre: float | None = None

    @property
    def middle(self) -> float:
        """What it is expected to be."""
        return self.neutral if self.centre is None else self.centre

    def expected(self, value: float, std: float) -> Parameter:
        """The same as somebody knows it: a search starts there."""
        return replace(self, start=value, prior=std, centre=value)


@dataclass(frozen=True)
class Prior:
    """What is known of a parameter beforehand: value and standard deviation, in its unit."""

    value: float
    std: float


class Effect(ABC):
    """A candidate.

    name: as the report page has it. variant: which of several forms, "" for the only one. order: place in the chain
    from contact to count. scope: whether its values hold for the hand, or each board, object or taxel has its own.
    needs: what the datasets must have, by the keys of `taxel.gap.data.lacking.REASONS`.
    memory: whether what comes out at a time depends on other times. is_load_independent: whether the values of blocks
    are properties of the skin, which do not depend on the load. priors: what is known of its parameters.
    """

    name: ClassVar[str]
    order: ClassVar[int]
    variant: str = ""
    scope: str = HAND
    needs: ClassVar[frozenset[str]] = frozenset()
    needs_force: ClassVar[bool] = False
    memory: ClassVar[bool] = False
    is_load_independent: ClassVar[bool] = False
    priors: Mapping[str, Prior] = MappingProxyType({})

    @abstractmethod
    def own_parameters(self) -> tuple[Parameter, ...]:
        """The P parameters of one block."""

    def parameters(self) -> tuple[Parameter, ...]:
        """The same with what is known of them."""
        known = self.priors
        return tuple(
            one.expected(known[one.name].value, known[one.name].std)
            if one.name in known and one.low <= known[one.name].value <= one.high
            else one
            for one in self.own_parameters()
        )

    def with_priors(self, priors: Mapping[str, Prior]) -> Effect:
        """The same effect, of which something is known; what a form cannot be says nothing of it."""
        known = copy(self)
        known.priors = dict(priors)  # no proxy: an effect is sent to other processes
        return known

    @abstractmethod
    def apply(self, state: State, signal: Signal, values: FloatArray) -> Signal:
        """The signal with the effect. values: f64[P, G], G blocks as `blocks` numbers them."""

    def features(self, state: State, features: FloatArray, values: FloatArray) -> FloatArray:
        """What the effect does to features that are no drops; f64[C, F, n] to the same."""
        return features

    def unavailable(self, state: State) -> str:
        """Why it cannot be tried on this pair; empty if it can."""
        if self.needs_force and not state.has_force:
            return REASONS[FORCES]
        return next((REASONS[name] for name in sorted(self.needs & state.pair.lacking)), "")

    def blocks(self, state: State) -> NDArray[np.intp]:
        """Which block acts on a taxel in a cell, [C, n]."""
        return self.blocks_of(state.pair)

    def blocks_of(self, pair: Pair) -> NDArray[np.intp]:
        """The same for a pair."""
        conditions, n = len(pair.conditions), pair.n
        if self.scope == BOARD:
            return np.broadcast_to(pair.groups.sensor, (conditions, n))
        if self.scope == TAXEL:
            return np.broadcast_to(np.arange(n), (conditions, n))
        if self.scope == OBJECT:
            names = pair.object_names
            own = np.array([names.index(item) for item, _ in pair.conditions], dtype=np.intp)
            return np.broadcast_to(own[:, None], (conditions, n))
        return np.zeros((conditions, n), np.intp)

    def neutral(self, state: State) -> FloatArray:
        """Values that change nothing, f64[P, G]."""
        count = int(self.blocks(state).max()) + 1
        return np.repeat([[parameter.neutral] for parameter in self.parameters()], count, axis=1)

    def starts(self, state: State) -> FloatArray:
        """Values where a search starts, f64[P, G]."""
        values = self.neutral(state)
        for row, parameter in enumerate(self.parameters()):
            values[row] = parameter.start
        return values

    def typical(self, state: State) -> FloatArray:
        """Values of a plain case, f64[P, G]: where the search starts, or a third of what the prior expects; for every
        other block only, so that blocks differ.
        """
        values, neutral = self.starts(state), self.neutral(state)
        for row, parameter in enumerate(self.parameters()):
            if (values[row] == parameter.neutral).all():
                values[row] += min(0.3 * parameter.prior, 0.3 * (parameter.high - parameter.neutral))
        values[:, 1::2] = neutral[:, 1::2]
        return values

    def is_idle(self, state: State, values: FloatArray) -> bool:
        """Whether these values say nothing that is an effect, though they are not neutral."""
        return False

    def spread_out(self, state: State, values: FloatArray) -> list[FloatArray]:
        """Each parameter for every press and taxel, P arrays f64[Q, 1, n]."""
        blocks = self.blocks(state)[state.condition]
        return [row[blocks][:, None, :] for row in values]
