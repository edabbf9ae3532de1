"""Unloading does not retrace loading: the layer creeps under force and recovers late."""

from __future__ import annotations

from typing import ClassVar

from taxel.gap.effects.effect import Effect, Parameter
from taxel.gap.effects.geometry import geometry_of
from taxel.gap.effects.lag import low_pass
from taxel.gap.effects.plate import closed_by, compute_signal_counts
from taxel.gap.fitting.state import Signal, State
from taxel.types import FloatArray

MOST_TIMES = 3.0
"""The recorded time, in which a time constant shows: of what comes so late not a third has come by the end."""


class Hysteresis(Effect):
    """A share `fraction` acts late, with a time constant `seconds` (a standard linear solid).

    variant "force": of the force. "drop": of the drop. "depth": of the depth to which the force presses the layer, by
    the simulator's own law. "gap": of the share x by which the gap between plates is closed, where the drop is as
    x / (1 - x), that of a plate capacitor: counts grow faster than what creeps. "more": of the force, and on top of it,
    as where a press goes on to give way.
    """

    name = "hysteresis"
    order = 42
    memory: ClassVar[bool] = True

    def __init__(self, variant: str = "drop", scope: str = "hand") -> None:
        self.variant, self.scope = variant, scope

    def own_parameters(self) -> tuple[Parameter, ...]:
        """Late share and time constant."""
        return Parameter("fraction", "1", 0.0, 1.5, 0.0, 0.2), Parameter("seconds", "s", 0.05, 100.0, 1.0, 1.0)

    def unavailable(self, state: State) -> str:
        """See `Effect`."""
        on_drop = self.variant in ("drop", "gap")
        return "" if on_drop or state.has_force else "the simulation has no contact force"

    def is_idle(self, state: State, values: FloatArray) -> bool:
        """Whether it goes on so slowly that hardly anything is seen to come late: that is another law of counts."""
        return bool((values[1] > MOST_TIMES * state.since[-1]).all())

    def apply(self, state: State, signal: Signal, values: FloatArray) -> Signal:
        """See `Effect`."""
        if not values[0].any():
            return signal
        fraction, seconds = self.spread_out(state, values)

        def late(what: FloatArray) -> FloatArray:
            return what + fraction * (low_pass(what, state.since, seconds[:, 0]) - what)

        if self.variant == "gap":
            return signal.with_signal_counts(compute_signal_counts(state, late(closed_by(state, signal))))
        if self.variant == "drop":
            return signal.with_signal_counts(late(state.to_signal_counts(signal)))
        assert signal.force is not None
        if self.variant == "depth":
            law = geometry_of(state).law
            return signal.with_force(law.force(late(law.depth(signal.force))))
        if self.variant == "more":
            return signal.with_force(signal.force + fraction * low_pass(signal.force, state.since, seconds[:, 0]))
        return signal.with_force(late(signal.force))
