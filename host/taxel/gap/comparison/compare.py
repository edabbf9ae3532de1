"""The whole comparison of a pair of datasets: candidate sets, their weights, and the probabilities of causes."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from os import PathLike
from types import MappingProxyType
from typing import Final

import numpy as np
from threadpoolctl import threadpool_limits

from taxel.gap.calibration.calibration import NO_GAP, Calibration, load_calibration
from taxel.gap.comparison.candidates import Candidate, CandidateSearch, CandidateSets, Sets, reevaluate
from taxel.gap.comparison.density import BlockDensity
from taxel.gap.comparison.evidence import EffectEvidence, RemainderEvidence, collect_effects, collect_remainder
from taxel.gap.comparison.settings import DEFAULT_SETTINGS, ComparisonSettings
from taxel.gap.comparison.weights import compute_set_weights
from taxel.gap.data.pair import read_pair
from taxel.gap.data.prepare import prepared
from taxel.gap.effects.catalogue import Forms, chosen, find_unavailable_reason
from taxel.gap.features.metric import Gap, measure
from taxel.gap.fitting.composite import FittedEffect
from taxel.gap.fitting.judge import Judge
from taxel.types import FloatArray

Show = Callable[[str, int, int], None]

RIVAL_ODDS: Final = 0.1
"""Odds of two sets from which both are plausible."""

ONE_SESSION: Final = 0.49
"""Factor on the probabilities of causes with a single session: the variance between sessions is then unknown, and a
deviation of this session is at least as probable as a cause."""


@dataclass(frozen=True, eq=False)
class Comparison:
    """Result of a comparison.

    Attributes:
        judge: the pair of datasets. gap: gap, floor and excess without effects.
        tried: names of the effects that were tried.
        sets, weights: the candidate sets and their weights.
        alone: coarse fit of each effect alone.
        effects: evidence for each effect that is part of a set. remainder: evidence for an unknown cause.
    """

    judge: Judge
    gap: Gap
    tried: tuple[str, ...]
    sets: Sets
    weights: dict[frozenset[str], float]
    alone: dict[str, FittedEffect]
    effects: dict[str, EffectEvidence]
    remainder: RemainderEvidence

    @property
    def best(self) -> frozenset[str]:
        """The set with the largest weight."""
        return max(self.weights, key=lambda key: self.weights[key])

    def get_best_with(self, name: str) -> Candidate | None:
        """The set with the largest weight that contains an effect; None if no set does."""
        keys = [key for key in self.sets if name in key]
        return self.sets[max(keys, key=lambda key: self.weights[key])] if keys else None

    def compute_probabilities(self, calibration: Calibration | None = None) -> dict[str, float]:
        """Marginal probability of every effect that was tried, of an unknown cause and of no gap.

        calibration: None: the packaged one.
        """
        inputs = {name: one.to_inputs() for name, one in self.effects.items()}
        calibration = calibration or load_calibration()
        found = calibration.compute_probabilities(inputs, self.remainder.to_inputs(), self.tried)
        if self.judge.sessions.value.shape[1] > 1:
            return found
        return {name: value if name == NO_GAP else ONE_SESSION * value for name, value in found.items()}

    def list_rivals(self, name: str) -> list[str]:
        """Effects that may replace an effect: a set with the other effect and without this one has a weight of at least
        `RIVAL_ODDS` times that of the best set with this one; largest weight first.
        """
        own = max((weight for key, weight in self.weights.items() if name in key), default=0.0)
        others: dict[str, float] = {}
        for key, weight in self.weights.items():
            if name not in key and weight >= RIVAL_ODDS * own > 0.0:
                others.update({other: max(weight, others.get(other, 0.0)) for other in key})
        return sorted(others, key=lambda other: -others[other])

    def get_alone(self, name: str) -> FittedEffect | None:
        """An effect fitted alone; None if it has no fit."""
        single = self.sets.get(frozenset({name}))
        return single.composite.links[0] if single is not None else self.alone.get(name)

    def compute_influence(self, name: str) -> list[tuple[int, float]]:
        """Share of every condition in the evidence for an effect, largest first: [(index of the condition, share)].

        The evidence is the held-out log density of the best set with the effect minus that of the best set without it;
        conditions that speak against the effect have share 0. Empty if no set contains the effect.
        """
        with_name = [key for key in self.sets if name in key]
        if not with_name:
            return []
        own = self.sets[max(with_name, key=lambda key: self.sets[key].value)]
        others = [key for key in self.sets if name not in key]
        without = self.sets[max(others, key=lambda key: self.sets[key].value)]
        gain = np.maximum((own.held_out - without.held_out).sum(axis=(1, 2)), 0.0)
        order = np.argsort(-gain, kind="stable").tolist()
        return [(index, float(gain[index] / gain.sum())) for index in order] if gain.sum() > 0.0 else []


def ignore_progress(stage: str, done: int, total: int) -> None:
    """Show no progress."""


def compare(
    real_path: str | PathLike[str],
    sim_path: str | PathLike[str],
    without: Collection[str] = (),
    seed: int = 0,
    settings: ComparisonSettings = DEFAULT_SETTINGS,
    show: Show = ignore_progress,
) -> Comparison:
    """Compare sets of effects on a real and a simulated dataset.

    without: names of effects that are not tried. seed: of the bootstrap. Raises DatasetError and GapInputError with one
    line.
    """
    with threadpool_limits(limits=1):  # the matrices are small: threads would wait for each other
        pair = read_pair(real_path, sim_path, lambda done, total: show("reading", done, total))
        return compare_sets(prepared(pair), chosen(without), seed, settings, show)


def compare_sets(
    judge: Judge,
    forms: Forms,
    seed: int = 0,
    settings: ComparisonSettings = DEFAULT_SETTINGS,
    show: Show = ignore_progress,
) -> Comparison:
    """Compare sets of effects on a pair that was read.

    forms: forms of the effects by name. An effect whose forms are all unavailable on this pair is not tried.
    """
    forms = {name: own for name, own in forms.items() if not find_unavailable_reason(judge.state, own)}
    search = CandidateSearch(judge, forms, BlockDensity(judge, settings), settings)
    found = search.run(lambda done, total: show("effect search", done, total))
    show("effect search", settings.largest_set, settings.largest_set)
    return weigh_sets(judge, tuple(forms), found, seed, settings)


def weigh_sets(
    judge: Judge,
    tried: tuple[str, ...],
    found: CandidateSets,
    seed: int = 0,
    settings: ComparisonSettings = DEFAULT_SETTINGS,
    simulated: Mapping[frozenset[str], FloatArray] = MappingProxyType({}),
) -> Comparison:
    """Weigh candidate sets and collect their evidence.

    tried: names of the effects that were tried. simulated: see `taxel.gap.comparison.candidates.reevaluate`.
    """
    found = reevaluate(judge, found, settings, simulated)
    values = np.stack([one.held_out.sum(axis=(1, 2)) for one in found.sets.values()])
    priors = [one.log_prior for one in found.sets.values()]
    shares = compute_set_weights(values, [len(key) for key in found.sets], settings, seed, priors)
    weights = dict(zip(found.sets, shares.tolist(), strict=True))
    gap = measure(judge.sessions, judge.state.mean, judge.layout)
    best = found.sets[max(weights, key=lambda key: weights[key])]
    effects = collect_effects(judge, gap, found.sets, weights)
    # Without the model error, which would explain what an unknown cause leaves.
    density = BlockDensity(judge, settings, repeat_share=found.repeat_share)
    remainder = collect_remainder(judge, gap, best, density)
    return Comparison(judge, gap, tried, found.sets, weights, found.alone, effects, remainder)
