"""A world's two datasets, made in the sealing process: presses on the emulated skin, and in the simulator."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from taxel.blind.drawing import Shape, World
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

ATTEMPTS = 5
"""Plans that are drawn for a world until every press of it comes to rest."""


class WorldNotMadeError(TaxelError):
    """No plan of a world could be pressed."""

    def __init__(self, number: int, why: str) -> None:
        super().__init__(number, why)

    def __str__(self) -> str:
        number, why = self.args
        return f"world {number}: {ATTEMPTS} plans could not be made, the last: {why}; draw it anew"


class UndescribedSettings(EmulatedSettings):
    """Settings that a dataset must not tell: a digest of them would let a guess at them be tried."""

    def describe(self) -> str:
        """The same words for all."""
        return "emulated hand"


def make_world(world: World, real: Path, sim: Path) -> int:
    """Write both datasets; returns at which attempt. Raises WorldNotMadeError of one line.

    The simulator's is the same to the last bit whatever the world hides, and of the other only counts and what comes
    with them (frames that are lost, their times) differ. `SOURCE_DATE_EPOCH` sets when both say that they were made.
    """
    for attempt in range(ATTEMPTS):
        rng = np.random.default_rng([world.seed, attempt])
        try:
            plan = _plan(world, world.shape, rng)
            settings = _settings(plan, rng, effects=tuple(lines_of(world, plan)))
            run_emulated_indentations(real, plan, settings, overwrite=True)
            run_simulated_indentations(sim, plan, SimIndentationSettings(seed=_drawn_seed(rng)), overwrite=True)
            return attempt
        except TaxelError as error:
            why = str(error)
    raise WorldNotMadeError(world.number, why)


def make_reference(world: World, real: Path, attempt: int = 0) -> None:
    """The same presses without noise, scatter and nuisances: what the world's own parameters make of them.

    attempt: at which `make_world` has made it. Raises TaxelError of one line if one does not come to rest like that.
    """
    rng = np.random.default_rng([world.seed, attempt])
    # Every press of a session once; a drift goes on through all of them.
    drifts = "baseline_drift" in world.hidden.names
    plan = _plan(world, world.shape if drifts else replace(world.shape, sessions=1, repeats=1), rng)
    lines = lines_of(replace(world, hidden=replace(world.hidden, nuisances=())), plan)
    settings = _settings(plan, rng, effects=tuple(lines), variation=NO_VARIATION, noise_counts=0.0)
    run_emulated_indentations(real, plan, settings, overwrite=True)


def lines_of(world: World, plan: IndentationPlan) -> list[str]:
    """The emulator's lines; an object that is displaced is one of the plan's."""
    names = sorted(plan.objects)
    chosen = names[world.seed % len(names)]
    return [line.replace(" OBJECT ", f" {chosen} ") for line in world.hidden.lines]


def _plan(world: World, shape: Shape, rng: np.random.Generator) -> IndentationPlan:
    return sample_indentation_plan(
        load_hand(world.hand),
        _drawn_seed(rng),
        IndentationDesign(approaches=shape.approaches, sessions=shape.sessions, repeats=shape.repeats),
    )


def _settings(plan: IndentationPlan, rng: np.random.Generator, **changes: Any) -> EmulatedSettings:
    return UndescribedSettings(**vars(indentation_settings(plan.hand, seed=_drawn_seed(rng), **changes)))


def _drawn_seed(rng: np.random.Generator) -> int:
    return int(rng.integers(2**31))
