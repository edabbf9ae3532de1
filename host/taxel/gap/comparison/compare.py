"""The whole comparison of a pair of datasets, from the files to probabilities."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from os import PathLike

import numpy as np
from threadpoolctl import threadpool_limits

from taxel.gap.catalogue import chosen
from taxel.gap.comparison.calibration import Calibration, load_calibration
from taxel.gap.comparison.candidates import CandidateSearch
from taxel.gap.comparison.density import BlockDensity
from taxel.gap.comparison.evidence import EffectEvidence, RemainderEvidence, Sets, collect_effects, collect_remainder
from taxel.gap.comparison.settings import DEFAULT_SETTINGS, ComparisonSettings
from taxel.gap.comparison.weights import compute_set_weights
from taxel.gap.metric import Gap, measure
from taxel.gap.pair import read_pair
from taxel.gap.prepare import prepared


@dataclass(frozen=True, eq=False)
class Comparison:
    """Result of a comparison.

    Attributes:
        gap: gap, floor and excess without effects.
        tried: names of the effects that were tried.
        sets, weights: the candidate sets and their weights.
        effects: evidence for each effect that is part of a set. remainder: evidence for an unknown cause.
    """

    gap: Gap
    tried: tuple[str, ...]
    sets: Sets
    weights: dict[frozenset[str], float]
    effects: dict[str, EffectEvidence]
    remainder: RemainderEvidence

    @property
    def best(self) -> frozenset[str]:
        """The set with the largest weight."""
        return max(self.weights, key=lambda key: self.weights[key])

    def compute_probabilities(self, calibration: Calibration | None = None) -> dict[str, float]:
        """Marginal probability of every effect that was tried, of an unknown cause and of no gap.

        calibration: None: the packaged one.
        """
        inputs = {name: one.to_inputs() for name, one in self.effects.items()}
        calibration = calibration or load_calibration()
        return calibration.compute_probabilities(inputs, self.remainder.to_inputs(), self.tried)


def ignore_progress(stage: str, done: int, total: int) -> None:
    """Show no progress."""


def compare(
    real_path: str | PathLike[str],
    sim_path: str | PathLike[str],
    without: Collection[str] = (),
    seed: int = 0,
    settings: ComparisonSettings = DEFAULT_SETTINGS,
    show: Callable[[str, int, int], None] = ignore_progress,
) -> Comparison:
    """Compare sets of effects on a real and a simulated dataset.

    without: names of effects that are not tried. seed: of the bootstrap. Raises DatasetError and GapInputError with one
    line.
    """
    with threadpool_limits(limits=1):  # the matrices are small: threads would wait for each other
        pair = read_pair(real_path, sim_path, lambda done, total: show("reading", done, total))
        judge, _ = prepared(pair)
        forms = chosen(without)
        density = BlockDensity(judge, settings)
        search = CandidateSearch(judge, forms, density, settings)
        sets = search.run(lambda done, total: show("effects", done, total))
        values = [one.held_out.sum(axis=(1, 2)) for one in sets.values()]
        found = compute_set_weights(np.stack(values), [len(key) for key in sets], settings, seed)
        weights = dict(zip(sets, found.tolist(), strict=True))
        gap = measure(judge.sessions, judge.state.mean, judge.layout)
        best = max(weights, key=lambda key: weights[key])
        effects = collect_effects(judge, gap, sets, weights)
        remainder = collect_remainder(judge, gap, sets[best], density)
    return Comparison(gap, tuple(forms), sets, weights, effects, remainder)
