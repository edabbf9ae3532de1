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
from taxel.gap.data.prepare import prepare_pair
from taxel.gap.effects.catalogue import Forms, choose_effects, find_unavailable_reason
from taxel.gap.features.metric import Gap, measure_gap
from taxel.gap.fitting.composite import FittedEffect
from taxel.gap.fitting.fit_data import FitData
from taxel.types import FloatArray

ProgressCallback = Callable[[str, int, int], None]
"""Function that shows progress: name of the stage, steps done, number of steps."""

RIVAL_ODDS: Final = 0.1
"""Ratio of the weights of two sets from which both are plausible (chosen)."""

ONE_SESSION: Final = 0.49
"""Factor on the probabilities of causes with a single session (chosen): the variance between sessions is then unknown,
and a deviation of this session is at least as probable as a cause. With a factor below 0.5, no cause is named."""


@dataclass(frozen=True, eq=False)
class Comparison:
    """Result of a comparison.

    Attributes:
        fit_data: the prepared pair of datasets. gap: gap, floor and excess without effects.
        tried: names of the effects that were tried.
        sets, weights: the candidate sets and their weights.
        single_fits: coarse fit of each effect alone, by name.
        effects: evidence for each effect that is part of a set. remainder: evidence for an unknown cause.
    """

    fit_data: FitData
    gap: Gap
    tried: tuple[str, ...]
    sets: Sets
    weights: dict[frozenset[str], float]
    single_fits: dict[str, FittedEffect]
    effects: dict[str, EffectEvidence]
    remainder: RemainderEvidence

    @property
    def best(self) -> frozenset[str]:
        """Names of the effects of the set with the largest weight."""
        return max(self.weights, key=lambda key: self.weights[key])

    def get_best_with(self, name: str) -> Candidate | None:
        """Return the candidate with the largest weight whose set contains an effect; None if no set contains this
        effect.
        """
        keys = [key for key in self.sets if name in key]
        return self.sets[max(keys, key=lambda key: self.weights[key])] if keys else None

    def compute_probabilities(self, calibration: Calibration | None = None) -> dict[str, float]:
        """Compute the marginal probability of every effect that was tried, of an unknown cause and of no gap, by name.

        calibration: conversion from evidence to probabilities; None: the packaged calibration. With a single session
        the probabilities of causes are multiplied by `ONE_SESSION`.
        """
        inputs = {name: one.to_inputs() for name, one in self.effects.items()}
        calibration = calibration or load_calibration()
        probabilities = calibration.compute_probabilities(inputs, self.remainder.to_inputs(), self.tried)
        if self.fit_data.sessions.value.shape[1] > 1:
            return probabilities
        return {name: value if name == NO_GAP else ONE_SESSION * value for name, value in probabilities.items()}

    def list_rivals(self, name: str) -> list[str]:
        """Return the rivals of an effect, largest weight first.

        An effect is a rival if a set with the rival and without the named effect has a weight of at least `RIVAL_ODDS`
        times the weight of the best set with the named effect.
        """
        weight_with_name = max((weight for key, weight in self.weights.items() if name in key), default=0.0)
        others: dict[str, float] = {}
        for key, weight in self.weights.items():
            if name not in key and weight >= RIVAL_ODDS * weight_with_name > 0.0:
                others.update({other: max(weight, others.get(other, 0.0)) for other in key})
        return sorted(others, key=lambda other: -others[other])

    def get_single_fit(self, name: str) -> FittedEffect | None:
        """Return an effect that was fitted alone; None if there is no such fit."""
        single = self.sets.get(frozenset({name}))
        return single.composite.fitted_effects[0] if single is not None else self.single_fits.get(name)

    def compute_influence(self, name: str) -> list[tuple[int, float]]:
        """Compute the share of each condition in the evidence for an effect: pairs of condition index and share,
        largest first.

        The evidence is the held-out log density of the best set with the effect minus that of the best set without it;
        conditions that are evidence against the effect have the share 0. The list is empty if no set contains the
        effect, or if no condition supports it.
        """
        keys_with = [key for key in self.sets if name in key]
        if not keys_with:
            return []
        best_with = self.sets[max(keys_with, key=lambda key: self.sets[key].value)]
        keys_without = [key for key in self.sets if name not in key]
        best_without = self.sets[max(keys_without, key=lambda key: self.sets[key].value)]
        gain = np.maximum((best_with.held_out - best_without.held_out).sum(axis=(1, 2)), 0.0)
        order = np.argsort(-gain, kind="stable").tolist()
        return [(index, float(gain[index] / gain.sum())) for index in order] if gain.sum() > 0.0 else []


