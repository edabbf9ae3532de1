"""Worlds of the benchmark: a world of the blind check, as it is or with a faulty simulator file."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from taxel.blind.benchmark.faults import FAULTS, damage
from taxel.blind.sampling import sample_worlds
from taxel.blind.world import World
from taxel.blind.world_datasets import make_world

FAULTY_SHARE = 0.15
"""Share of the worlds with a faulty simulator file (chosen: 60 of 420, as in the full score)."""

INDENTATIONS, FAULTY = "indentations", "faulty simulator file"


@dataclass(frozen=True)
class BenchmarkWorld:
    """A world of the benchmark.

    world: hidden causes and campaign. fault: name of a fault of the simulator file (`FAULTS`); "": none. fault_seed: of
    the grasp and the frame of the fault.
    """

    world: World
    fault: str = ""
    fault_seed: int = 0

    @property
    def number(self) -> int:
        """Number of the world in the run."""
        return self.world.number

    @property
    def family(self) -> str:
        """Family of worlds to which it belongs."""
        return FAULTY if self.fault else INDENTATIONS

    def make(self, real: Path, sim: Path) -> None:
        """Write the two datasets of the world. Raises WorldNotMadeError."""
        make_world(self.world, real, sim)
        if self.fault:
            damage(sim, self.fault, self.fault_seed)

    def to_json(self) -> dict[str, Any]:
        """The world with its hidden causes as JSON values."""
        return {"world": self.world.to_json(), "fault": self.fault, "fault_seed": self.fault_seed}


def sample_benchmark(count: int, seed: int) -> list[BenchmarkWorld]:
    """Sample `count` worlds; equal seeds give equal worlds.

    The salt that seals a world of the blind check is not used here: the truth is compared after all answers are stored.
    """
    rng = np.random.default_rng([seed, count])
    worlds = [BenchmarkWorld(replace(world, salt="")) for world in sample_worlds(count, seed=seed)]
    faulty = rng.permutation(count)[: round(FAULTY_SHARE * count)].tolist()
    names = list(FAULTS)
    for place, number in enumerate(faulty):
        worlds[number] = replace(worlds[number], fault=names[place % len(names)], fault_seed=int(rng.integers(2**31)))
    return worlds
