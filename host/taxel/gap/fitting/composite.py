"""Several effects together: from contact to features, each in its place."""

from __future__ import annotations

import threading
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from weakref import WeakKeyDictionary

from taxel.gap.effects.effect import Effect
from taxel.gap.fitting.state import Signal, State
from taxel.types import FloatArray


@dataclass(frozen=True, eq=False)
class FittedEffect:
    """An effect and its values, f64[P, G]."""

    effect: Effect
    values: FloatArray


@dataclass(frozen=True, eq=False)
class CompositeModel:
    """Effects in the order in which they act."""

    links: tuple[FittedEffect, ...] = ()

    @classmethod
    def of(cls, links: Sequence[FittedEffect]) -> CompositeModel:
        """In order."""
        return cls(tuple(sorted(links, key=lambda link: link.effect.order)))

    def with_link(self, link: FittedEffect) -> CompositeModel:
        """One more effect."""
        return CompositeModel.of([*self.links, link])

    def without(self, name: str) -> CompositeModel:
        """All but one."""
        return CompositeModel(tuple(link for link in self.links if link.effect.name != name))

    def get(self, name: str) -> FittedEffect:
        """The effect with this name. Raises KeyError."""
        for link in self.links:
            if link.effect.name == name:
                return link
        raise KeyError(name)

    def only(self, names: Collection[str]) -> CompositeModel:
        """The effects with these names."""
        return CompositeModel(tuple(link for link in self.links if link.effect.name in names))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects, in order of action."""
        return tuple(link.effect.name for link in self.links)

    def with_values(self, values: Sequence[FloatArray]) -> CompositeModel:
        """The same effects with other values."""
        return CompositeModel(tuple(replace(link, values=new) for link, new in zip(self.links, values, strict=True)))

    def features(self, state: State) -> FloatArray:
        """The simulator's features with these effects, f64[C, F, n]."""
        features = state.predicted(_signal_of(state, self.links))
        for link in self.links:
            features = link.effect.features(state, features, link.values)
        return features


class _Recent(threading.local):
    """Of each state, the links that this thread applied last and what the signal was after each of them."""

    def __init__(self) -> None:
        self.steps: WeakKeyDictionary[State, list[tuple[FittedEffect, Signal]]] = WeakKeyDictionary()


_recent = _Recent()


def _signal_of(state: State, links: Sequence[FittedEffect]) -> Signal:
    """The signal after all links. A fit moves one of them at a time: those before it are not worked out anew."""
    known = _recent.steps.get(state, [])
    same = 0
    for (before, _), link in zip(known, links, strict=False):
        if before.effect is not link.effect or before.values is not link.values:
            break
        same += 1
    steps = known[:same]
    signal = steps[-1][1] if steps else state.base
    for link in links[same:]:
        signal = link.effect.apply(state, signal, link.values)
        steps.append((link, signal))
    _recent.steps[state] = steps
    return signal