def ignore_progress(stage: str, done: int, total: int) -> None:
    """Ignore progress; default of the functions that report progress."""


def compare(
    real_path: str | PathLike[str],
    sim_path: str | PathLike[str],
    without: Collection[str] = (),
    seed: int = 0,
    settings: ComparisonSettings = DEFAULT_SETTINGS,
    show: ProgressCallback = ignore_progress,
) -> Comparison:
    """Compare sets of effects on a real and a simulated dataset.

    without: names of effects that are not tried. seed: seed of the bootstrap's random numbers. show: callback for
    progress. Raises DatasetError and GapInputError with a one-line message.
    """
    with threadpool_limits(limits=1):  # the matrices are small: threads would wait for each other
        pair = read_pair(real_path, sim_path, lambda done, total: show("reading", done, total))
        return compare_sets(prepare_pair(pair), choose_effects(without), seed, settings, show)


def compare_sets(
    fit_data: FitData,
    forms: Forms,
    seed: int = 0,
    settings: ComparisonSettings = DEFAULT_SETTINGS,
    show: ProgressCallback = ignore_progress,
) -> Comparison:
    """Compare sets of effects on a prepared pair of datasets.

    forms: forms of the effects by name. An effect whose forms are all unavailable on this pair is not tried.
    """
    forms = {
        name: effect_forms
        for name, effect_forms in forms.items()
        if not find_unavailable_reason(fit_data.state, effect_forms)
    }
    search = CandidateSearch(fit_data, forms, BlockDensity(fit_data, settings), settings)
    candidate_sets = search.run(lambda done, total: show("effect search", done, total))
    show("effect search", settings.largest_set, settings.largest_set)
    return weigh_sets(fit_data, tuple(forms), candidate_sets, seed, settings)


def weigh_sets(
    fit_data: FitData,
    tried: tuple[str, ...],
    candidate_sets: CandidateSets,
    seed: int = 0,
    settings: ComparisonSettings = DEFAULT_SETTINGS,
    simulated: Mapping[frozenset[str], FloatArray] = MappingProxyType({}),
) -> Comparison:
    """Compute the weights of candidate sets and the evidence for each effect and for an unknown cause.

    tried: names of the effects that were tried. seed: seed of the bootstrap's random numbers. simulated: features of
    simulations with some sets, see `taxel.gap.comparison.candidates.reevaluate`.
    """
    candidate_sets = reevaluate(fit_data, candidate_sets, settings, simulated)
    values = np.stack([one.held_out.sum(axis=(1, 2)) for one in candidate_sets.sets.values()])
    priors = [one.log_prior for one in candidate_sets.sets.values()]
    shares = compute_set_weights(values, [len(key) for key in candidate_sets.sets], settings, seed, priors)
    weights = dict(zip(candidate_sets.sets, shares.tolist(), strict=True))
    gap = measure_gap(fit_data.sessions, fit_data.state.mean, fit_data.layout)
    best = candidate_sets.sets[max(weights, key=lambda key: weights[key])]
    effects = collect_effects(fit_data, gap, candidate_sets.sets, weights)
    # The model error would explain the remainder of an unknown cause: it is omitted here.
    density = BlockDensity(fit_data, settings, repeat_share=candidate_sets.repeat_share)
    remainder = collect_remainder(fit_data, gap, best, density)
    return Comparison(
        fit_data, gap, tried, candidate_sets.sets, weights, candidate_sets.single_fits, effects, remainder
    )
