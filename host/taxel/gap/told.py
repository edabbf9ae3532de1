"""Where other presses tell the value of a taxel.

A value for each taxel is learned from that taxel's other presses. Where it has none nothing is predicted, so that cells
that were left out say nothing there of whether the effect is real: the others must, and alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from taxel.gap.effects.effect import TAXEL, Effect
from taxel.gap.judge import Judge
from taxel.types import FloatArray

TOLD: Final = 4.0
"""Information of presses over that of the prior, from which on they tell a value."""

LEAST_TOLD: Final = 0.05
"""Share of the score that must lie where values are told, for that part to speak of the effect."""

ENOUGH_TOLD: Final = 0.25
"""And for it to speak for the rest: below it most taxels were pressed in one way alone, where any change of amplitude
is a gain.
"""


@dataclass(frozen=True, eq=False)
class Told:
    """judge: of the features that can speak of an effect where they are left out. share: of the score, theirs."""

    judge: Judge
    share: float


def amplitude_information(judge: Judge) -> FloatArray:
    """On the log amplitude of each taxel in each cell, f64[C, n]; on a stiffness, which drops follow the less the
    harder a press, at most as much.
    """
    bins = judge.layout.bins
    return np.asarray((judge.weight[:, :bins] * judge.state.mean[:, :bins] ** 2).sum(axis=1))


def told_elsewhere(judge: Judge, prior: float) -> NDArray[np.bool_]:
    """Taxels of cells, bool[C, n], whose value the parts that are learned from tell when this one is left out. prior:
    scatter of the log amplitude that is expected of parts.
    """
    known, parts = amplitude_information(judge), judge.parts
    others = np.empty_like(known)
    for number in range(int(parts.max()) + 1):
        own = parts == number
        others[own] = np.broadcast_to(np.where(own, 0.0, known).sum(axis=0), own.shape)[own]
    return np.asarray(others * prior**2 > TOLD)


def told_of(effect: Effect, judge: Judge) -> Told:
    """What can speak of an effect; everything, where it has no value for each taxel, or where next to nothing can."""
    prior = effect.parameters()[0].prior
    if effect.scope != TAXEL or not np.isfinite(prior):
        return Told(judge, 1.0)
    mean = judge.state.mean
    told = judge.without(np.broadcast_to(~told_elsewhere(judge, prior)[:, None], mean.shape))
    share = told.score(mean).value / max(judge.score(mean).value, 1e-12)
    return Told(told if share > LEAST_TOLD else judge, share)
