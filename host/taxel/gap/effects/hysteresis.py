"""Hysteresis: the signal differs between loading and unloading, because a part of it follows with a time constant."""

from __future__ import annotations

from typing import ClassVar

from taxel.gap.effects.effect import Effect, Parameter
from taxel.gap.effects.geometry import compute_geometry
from taxel.gap.effects.lag import apply_low_pass
from taxel.gap.effects.plate import compute_closed_share, compute_signal_counts
from taxel.gap.fitting.state import Signal, State
from taxel.types import FloatArray

MAX_TIME_CONSTANT_RATIO = 3.0
"""Largest time constant, as a multiple of the recorded time. With a larger time constant, less than a third of the late
share arrives before the end of the record, and the effect is not distinguishable from another force law."""


class Hysteresis(Effect):
    """Hysteresis of a standard linear solid: a share `fraction` of a quantity follows with the time constant `seconds`.

    variant: the quantity. `force`: the force. `drop`: the signal. `depth`: the depth of the layer at this force, by the
    law of the simulator's layer. `gap`: the closed share x of the gap of a plate capacitor, whose signal is
    proportional to x / (1 - x); counts then increase faster than the closed share. `more`: an addition to the force,
    as in a layer that yields further under load.
    """

    name = "hysteresis"
    order = 42
    memory: ClassVar[bool] = True

    def __init__(self, variant: str = "drop", scope: str = "hand") -> None:
        self.variant, self.scope = variant, scope

    def own_parameters(self) -> tuple[Parameter, ...]:
        """Return the parameters: late share and time constant in seconds.

        The share of a quantity is at most the whole quantity; the addition of the form `more` can be larger.
        """
        largest = 1.5 if self.variant == "more" else 1.0
        return Parameter("fraction", "1", 0.0, largest, 0.0, 0.2), Parameter("seconds", "s", 0.05, 100.0, 1.0, 1.0)

    def find_unavailable_reason(self, state: State) -> str:
        """Return why the form is unavailable: the forms that act on the force need contact forces; otherwise ""."""
        acts_on_signal = self.variant in ("drop", "gap")
        return "" if acts_on_signal or state.has_force else "the simulation has no contact force"

    def is_idle(self, state: State, values: FloatArray) -> bool:
        """Return whether all time constants exceed `MAX_TIME_CONSTANT_RATIO` times the recorded time.

        values: f64[2, G], late fraction and time constant in seconds of each of G blocks.
        """
        return bool((values[1] > MAX_TIME_CONSTANT_RATIO * state.node_times_s[-1]).all())

    def apply(self, state: State, signal: Signal, values: FloatArray) -> Signal:
        """Return the signal after a fraction of a quantity has passed a low-pass filter and is therefore late.

        values: f64[2, G], late fraction and time constant in seconds of each of G blocks (the hand, or each board,
        object or taxel). The form determines the quantity: the force (`force`), the signal (`drop`), the depth of the
        layer (`depth`), or the closed share of a plate capacitor's gap (`gap`). The form `more` adds the filtered
        fraction of the force to the whole force. If all fractions are 0, `signal` itself is returned.
        """
        if not values[0].any():
            return signal
        fraction, seconds = self.spread_out(state, values)

        def delay_share(quantity: FloatArray) -> FloatArray:
            """Return a quantity f64[Q, K, n] (Q simulated contacts, K time nodes, n taxels) of which the share
            `fraction` passes a low-pass filter.
            """
            return quantity + fraction * (apply_low_pass(quantity, state.node_times_s, seconds[:, 0]) - quantity)

        if self.variant == "gap":
            return signal.with_signal_counts(
                compute_signal_counts(state, delay_share(compute_closed_share(state, signal)))
            )
        if self.variant == "drop":
            return signal.with_signal_counts(delay_share(state.to_signal_counts(signal)))
        assert signal.force is not None
        if self.variant == "depth":
            law = compute_geometry(state).law
            return signal.with_force(law.compute_force(delay_share(law.compute_depth(signal.force))))
        if self.variant == "more":
            return signal.with_force(
                signal.force + fraction * apply_low_pass(signal.force, state.node_times_s, seconds[:, 0])
            )
        return signal.with_force(delay_share(signal.force))
