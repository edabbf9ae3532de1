"""Saturation: the count stops decreasing at high force."""

from __future__ import annotations

from typing import Final

import numpy as np

from taxel.gap.effects.effect import Effect, Parameter
from taxel.gap.fitting.state import Signal, State
from taxel.types import FloatArray

START_SHARE: Final = 0.7
"""Start value of the limit, as a share of the largest simulated signal. Chosen below 1: without a limited signal the
derivative is 0 and the fit cannot start."""

SHARPNESS: Final = Parameter("sharpness", "1", 0.3, 10.0, 2.0, 2.0, 2.0)
"""Sharpness p of the variant `smooth`: 1 is the variant `soft`, and a large value approaches the variant `clip`. Prior
chosen: most limits are neither sharp nor as gradual as a resistive divider."""


class Saturation(Effect):
    """Limit of the size of a signal x at c = `counts`.

    variant `clip`: sharply. `soft`: x c / (|x| + c). `smooth`: x / (1 + (|x| / c)^p)^(1 / p) with p = `sharpness`, the
    saturation of an amplifier (Rapp 1991).
    """

    name = "saturation"
    order = 60

    def __init__(self, variant: str = "clip", scope: str = "hand") -> None:
        self.variant, self.scope = variant, scope

    def own_parameters(self) -> tuple[Parameter, ...]:
        """Return the parameters: the limit in counts, whose neutral value 1e6 exceeds every 16-bit count, and in the
        form `smooth` the sharpness.
        """
        counts = Parameter("counts", "counts", 50.0, 1e6, 1e6, 1000.0)
        return (counts, SHARPNESS) if self.variant == "smooth" else (counts,)

    def make_start_values(self, state: State) -> FloatArray:
        """Return the values at which a search starts, f64[P, G] (P parameters; G blocks: the hand, boards, objects or
        taxels). The limit is the prior mean if there is a prior, otherwise `START_SHARE` times the largest simulated
        signal.
        """
        values = super().make_start_values(state)
        if "counts" not in self.priors:
            counts = self.parameters()[0]
            largest = float(np.abs(np.nan_to_num(state.mean[:, : state.layout.bins])).max(initial=0.0))
            values[0] = np.clip(START_SHARE * largest, counts.low, counts.high)
        return values

    def apply(self, state: State, signal: Signal, values: FloatArray) -> Signal:
        """Return the limited signal; `signal` itself if all limits are neutral.

        values: f64[P, G] (G blocks: the hand, boards, objects or taxels), limit c of each block, counts, with the
        neutral value 1e6; in the form `smooth` also the sharpness of each block.

        A limit is nonlinear and must therefore act on the mean signal of all simulated contacts of a condition. The
        state contains only some of these contacts. `State.mean_difference`, the difference between the two mean
        signals, is added before the limit and subtracted after it.
        """
        if (values[0] >= 1e6).all():
            return signal
        limit, *shape = self.spread_out(state, values)
        difference = state.mean_difference
        signal_counts = state.to_signal_counts(signal) + difference
        if self.variant == "clip":
            limited = np.clip(signal_counts, -limit, limit)
        elif self.variant == "soft":
            limited = signal_counts * limit / (np.abs(signal_counts) + limit)
        else:
            limited = signal_counts / (1.0 + (np.abs(signal_counts) / limit) ** shape[0]) ** (1.0 / shape[0])
        return signal.with_signal_counts(np.where(limit >= 1e6, signal_counts, limited) - difference)
