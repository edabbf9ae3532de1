"""A small grasp campaign on the whole hand with one hidden cause, for the demonstration."""

import secrets
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from taxel.blind.catalogue_causes import CATALOGUE_CAUSES, sample_nuisance_lines
from taxel.blind.hidden import HiddenCauses
from taxel.blind.world_datasets import UndescribedSettings
from taxel.campaign.emulated import run_emulated
from taxel.campaign.simulated import SimSettings, run_simulated
from taxel.grasp.plan import PlannedGrasp, make_thesis_plan
from taxel.hand import load_hand

EMULATOR_EFFECTS: Final = (
    "spread film",
    "spread pillars",
    "coupling traces",
    "noise white",
    "noise line",
    "rheology solid",
    "saturation clip",
)
"""Emulator effects on the whole hand with a clear gap in thirty grasps. Other effects have too small a gap, because the
pose of the objects varies more between grasps than between indentations: with resistive coupling the gap was 18 counts
at a floor of 11 counts, and with a proximity field of 2 mm it was 20 counts; the verdict was correct, but no gap was
significant.
"""

STRENGTH: Final = (0.9, 1.0)
"""Range of the strength; at strength 1 the excess of indentations is six floors."""

APPROACHES_PER_OBJECT, SESSIONS, SIM_REPEATS = 2, 5, 2

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class GraspWorld:
    """The world of the demonstration. seed: of campaign and physics. salt: 256 random bits, hexadecimal."""

    seed: int
    hidden: HiddenCauses
    salt: str

    def to_json(self) -> dict[str, object]:
        """Return the world of a demonstration, with its hidden cause and its salt, as the sealed JSON values."""
        return {"seed": self.seed, "hidden": self.hidden.to_json(), "salt": self.salt}


def sample_grasp_world(seed: int | None = None) -> GraspWorld:
    """Sample a world of the demonstration: an emulated Allegro hand with one random hidden cause.

    seed: of the random numbers; None: random numbers of the operating system.
    """
    rng = np.random.default_rng(secrets.randbits(256) if seed is None else seed)
    cause_types = [cause_type for cause_type in CATALOGUE_CAUSES if cause_type.emulator_effect in EMULATOR_EFFECTS]
    cause_type = cause_types[int(rng.integers(len(cause_types)))]
    cause = cause_type.sample(rng, load_hand("original"), float(rng.uniform(*STRENGTH)))
    salt = secrets.token_hex(32) if seed is None else rng.bytes(32).hex()
    return GraspWorld(int(rng.integers(2**31)), HiddenCauses("single", (cause,), sample_nuisance_lines(rng)), salt)


def make_small_plans(
    seed: int, approaches: int = APPROACHES_PER_OBJECT, sessions: int = SESSIONS
) -> tuple[tuple[PlannedGrasp, ...], tuple[PlannedGrasp, ...]]:
    """Make the plans of the emulated hand and of the simulator, with some random approaches of every object.

    The hand performs each approach once in each session; the simulator performs each approach twice.
    """
    rng = np.random.default_rng(seed)
    plan = make_thesis_plan(seed)
    conditions = set()
    for item in sorted({planned.object for planned in plan}):
        names = sorted({planned.approach for planned in plan if planned.object == item})
        indices = rng.choice(len(names), min(approaches, len(names)), replace=False).tolist()
        conditions |= {(item, names[index]) for index in indices}
    grasps = [
        planned for planned in plan if (planned.object, planned.approach) in conditions and planned.session < sessions
    ]
    first_of_session = {(planned.object, planned.approach, planned.session): planned for planned in reversed(grasps)}
    real = tuple(
        planned for planned in grasps if first_of_session[planned.object, planned.approach, planned.session] is planned
    )
    last_of_condition = {(planned.object, planned.approach): planned for planned in real}
    sim = tuple(
        replace(planned, id=f"{index:02d}_{planned.object}_{planned.approach}_{number}", iteration=number, session=0)
        for index, planned in enumerate(last_of_condition.values())
        for number in range(SIM_REPEATS)
    )
    return real, sim


def make_grasps(
    world: GraspWorld, real: Path, sim: Path, progress: tuple[Progress, Progress], jobs: int | None = None
) -> None:
    """Run the grasps of a world on the emulated hand and in the simulator, and write both datasets.

    real, sim: files to write. progress: callbacks of the hand and of the simulator. jobs: number of processes; None:
    one per core. Raises TaxelError with a one-line message.
    """
    grasps, simulated = make_small_plans(world.seed)
    settings = UndescribedSettings(seed=world.seed, effects=world.hidden.lines)
    run_emulated(real, grasps, settings, jobs=jobs, progress=progress[0])
    run_simulated(sim, simulated, SimSettings(seed=world.seed + 1), jobs=jobs, progress=progress[1])
