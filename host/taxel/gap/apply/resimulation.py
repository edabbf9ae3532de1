"""Simulations with the most probable sets of effects; their measured features replace the predictions of these sets."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np

from taxel.gap.apply.apply import add_effects
from taxel.gap.apply.rewriting import copy_file, open_temporary_output
from taxel.gap.apply.user_simulator import format_effects, run_simulator, split_command
from taxel.gap.comparison.candidates import CandidateSets
from taxel.gap.comparison.compare import RIVAL_ODDS, Comparison, ProgressCallback, ignore_progress, weigh_sets
from taxel.gap.data.pair import read_pair
from taxel.gap.data.prepare import prepare_pair
from taxel.gap.errors import GapInputError
from taxel.gap.features.metric import Interval, compute_shrink_interval, measure_gap
from taxel.gap.fitting.fit_data import FitData
from taxel.gap.report.model import describe_model
from taxel.gap.report.reading import ReportedEffect, convert_fitted_effect
from taxel.input_files import open_regular_file
from taxel.types import FloatArray

BUILTIN: Final = "builtin"
"""Value of the option --resim for the models of this project, which add every effect to every frame of the dataset."""

DEFAULT_BUDGET: Final = 3
"""Largest number of simulations in one diagnosis. Chosen: the two or three most probable sets decide the verdict."""


@dataclass(frozen=True)
class Resimulator:
    """Simulator that computes a dataset with given effects.

    Attributes:
        command: command of the user's simulator (`taxel.gap.apply.user_simulator.run_simulator`), or `BUILTIN`.
        folder: folder of the simulated datasets; complete datasets of an earlier run with the same inputs are reused.
        budget: largest number of simulations.
        seed: seed of the random numbers of noise, drift and lost frames, used by `BUILTIN`.
    """

    command: str
    folder: Path
    budget: int = DEFAULT_BUDGET
    seed: int = 0

    def __post_init__(self) -> None:
        """Check the command. Raises GapInputError for an invalid command."""
        if self.command != BUILTIN:
            split_command(self.command)

    def simulate(self, effects: Sequence[ReportedEffect], sim: Path) -> Path:
        """Simulate with effects, and return the path of the dataset. A dataset of an earlier run with the same inputs
        is reused.

        effects: effects in the order in which they act. sim: simulated dataset without effects. Raises GapInputError
        and DatasetError.
        """
        text = format_effects(effects, None)
        content = "\n".join([text, self.command, str(self.seed), _digest(sim)])
        target = self.folder / hashlib.sha256(content.encode()).hexdigest()[:16] / "sim.h5"
        if target.is_file():
            return target
        target.parent.mkdir(parents=True, exist_ok=True)
        with open_temporary_output(target, (sim,), overwrite=False) as temporary:
            if self.command == BUILTIN:
                copy_file(sim, temporary)
                note = json.dumps({"effects": [effect.name for effect in effects], "seed": self.seed})
                add_effects(effects, sim, temporary, note, self.seed)
            else:
                run_simulator(self.command, text, sim, temporary)
        return target


@dataclass(frozen=True)
class ResimulatedSet:
    """Measured gap of one simulation with effects.

    Attributes:
        effects: names of the added effects.
        before, after: gap without and with the effects, counts.
        floor: floor of the gap, counts.
        shrink: relative shrink of the gap, with its interval over the sessions.
        path: the simulated dataset.
    """

    effects: tuple[str, ...]
    before: float
    after: float
    floor: float
    shrink: Interval
    path: Path

    def to_json(self) -> dict[str, Any]:
        """Return the entry of the field `resimulated` of the report."""
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
    """Result of the simulations with effects.

    Attributes:
        comparison: comparison in which the simulated features replace the predictions of the simulated sets.
        results: the simulations, smallest gap first.
    """

    comparison: Comparison
    results: tuple[ResimulatedSet, ...] = field(default_factory=tuple)


def resimulate_sets(
    comparison: Comparison, simulator: Resimulator, seed: int = 0, show: ProgressCallback = ignore_progress
) -> Resimulation:
    """Simulate with the most probable sets of effects, and return the comparison with new weights of all sets.

    In each step the set with the largest weight that is not yet simulated is simulated. The steps end if its weight is
    below `RIVAL_ODDS` times the largest weight, or if the budget is used up. The measured features replace the
    predictions of the simulated sets (`taxel.gap.comparison.candidates.reevaluate`). seed: seed of the bootstrap.
    Raises GapInputError and DatasetError.
    """
    fit_data, results = comparison.fit_data, []
    simulated: dict[frozenset[str], FloatArray] = {}
    for number in range(simulator.budget):
        show("simulation with effects", number, simulator.budget)
        largest = max(comparison.weights.values())
        not_simulated = [key for key in comparison.weights if key and key not in simulated]
        key = max(not_simulated, key=lambda candidate: comparison.weights[candidate], default=None)
        if key is None or comparison.weights[key] < RIVAL_ODDS * largest:
            break
        effects = [
            convert_fitted_effect(fitted, describe_model(fit_data.state, fitted))
            for fitted in comparison.sets[key].composite.fitted_effects
        ]
        effects.sort(key=lambda effect: effect.order)
        path = simulator.simulate(effects, Path(fit_data.state.pair.paths[1]))
        simulated[key] = read_features(fit_data, path)
        results.append(_measure_set(fit_data, tuple(effect.name for effect in effects), simulated[key], path))
        candidates = CandidateSets(comparison.sets, comparison.single_fits)
        comparison = weigh_sets(fit_data, comparison.tried, candidates, seed, simulated=simulated)
    show("simulation with effects", simulator.budget, simulator.budget)
    return Resimulation(comparison, tuple(sorted(results, key=lambda result: result.after)))


def read_features(fit_data: FitData, path: Path) -> FloatArray:
    """Return the features of a further simulation of the same grasps, aligned in time with the hand, f64[C, F, n] (C
    conditions, F features, n taxels), counts.

    Raises GapInputError for a dataset whose taxels, conditions or durations of the phases differ.
    """
    pair = fit_data.state.pair
    other = read_pair(pair.paths[0], path)
    times = pair.time_grid.time_since_start_s, other.time_grid.time_since_start_s
    is_same = (pair.n, pair.conditions, times[0].shape) == (other.n, other.conditions, times[1].shape)
    if not is_same or not np.allclose(*times):
        expected = f"the grasps of {pair.paths[1]}: same taxels, conditions and durations of the phases"
        raise GapInputError(f"--resim: {path}", expected, "others", "let the simulator repeat the same grasps")
    return prepare_pair(other).state.mean


def _measure_set(fit_data: FitData, effects: tuple[str, ...], features: FloatArray, path: Path) -> ResimulatedSet:
    """Return the gap without and with the effects, the floor, and the relative reduction of the gap (`shrink`).

    effects: names of the effects. features: features of the simulation with these effects, f64[C, F, n] (C conditions,
    F features, n taxels), counts. path: dataset of this simulation.
    """
    real, layout, before = fit_data.sessions, fit_data.layout, fit_data.state.mean
    gaps = [measure_gap(real, model, layout) for model in (before, features)]
    reduction = compute_shrink_interval(real, before, features, layout)
    return ResimulatedSet(effects, gaps[0].gap.value, gaps[1].gap.value, gaps[0].floor, reduction, path)


def _digest(path: Path) -> str:
    """Return the SHA-256 of a file, in hexadecimal."""
    with open_regular_file(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
