"""What a comparison of candidate sets states of each effect, and of what the best set leaves."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import astuple, dataclass

import numpy as np

from taxel.gap.chain import Chain
from taxel.gap.comparison.candidates import Candidate
from taxel.gap.comparison.density import BlockDensity
from taxel.gap.judge import Judge
from taxel.gap.metric import Gap, measure
from taxel.types import FloatArray

SMALLEST_RATIO = 0.02
"""Ratios below this value count as this value in logarithms: a smaller effect is not resolved in any dataset."""

Sets = Mapping[frozenset[str], Candidate]


@dataclass(frozen=True)
class EffectEvidence:
    """Evidence for one effect.

    Attributes:
        weight: sum of the weights of all sets with the effect.
        gain: largest held-out log density of a set with the effect, minus the largest of a set without it.
        size: gap that the fitted effect alone produces, divided by the floor.
        share: this gap divided by the largest such gap of the effects of the same set.
    """

    weight: float
    gain: float
    size: float
    share: float

    def to_inputs(self) -> FloatArray:
        """Inputs of the calibration, f64[4]."""
        odds = np.log((self.weight + 1e-3) / (1.0 - self.weight + 1e-3))
        size, share = (np.log(max(value, SMALLEST_RATIO)) for value in (self.size, self.share))
        return np.array([odds, np.log1p(max(self.gain, 0.0)), size, share])


@dataclass(frozen=True)
class RemainderEvidence:
    """Evidence for a cause outside the catalogue, from what the best set leaves.

    Attributes:
        before, after: root of the excess without effects and with the best set, divided by the floor.
        deviation: mean deviation (`BlockDensity`) of the signal from the best set, over the blocks, weighted by the
            simulated signal.
        common: share of the remaining excess in the signal that the sessions have in common in more than one condition:
            the second largest share of a condition.
    """

    before: float
    after: float
    deviation: float
    common: float

    def to_inputs(self) -> FloatArray:
        """Inputs of the calibration, f64[4]."""
        return np.asarray(np.log(np.maximum(np.array(astuple(self)), SMALLEST_RATIO)), np.float64)


def collect_effects(
    judge: Judge, gap: Gap, sets: Sets, weights: Mapping[frozenset[str], float]
) -> dict[str, EffectEvidence]:
    """Evidence for every effect that is part of a candidate set. weights: of the sets."""
    names = sorted({name for key in sets for name in key})
    density = {key: float(one.held_out.sum()) for key, one in sets.items()}
    floor = max(gap.floor, np.finfo(float).tiny)
    evidence = {}
    for name in names:
        best = max((key for key in sets if name in key), key=lambda key: density[key])
        without = max(density[key] for key in sets if name not in key)
        sizes = {own: compute_alone(judge, sets[best].chain, own) for own in best}
        weight = float(sum(weights[key] for key in sets if name in key))
        share = sizes[name] / max(*sizes.values(), np.finfo(float).tiny) if len(sizes) > 1 else 1.0
        evidence[name] = EffectEvidence(weight, density[best] - without, sizes[name] / floor, share)
    return evidence


def collect_remainder(judge: Judge, gap: Gap, best: Candidate, density: BlockDensity) -> RemainderEvidence:
    """Evidence for a cause outside the catalogue. best: the set with the largest weight."""
    after = measure(judge.sessions, best.features, judge.layout)
    floor = max(gap.floor, np.finfo(float).tiny)
    before_floors, after_floors = (np.sqrt(max(one.excess.value, 0.0)) / floor for one in (gap, after))
    deviations = density.compute_deviations(best.features)[..., 0]
    signal = np.abs(judge.state.mean[:, : judge.layout.bins]).sum(axis=1)
    boards = np.arange(deviations.shape[1])[:, None] == judge.state.pair.groups.sensor
    load = signal @ boards.T.astype(np.float64)
    deviation = float((deviations * load).sum() / max(load.sum(), np.finfo(float).tiny))
    excess = after.terms.excess[:, : judge.layout.bins].sum(axis=(1, 2))
    order = np.sort(np.maximum(excess, 0.0))[::-1]
    common = float(order[1] / order.sum()) if len(order) > 1 and order.sum() > 0.0 else 0.0
    return RemainderEvidence(float(before_floors), float(after_floors), deviation, common)


def compute_alone(judge: Judge, chain: Chain, name: str) -> float:
    """Gap in counts that one fitted effect of a chain alone produces in the simulation."""
    link = next(one for one in chain.links if one.effect.name == name)
    known = judge.sessions.known.any(axis=1)
    change = np.where(known, Chain((link,)).features(judge.state) - judge.state.mean, 0.0)
    return float(np.sqrt((judge.layout.weight[:, None] * change**2).sum(axis=1).mean()))
