"""Composite model: a sequence of effects that act on the simulated contact in a fixed order, from contact to count."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass, replace
from weakref import WeakKeyDictionary

from taxel.gap.effects.effect import Effect
from taxel.gap.fitting.state import Signal, State
from taxel.types import FloatArray


@dataclass(frozen=True, eq=False)
class FittedEffect:
    """An effect with values of its P parameters in G blocks, f64[P, G] (see `Effect.find_blocks`)."""

    effect: Effect
    values: FloatArray


@dataclass(frozen=True, eq=False)
class CompositeModel:
    """Effects in the order in which they act, with the values of their parameters."""

    fitted_effects: tuple[FittedEffect, ...] = ()

    @classmethod
    def from_effects(cls, fitted_effects: Sequence[FittedEffect]) -> CompositeModel:
        """Build a composite model from effects in any order; they are sorted by `Effect.order`."""
        return cls(tuple(sorted(fitted_effects, key=lambda fitted_effect: fitted_effect.effect.order)))

    def with_effect(self, fitted_effect: FittedEffect) -> CompositeModel:
        """Return a composite model with one more effect, sorted by `Effect.order`."""
        return CompositeModel.from_effects([*self.fitted_effects, fitted_effect])

    def without(self, name: str) -> CompositeModel:
        """Return a composite model without the effect with this name."""
        return CompositeModel(
            tuple(fitted_effect for fitted_effect in self.fitted_effects if fitted_effect.effect.name != name)
        )

    def get(self, name: str) -> FittedEffect:
        """Return the effect with this name. Raises KeyError if the model does not contain the effect."""
        for fitted_effect in self.fitted_effects:
            if fitted_effect.effect.name == name:
                return fitted_effect
        raise KeyError(name)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects, in the order in which they act."""
        return tuple(fitted_effect.effect.name for fitted_effect in self.fitted_effects)

    def with_values(self, values: Sequence[FloatArray]) -> CompositeModel:
        """Return a composite model with other values, one array f64[P, G] (P parameters; G blocks: the hand, boards,
        objects or taxels) for each effect.

        Raises ValueError if the number of arrays differs from the number of effects.
        """
        return CompositeModel(
            tuple(
                replace(fitted_effect, values=new_values)
                for fitted_effect, new_values in zip(self.fitted_effects, values, strict=True)
            )
        )

    def predict_features(self, state: State) -> FloatArray:
        """Predict the simulator's features with these effects, f64[C, F, n] (C conditions, F features, n taxels)."""
        features = state.predict_features(_apply_effects(state, self.fitted_effects))
        for fitted_effect in self.fitted_effects:
            features = fitted_effect.effect.apply_to_features(state, features, fitted_effect.values)
        return features


class _SignalCache(threading.local):
    """Cache of a thread: for each state, the effects that were applied last and the signal after each effect."""

    def __init__(self) -> None:
        self.steps: WeakKeyDictionary[State, list[tuple[FittedEffect, Signal]]] = WeakKeyDictionary()


_cache = _SignalCache()


def _apply_effects(state: State, fitted_effects: Sequence[FittedEffect]) -> Signal:
    """Return the signal after effects have acted on the simulated contacts of a state, one after the other.

    The cached signals of the leading effects that have not changed since the last call are used again, because the
    numeric derivatives of a fit change one effect at a time.
    """
    cached = _cache.steps.get(state, [])
    unchanged = 0
    for (previous, _), fitted_effect in zip(cached, fitted_effects, strict=False):
        if previous.effect is not fitted_effect.effect or previous.values is not fitted_effect.values:
            break
        unchanged += 1
    steps = cached[:unchanged]
    signal = steps[-1][1] if steps else state.base
    for fitted_effect in fitted_effects[unchanged:]:
        signal = fitted_effect.effect.apply(state, signal, fitted_effect.values)
        steps.append((fitted_effect, signal))
    _cache.steps[state] = steps
    return signal
