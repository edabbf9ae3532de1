"""Base pairs: pairs of datasets without a cause, into which causes are injected.

A base pair is made once and used for several worlds.
"""

from __future__ import annotations

import os
import shutil
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import numpy as np

from taxel.blind.catalogue_causes import sample_nuisance_lines
from taxel.blind.grasp_world import make_small_plans
from taxel.blind.hidden import HiddenCauses
from taxel.blind.measured_touches import Frames, Repeat, list_touches, split_halves, split_repeats
from taxel.blind.sampling import sample_campaign_size
from taxel.blind.touch_datasets import write_dataset
from taxel.blind.world import World
from taxel.blind.world_datasets import UndescribedSettings, make_world
from taxel.campaign.emulated import run_emulated
from taxel.campaign.simulated import SimSettings, run_simulated
from taxel.recording import list_recordings, load_recording

INDENTATION, GRASP, TOUCH = "indentation", "grasp", "touch"

APPROACHES: Final = (2, 3)
SESSIONS: Final = (3, 5)
"""Smallest and largest number of approaches of each object, and of sessions, in a base of grasps."""

TOUCHES: Final = (16, 32)
"""Smallest and largest number of touches in a base of measured touches."""

REPEATS: Final = 8
"""Number of repeats into which a measured touch is split; one half is the real, the other the simulated dataset."""


@dataclass(frozen=True)
class BasePair:
    """A pair of datasets without a cause.

    kind: "indentation" or "grasp" (emulated skin and simulator), or "touch" (two halves of the repeats of measured
    touches). seed: seed of all random numbers.
    """

    kind: str
    seed: int

    def provide(self, folder: Path) -> tuple[Path, Path]:
        """Return the paths of the real and of the simulated dataset; make them unless the folder contains them.

        Raises TaxelError.
        """
        pair_folder = folder / f"{self.kind}-{self.seed}"
        if not pair_folder.exists():
            folder.mkdir(parents=True, exist_ok=True)
            with TemporaryDirectory(prefix=f".{pair_folder.name}-", dir=folder) as name:
                part = Path(name) / "pair"
                part.mkdir()
                self._make(part / "real.h5", part / "sim.h5")
                try:
                    os.rename(part, pair_folder)
                except OSError:  # another process has made the pair in the meantime
                    shutil.rmtree(part)
        return pair_folder / "real.h5", pair_folder / "sim.h5"

    def _make(self, real: Path, sim: Path) -> None:
        """Write the real dataset to `real` and the simulated dataset to `sim`, without a hidden cause.

        Touches: the two datasets are the two halves of the repeats of measured touches. Indentations and grasps: the
        real dataset is from the emulated skin, with the small deviations that every skin has; the simulated dataset is
        from the simulator.
        """
        rng = np.random.default_rng([self.seed, len(self.kind)])
        if self.kind == TOUCH:
            first, second = _sample_touches(rng)
            write_dataset(real, first, "corrected")
            write_dataset(sim, second, "corrected")
            return
        nuisances = sample_nuisance_lines(rng)
        if self.kind == INDENTATION:
            hidden = HiddenCauses("none", (), nuisances)
            make_world(World(0, "rig4", self.seed, hidden, "", size=sample_campaign_size(rng)), real, sim)
            return
        approaches, sessions = (int(rng.integers(low, high + 1)) for low, high in (APPROACHES, SESSIONS))
        grasps, simulated = make_small_plans(self.seed, approaches, sessions)
        run_emulated(real, grasps, UndescribedSettings(seed=self.seed, effects=nuisances), jobs=1)
        run_simulated(sim, simulated, SimSettings(seed=self.seed + 1), jobs=1)


def _sample_touches(rng: np.random.Generator) -> tuple[list[Repeat], list[Repeat]]:
    """Select random measured touches of a touch panel; return the two halves of their repeats."""
    touches = [
        touch for name in list_recordings() for touch in list_touches(Frames.from_recording(load_recording(name)))
    ]
    repeats = [split for touch in touches if (split := split_repeats(touch, REPEATS, rng))]
    chosen = rng.permutation(len(repeats))[: int(rng.integers(TOUCHES[0], TOUCHES[1] + 1))].tolist()
    return split_halves([repeat for index in sorted(chosen) for repeat in repeats[index]])
