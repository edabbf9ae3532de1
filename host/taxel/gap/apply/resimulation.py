"""Simulations with the most probable sets of effects, whose measured gaps replace the predictions of the comparison."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np

from taxel.gap.apply.apply import add_effects
from taxel.gap.apply.resim import effects_text, run_simulator, split_command
from taxel.gap.apply.rewriting import copied, made_beside
from taxel.gap.comparison.candidates import CandidateSets
from taxel.gap.comparison.compare import RIVAL_ODDS, Comparison, Show, ignore_progress, weigh_sets
from taxel.gap.data.pair import read_pair
from taxel.gap.data.prepare import prepared
from taxel.gap.errors import GapInputError
from taxel.gap.features.metric import Interval, measure, shrink_by
from taxel.gap.fitting.judge import Judge
from taxel.gap.report.model import model_of
from taxel.gap.report.reading import ReportedEffect, reported_effect
from taxel.input_files import open_regular_file
from taxel.types import FloatArray

BUILTIN: Final = "builtin"
"""Command that stands for the project's own models: every effect is added to every frame of the simulator's dataset."""

DEFAULT_BUDGET: Final = 3
"""Simulations of one diagnosis; the two or three most probable sets decide a verdict."""


@dataclass(frozen=True)
class Resimulator:
    """A way to simulate with effects.

    Attributes:
        command: command of the user's simulator (`taxel.gap.apply.resim.run_simulator`), or `BUILTIN`.
        folder: folder of the simulated datasets; a dataset that an interrupted run completed is used again.
        budget: largest number of simulations.
        seed: of noise, drifts and lost frames of `BUILTIN`.
    """

    command: str
    folder: Path
    budget: int = DEFAULT_BUDGET
    seed: int = 0

    def __post_init__(self) -> None:
        """Check the command. Raises GapInputError."""
        if self.command != BUILTIN:
            split_command(self.command)

    def simulate(self, effects: Sequence[ReportedEffect], sim: Path) -> Path:
        """Simulate with effects, in the order in which they act; return the dataset. sim: without effects.

        Raises GapInputError and DatasetError.
        """
        text = effects_text(effects, None)
        content = "\n".join([text, self.command, str(self.seed), _digest(sim)])
        target = self.folder / hashlib.sha256(content.encode()).hexdigest()[:16] / "sim.h5"
        if target.is_file():
            return target
        target.parent.mkdir(parents=True, exist_ok=True)
        with made_beside(target, (sim,), overwrite=False) as whole:
            if self.command == BUILTIN:
                copied(sim, whole)
                note = json.dumps({"effects": [one.name for one in effects], "seed": self.seed})
                add_effects(effects, sim, whole, note, self.seed)
            else:
                run_simulator(self.command, text, sim, whole)
        return target


@dataclass(frozen=True)
class ResimulatedSet:
    """Measured gap of one simulation: names of the added effects; gap before and after, and floor, in counts; shrink
    with its interval over the sessions.
    """

    effects: tuple[str, ...]
    before: float
    after: float
    floor: float
    shrink: Interval
    path: Path

    def to_json(self) -> dict[str, Any]:
        """Entry of the field `resimulated` of the report."""
        return {
            "effects": list(self.effects),
            "before": self.before,
            "after": self.after,
            "floor": self.floor,
            "shrink": self.shrink.value,
            "shrink_ci95": self.shrink.ci95,
            "path": str(self.path),
        }


@dataclass(frozen=True, eq=False)
class Resimulation:
    """The comparison with the simulated features of the sets, and the simulations, smallest gap first."""

    comparison: Comparison
    results: tuple[ResimulatedSet, ...] = field(default_factory=tuple)


def resimulate_sets(
    comparison: Comparison, simulator: Resimulator, seed: int = 0, show: Show = ignore_progress
) -> Resimulation:
    """Simulate with the most probable sets of effects, and weigh all sets again.

    In each step the set with the largest weight that is not yet simulated is simulated, as long as its weight is at
    least `RIVAL_ODDS` times the largest one and the budget lasts; see `taxel.gap.comparison.candidates.reevaluate`.
    seed: of the bootstrap. Raises GapInputError and DatasetError.
    """
    judge, results = comparison.judge, []
    simulated: dict[frozenset[str], FloatArray] = {}
    for number in range(simulator.budget):
        show("simulation with effects", number, simulator.budget)
        largest = max(comparison.weights.values())
        waiting = [key for key in comparison.weights if key and key not in simulated]
        key = max(waiting, key=lambda one: comparison.weights[one], default=None)
        if key is None or comparison.weights[key] < RIVAL_ODDS * largest:
            break
        effects = [reported_effect(link, model_of(judge.state, link)) for link in comparison.sets[key].composite.links]
        effects.sort(key=lambda one: one.order)
        path = simulator.simulate(effects, Path(judge.state.pair.paths[1]))
        simulated[key] = read_features(judge, path)
        results.append(_measure_set(judge, tuple(one.name for one in effects), simulated[key], path))
        found = CandidateSets(comparison.sets, comparison.alone)
        comparison = weigh_sets(judge, comparison.tried, found, seed, simulated=simulated)
    show("simulation with effects", simulator.budget, simulator.budget)
    return Resimulation(comparison, tuple(sorted(results, key=lambda one: one.after)))


def read_features(judge: Judge, path: Path) -> FloatArray:
    """Features f64[C, F, n] of a further simulation of the same grasps, aligned in time with the hand.

    Raises GapInputError for a dataset of other taxels, conditions or durations.
    """
    own = judge.state.pair
    other = read_pair(own.paths[0], path)
    times = own.clock.since_start, other.clock.since_start
    same = (own.n, own.conditions, times[0].shape) == (other.n, other.conditions, times[1].shape)
    if not same or not np.allclose(*times):
        expected = f"the grasps of {own.paths[1]}: same taxels, conditions and durations of the phases"
        raise GapInputError(f"--resim: {path}", expected, "others", "let the simulator repeat the same grasps")
    return prepared(other).state.mean


def _measure_set(judge: Judge, effects: tuple[str, ...], features: FloatArray, path: Path) -> ResimulatedSet:
    """Gap before and after, and shrink, of simulated features f64[C, F, n]."""
    real, layout, before = judge.sessions, judge.layout, judge.state.mean
    gaps = [measure(real, model, layout) for model in (before, features)]
    reduction = shrink_by(real, before, features, layout)
    return ResimulatedSet(effects, gaps[0].gap.value, gaps[1].gap.value, gaps[0].floor, reduction, path)


def _digest(path: Path) -> str:
    """SHA-256 of a file."""
    with open_regular_file(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
