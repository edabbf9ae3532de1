"""Unloading does not retrace loading: the layer creeps under force and recovers late."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from taxel.gap.effects.effect import Array, Effect, Parameter
from taxel.gap.effects.geometry import geometry_of
from taxel.gap.effects.lag import low_pass
from taxel.gap.state import Signal, State

CREEP_PRIOR = 0.3
"""Expected share that acts late where the layer sticks."""

HALF_SHARE = 0.25
"""Of full scale: counts of a gap that is half closed. No parameter: with that free it could be any law of counts. A
gap's share at full scale hangs on the layout; 0.25 lies within what free fits gave on worlds of this project's emulator
(0.24 to 0.35), chosen there and on no hardware."""

MOST_CLOSED = 0.98
"""Of a gap: beyond that the counts of a plate capacitor say nothing of a sensor's."""

MOST_TIMES = 3.0
"""The recorded time, in which a time constant shows: of what comes so late not a third has come by the end."""


class Hysteresis(Effect):
    """A share `fraction` acts late, with a time constant `seconds` (a standard linear solid).

    variant "force": of the force. "drop": of the drop. "depth": of the depth to which the force presses the layer, by
    the simulator's own law. "gap": of the share x by which the gap between plates is closed, where the drop is as
    x / (1 - x), that of a plate capacitor: counts grow faster than what creeps. "more": of the force, and on top of it,
    as where a press goes on to give way. "sticks": the drop falls behind by `fraction` while it grows and is let go
    only when the load has fallen below it, at any speed; and of that a share `creep` acts late.
    """

    name = "hysteresis"
    order = 42
    memory: ClassVar[bool] = True

    def __init__(self, variant: str = "drop", scope: str = "hand") -> None:
        self.variant, self.scope = variant, scope

    def own_parameters(self) -> tuple[Parameter, ...]:
        """Late share and time constant."""
        late = Parameter("fraction", "1", 0.0, 1.5, 0.0, 0.2), Parameter("seconds", "s", 0.05, 100.0, 1.0, 1.0)
        return (*late, Parameter("creep", "1", 0.0, 1.0, 0.0, 0.05, CREEP_PRIOR)) if self.variant == "sticks" else late

    def unavailable(self, state: State) -> str:
        """See `Effect`."""
        on_drop = self.variant in ("drop", "gap", "sticks")
        return "" if on_drop or state.has_force else "the simulation tells no contact force"

    def is_idle(self, state: State, values: Array) -> bool:
        """Whether it goes on so slowly that hardly anything is seen to come late: that is another law of counts."""
        return self.variant != "sticks" and bool((values[1] > MOST_TIMES * state.since[-1]).all())

    def apply(self, state: State, signal: Signal, values: Array) -> Signal:
        """See `Effect`."""
        if not values[0].any():
            return signal
        fraction, seconds, *third = self.spread_out(state, values)

        def late(what: Array, share: Array) -> Array:
            return what + share * (low_pass(what, state.since, seconds[:, 0]) - what)

        if self.variant == "gap":
            drop, half = np.maximum(state.to_drop(signal), 0.0), HALF_SHARE * state.full_scale
            closed = np.minimum(late(drop / (half + drop), fraction), MOST_CLOSED)
            return signal.with_drop(half * closed / (1.0 - closed))
        if self.variant == "sticks":
            return signal.with_drop(late(stuck(state.to_drop(signal), fraction[:, 0]), third[0]))
        if self.variant == "drop":
            return signal.with_drop(late(state.to_drop(signal), fraction))
        assert signal.force is not None
        if self.variant == "depth":
            law = geometry_of(state).law
            return signal.with_force(law.force(late(law.depth(signal.force), fraction)))
        if self.variant == "more":
            return signal.with_force(signal.force + fraction * low_pass(signal.force, state.since, seconds[:, 0]))
        return signal.with_force(late(signal.force, fraction))


def stuck(values: Array, fraction: Array) -> Array:
    """What follows values f64[Q, K, n] along K: (1 - fraction) of them while they grow, up to all of them while they
    fall. fraction: f64[Q, n].
    """
    result = np.empty_like(values)
    keep = 1.0 - np.minimum(fraction, 1.0)
    state = np.zeros_like(values[:, 0])
    for node in range(values.shape[1]):
        now = values[:, node]
        state = np.clip(state, np.minimum(keep * now, now), np.maximum(keep * now, now))
        result[:, node] = state
    return result
