"""The interface of an effect: parameters with units and bounds, and a change of a signal or of features.

Neutral parameter values change nothing.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from taxel.gap.data.missing_inputs import FORCES, REASONS
from taxel.gap.data.pair import Pair
from taxel.gap.fitting.state import Signal, State
from taxel.types import FloatArray

HAND: Final = "hand"
BOARD: Final = "board"
TAXEL: Final = "taxel"
OBJECT: Final = "object"


@dataclass(frozen=True)
class Parameter:
    """One parameter of an effect: unit, bounds, neutral value, start value of a search, and normal prior.

    prior: standard deviation of the prior, in the unit of the parameter; inf: uniform within the bounds. centre: mean
    of the prior; None: the neutral value.
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
    def prior_mean(self) -> float:
        """Mean of the prior, in the unit of the parameter."""
        return self.neutral if self.centre is None else self.centre

    def with_prior(self, value: float, std: float) -> Parameter:
        """Return a copy with the prior mean `value` and prior standard deviation `std`; a search starts at `value`."""
        return replace(self, start=value, prior=std, centre=value)


@dataclass(frozen=True)
class Prior:
    """Prior of a parameter: mean and standard deviation, both in the unit of the parameter."""

    value: float
    std: float


class Effect(ABC):
    """One form of an effect.

    An effect has P parameters. Its values are f64[P, G]: the scope divides the hand into G blocks, and each block has
    its own values.

    name: name in the report. variant: name of this form; "" if the effect has one form. order: position between contact
    (0) and raw count (100); a composite model applies its effects in this order. scope: `HAND` (one block), or one
    block for each `BOARD`, `OBJECT` or `TAXEL`. needs: inputs that the datasets must contain, as keys of
    `taxel.gap.data.missing_inputs.REASONS`. needs_force: whether the simulation must contain contact forces. memory:
    whether the result at one time depends on other times. is_load_independent: whether the values of the blocks are
    properties of the skin, which do not depend on the load. change_errors: possible standard deviations of the error of
    the predicted change, relative to this change. More than 0 is possible for an effect whose change depends on the
    exact place of the contact, which differs between simulation and reality. priors: priors by parameter name.
    """

    name: ClassVar[str]
    order: ClassVar[int]
    variant: str = ""
    scope: str = HAND
    needs: ClassVar[frozenset[str]] = frozenset()
    needs_force: ClassVar[bool] = False
    memory: ClassVar[bool] = False
    is_load_independent: ClassVar[bool] = False
    change_errors: ClassVar[tuple[float, ...]] = (0.0,)
    priors: Mapping[str, Prior] = MappingProxyType({})

    @abstractmethod
    def own_parameters(self) -> tuple[Parameter, ...]:
        """Return the P parameters of one block, without the priors of `priors`."""

    def parameters(self) -> tuple[Parameter, ...]:
        """Return the P parameters of one block with the priors of `priors`.

        A prior whose mean is outside the bounds of the parameter is ignored.
        """
        priors = self.priors
        return tuple(
            parameter.with_prior(priors[parameter.name].value, priors[parameter.name].std)
            if parameter.name in priors and parameter.low <= priors[parameter.name].value <= parameter.high
            else parameter
            for parameter in self.own_parameters()
        )

    def with_priors(self, priors: Mapping[str, Prior]) -> Effect:
        """Return a copy of the effect with other priors. priors: by parameter name."""
        effect = copy(self)
        effect.priors = dict(priors)  # a mapping proxy cannot be pickled, and effects are sent to other processes
        return effect

    @abstractmethod
    def apply(self, state: State, signal: Signal, values: FloatArray) -> Signal:
        """Return the signal with the effect; with neutral values `signal` itself.

        values: f64[P, G] (P parameters; G blocks: the hand, boards, objects or taxels), with the blocks in the
        numbering of `find_blocks`.
        """

    def apply_to_features(self, state: State, features: FloatArray, values: FloatArray) -> FloatArray:
        """Return features f64[C, F, n] (C conditions, F features, n taxels) with the effect on features that do not
        follow from the signal, such as noise.

        features: f64[C, F, n]; with neutral values they are returned themselves. values: f64[P, G] (P parameters, G
        blocks).
        """
        return features

    def find_unavailable_reason(self, state: State) -> str:
        """Return why this form cannot be fitted to the datasets of a state; an empty string if it can be fitted."""
        if self.needs_force and not state.has_force:
            return REASONS[FORCES]
        return next((REASONS[name] for name in sorted(self.needs & state.pair.missing_inputs)), "")

    def find_blocks(self, state: State) -> NDArray[np.intp]:
        """Return the index of the block that acts on each taxel in each condition, [C, n] (C conditions, n taxels)."""
        return self.find_blocks_of_pair(state.pair)

    def find_blocks_of_pair(self, pair: Pair) -> NDArray[np.intp]:
        """Return the index of the block that acts on each taxel in each condition of a pair, [C, n] (C conditions, n
        taxels).
        """
        conditions, n = len(pair.conditions), pair.n
        if self.scope == BOARD:
            return np.broadcast_to(pair.groups.sensor, (conditions, n))
        if self.scope == TAXEL:
            return np.broadcast_to(np.arange(n), (conditions, n))
        if self.scope == OBJECT:
            names = pair.object_names
            objects = np.array([names.index(item) for item, _ in pair.conditions], dtype=np.intp)
            return np.broadcast_to(objects[:, None], (conditions, n))
        return np.zeros((conditions, n), np.intp)

    def make_neutral_values(self, state: State) -> FloatArray:
        """Return neutral values, f64[P, G] (P parameters; G blocks: the hand, boards, objects or taxels)."""
        count = int(self.find_blocks(state).max()) + 1
        return np.repeat([[parameter.neutral] for parameter in self.parameters()], count, axis=1)

    def make_start_values(self, state: State) -> FloatArray:
        """Return the parameter values at which a search starts, f64[P, G] (P parameters; G blocks: the hand, boards,
        objects or taxels); the start value of each `Parameter`.
        """
        values = self.make_neutral_values(state)
        for row, parameter in enumerate(self.parameters()):
            values[row] = parameter.start
        return values

    def make_typical_values(self, state: State) -> FloatArray:
        """Return values of a typical case of the effect, f64[P, G] (P parameters; G blocks: the hand, boards, objects
        or taxels).

        They are the start values. A parameter with a neutral start value is increased by 0.3 prior standard deviations,
        but by at most 0.3 times the distance from its neutral value to its upper bound. Every second block has neutral
        values, so that the blocks differ.
        """
        values, neutral = self.make_start_values(state), self.make_neutral_values(state)
        for row, parameter in enumerate(self.parameters()):
            if (values[row] == parameter.neutral).all():
                values[row] += min(0.3 * parameter.prior, 0.3 * (parameter.high - parameter.neutral))
        values[:, 1::2] = neutral[:, 1::2]
        return values

    def is_idle(self, state: State, values: FloatArray) -> bool:
        """Return whether fitted values f64[P, G] (P parameters; G blocks: the hand, boards, objects or taxels) have no
        consequence of their own; a search then rejects the effect.

        For example, delays of boards that differ by less than a frame period are idle. The default is False.
        """
        return False

    def spread_out(self, state: State, values: FloatArray) -> list[FloatArray]:
        """Expand the values of blocks to all contacts and taxels: return P arrays f64[Q, 1, n] (Q simulated contacts, n
        taxels), one for each parameter.

        values: f64[P, G], one value of each of P parameters for each of G blocks. The axis of length 1 broadcasts over
        the time nodes.
        """
        blocks = self.find_blocks(state)[state.condition]
        return [row[blocks][:, None, :] for row in values]
