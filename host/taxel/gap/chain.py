"""Several effects together: from contact to features, each in its place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from taxel.gap.effects.effect import Effect
from taxel.gap.state import State

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Link:
    """An effect and its values, f64[P, G]."""

    effect: Effect
    values: Array


@dataclass(frozen=True, eq=False)
class Chain:
    """Effects in the order in which they act."""

    links: tuple[Link, ...] = ()

    @classmethod
    def of(cls, links: Sequence[Link]) -> Chain:
        """In order."""
        return cls(tuple(sorted(links, key=lambda link: link.effect.order)))

    def with_link(self, link: Link) -> Chain:
        """One more effect."""
        return Chain.of([*self.links, link])

    def without(self, name: str) -> Chain:
        """All but one."""
        return Chain(tuple(link for link in self.links if link.effect.name != name))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects, in order of action."""
        return tuple(link.effect.name for link in self.links)

    def with_values(self, values: Sequence[Array]) -> Chain:
        """The same effects with other values."""
        return Chain(tuple(replace(link, values=new) for link, new in zip(self.links, values, strict=True)))

    def features(self, state: State) -> Array:
        """The simulator's features with these effects, f64[C, F, n]."""
        if not any(link.effect.memory for link in self.links):
            state = state.coarse
        signal = state.base
        for link in self.links:
            signal = link.effect.apply(state, signal, link.values)
        features = state.predicted(signal)
        for link in self.links:
            features = link.effect.features(state, features, link.values)
        return features
