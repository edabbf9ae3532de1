"""A small grasp campaign on the whole hand with a hidden cause, for the demonstration."""

from __future__ import annotations

import secrets
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from taxel.blind.hidden import Cause, Hidden
from taxel.blind.kinds import INSIDE, nuisances
from taxel.blind.making import UndescribedSettings
from taxel.campaign.emulated import run_emulated
from taxel.campaign.simulated import SimSettings, run_simulated
from taxel.grasp.plan import PlannedGrasp, thesis_plan
from taxel.hand import load_hand

SHOWN: Final = (
    "spread film",
    "spread pillars",
    "coupling traces",
    "noise white",
    "noise line",
    "rheology solid",
    "saturation clip",
)
"""Causes that act on the whole hand, and so much that thirty grasps show them: where objects stand scatters more from
grasp to grasp than in presses. Coupling by resistance made 18 counts where the floor is 11, a fringe field that answers
over 2 mm made 20: the right name, but no gap.
"""

STRENGTH: Final = (0.9, 1.0)
"""Of presses 1 is six floors above the floor."""

EACH, SESSIONS, REPEATS = 2, 5, 2

Show = Callable[[int, int], None]


@dataclass(frozen=True)
class GraspWorld:
    """seed: of campaign and physics. salt: hex, 256 bit."""

    seed: int
    hidden: Hidden
    salt: str

    def to_json(self) -> dict[str, object]:
        """For the seal."""
        return {"seed": self.seed, "hidden": self.hidden.to_json(), "salt": self.salt}


def drawn_grasp_world(seed: int | None = None) -> GraspWorld:
    """One cause in one form. seed: None: the operating system's random numbers."""
    rng = np.random.default_rng(secrets.randbits(256) if seed is None else seed)
    forms = [form for form in INSIDE if form.form in SHOWN]
    form = forms[int(rng.integers(len(forms)))]
    cause: Cause = form.draw(rng, load_hand("allegro"), float(rng.uniform(*STRENGTH)))
    salt = secrets.token_hex(32) if seed is None else rng.bytes(32).hex()
    return GraspWorld(int(rng.integers(2**31)), Hidden("single", (cause,), nuisances(rng)), salt)


def small_plans(seed: int) -> tuple[tuple[PlannedGrasp, ...], tuple[PlannedGrasp, ...]]:
    """Two approaches of every object: each once in five mountings of the skin; and twice, for the simulator."""
    rng = np.random.default_rng(seed)
    plan = thesis_plan(seed)
    chosen = set()
    for item in sorted({planned.object for planned in plan}):
        names = sorted({planned.approach for planned in plan if planned.object == item})
        chosen |= {(item, names[place]) for place in rng.choice(len(names), EACH, replace=False).tolist()}
    own = [planned for planned in plan if (planned.object, planned.approach) in chosen and planned.session < SESSIONS]
    once = {(planned.object, planned.approach, planned.session): planned for planned in reversed(own)}
    real = tuple(planned for planned in own if once[planned.object, planned.approach, planned.session] is planned)
    first = {(planned.object, planned.approach): planned for planned in real}
    sim = tuple(
        replace(planned, id=f"{place:02d}_{planned.object}_{planned.approach}_{number}", iteration=number, session=0)
        for place, planned in enumerate(first.values())
        for number in range(REPEATS)
    )
    return real, sim


def make_grasps(world: GraspWorld, real: Path, sim: Path, show: tuple[Show, Show], jobs: int | None = None) -> None:
    """Write both datasets. Raises TaxelError of one line."""
    grasps, simulated = small_plans(world.seed)
    settings = UndescribedSettings(seed=world.seed, effects=world.hidden.lines)
    run_emulated(real, grasps, settings, jobs=jobs, progress=show[0])
    run_simulated(sim, simulated, SimSettings(seed=world.seed + 1), jobs=jobs, progress=show[1])
