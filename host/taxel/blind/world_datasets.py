"""The two datasets of a world: indentations on the emulated skin and in the simulator."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from taxel.blind.world import CampaignSize, World
from taxel.campaign.indentation import (
    IndentationDesign,
    IndentationPlan,
    indentation_settings,
    run_emulated_indentations,
    run_simulated_indentations,
    sample_indentation_plan,
)
from taxel.campaign.indentation.settings import SimIndentationSettings
from taxel.campaign.settings import EmulatedSettings
from taxel.campaign.variation import NO_VARIATION
from taxel.errors import TaxelError
from taxel.hand import load_hand

MAX_ATTEMPTS = 5
"""Largest number of plans that are sampled for a world until every indentation of a plan has an equilibrium."""


class WorldNotMadeError(TaxelError):
    """No sampled plan of a world had an equilibrium for every indentation."""

    def __init__(self, number: int, reason: str) -> None:
        """Create the error of a world without datasets. number: of the world. reason: message of the last attempt."""
        super().__init__(number, reason)

    def _format_message(self) -> str:
        """Format the error as one line with the number of the world and the message of the last attempt."""
        number, reason = self.args
        return f"world {number}: {MAX_ATTEMPTS} plans failed, the last with: {reason}; use another seed"


class UndescribedSettings(EmulatedSettings):
    """Settings without a digest in the dataset: a digest would allow guesses of the hidden causes to be verified."""

    def describe(self) -> str:
        """Return the same text for all settings, so that the dataset does not reveal them."""
        return "emulated hand"


def make_world(world: World, real: Path, sim: Path) -> int:
    """Write the real and the simulated dataset of a world; returns the number of the successful attempt.

    The simulated dataset does not depend on the hidden causes. The real dataset, of the emulated skin, depends on the
    causes only in its counts, its lost frames and their times. `SOURCE_DATE_EPOCH` sets the creation time of both.
    Raises WorldNotMadeError.
    """
    for attempt in range(MAX_ATTEMPTS):
        rng = np.random.default_rng([world.seed, attempt])
        try:
            plan = _sample_plan(world, world.size, rng)
            settings = _settings(plan, rng, effects=tuple(effect_lines(world, plan)))
            run_emulated_indentations(real, plan, settings, overwrite=True)
            run_simulated_indentations(sim, plan, SimIndentationSettings(seed=_sample_seed(rng)), overwrite=True)
            return attempt
        except TaxelError as error:
            reason = str(error)
    raise WorldNotMadeError(world.number, reason)


def make_reference(world: World, real: Path, attempt: int = 0) -> None:
    """Write a dataset of the world's indentations with its hidden causes, but without noise, variation and nuisances.

    attempt: the result of `make_world`. Raises TaxelError if an indentation without variation has no equilibrium.
    """
    rng = np.random.default_rng([world.seed, attempt])
    # One session with each approach once is enough, except for a drift, which continues through all sessions.
    has_drift = "baseline_drift" in world.hidden.names
    plan = _sample_plan(world, world.size if has_drift else replace(world.size, sessions=1, repeats=1), rng)
    lines = effect_lines(replace(world, hidden=replace(world.hidden, nuisances=())), plan)
    settings = _settings(plan, rng, effects=tuple(lines), variation=NO_VARIATION, noise_counts=0.0)
    run_emulated_indentations(real, plan, settings, overwrite=True)


def effect_lines(world: World, plan: IndentationPlan) -> list[str]:
    """Return the effect lines of a world for the emulator.

    The placeholder OBJECT in a line is replaced by the name of an object of the plan.
    """
    names = sorted(plan.objects)
    name = names[world.seed % len(names)]
    return [line.replace(" OBJECT ", f" {name} ") for line in world.hidden.lines]


def _sample_plan(world: World, size: CampaignSize, rng: np.random.Generator) -> IndentationPlan:
    """Sample a plan of indentations on the hand of a world. size: number of approaches, sessions and repeats."""
    return sample_indentation_plan(
        load_hand(world.hand),
        _sample_seed(rng),
        IndentationDesign(approaches=size.approaches, sessions=size.sessions, repeats=size.repeats),
    )


def _settings(plan: IndentationPlan, rng: np.random.Generator, **changes: Any) -> EmulatedSettings:
    """Make the settings of the emulated skin for a plan, with a random seed and without a digest of the settings."""
    return UndescribedSettings(**vars(indentation_settings(plan.hand, seed=_sample_seed(rng), **changes)))


def _sample_seed(rng: np.random.Generator) -> int:
    """Sample a seed for another random generator."""
    return int(rng.integers(2**31))
