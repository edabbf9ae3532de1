"""A small grasp campaign on the whole hand with hidden causes, for the demonstration."""

import secrets
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from taxel.blind.catalogue_causes import EFFECT_NAMES, list_cause_types, sample_nuisance_lines
from taxel.blind.hidden import Cause, HiddenCauses
from taxel.blind.world_datasets import UndescribedSettings
from taxel.campaign.emulated import run_emulated
from taxel.campaign.simulated import SimSettings, run_simulated
from taxel.grasp.plan import PlannedGrasp, make_thesis_plan
from taxel.hand import Hand, load_hand

KIND_SHARES: Final = {"single": 0.8, "several": 0.1, "none": 0.1}
"""Shares of worlds with one hidden cause, with two, and without one."""

STRENGTH: Final = (0.9, 1.0)
"""Range of the strength; at strength 1 the excess of indentations is six floors."""

APPROACHES_PER_OBJECT, SESSIONS, SIM_REPEATS = 2, 5, 2

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class GraspWorld:
    """The world of a demonstration. seed: of campaign and physics. salt: 256 random bits, hexadecimal."""

    seed: int
    hidden: HiddenCauses
    salt: str

    def to_json(self) -> dict[str, object]:
        """Return the world of a demonstration, with its hidden cause and its salt, as the sealed JSON values."""
        return {"seed": self.seed, "hidden": self.hidden.to_json(), "salt": self.salt}


def sample_grasp_world(seed: int | None = None) -> GraspWorld:
    """Sample a world of the demonstration: an emulated Allegro hand with a random hidden cause, two, or none.

    Every effect of the diagnosis's catalogue is equally probable, and so is every functional form of an effect. seed:
    of the random numbers; None: random numbers of the operating system.
    """
    rng = np.random.default_rng(secrets.randbits(256) if seed is None else seed)
    kind = str(rng.choice(list(KIND_SHARES), p=list(KIND_SHARES.values())))
    number = {"none": 0, "single": 1, "several": 2}[kind]
    names = [EFFECT_NAMES[index] for index in rng.choice(len(EFFECT_NAMES), number, replace=False).tolist()]
    hand = load_hand("original")
    causes = tuple(_sample_cause(name, rng, hand) for name in names)
    salt = secrets.token_hex(32) if seed is None else rng.bytes(32).hex()
    return GraspWorld(int(rng.integers(2**31)), HiddenCauses(kind, causes, sample_nuisance_lines(rng)), salt)


def _sample_cause(name: str, rng: np.random.Generator, hand: Hand) -> Cause:
    """Sample a form of an effect and its parameters."""
    types = list_cause_types(name)
    return types[int(rng.integers(len(types)))].sample(rng, hand, float(rng.uniform(*STRENGTH)))


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
    item = grasps[0].object
    effects = tuple(line.replace(" OBJECT ", f" {item} ") for line in world.hidden.lines)
    settings = UndescribedSettings(seed=world.seed, effects=effects)
    run_emulated(real, grasps, settings, jobs=jobs, progress=progress[0])
    run_simulated(sim, simulated, SimSettings(seed=world.seed + 1), jobs=jobs, progress=progress[1])
