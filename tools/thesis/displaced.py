"""A simulated campaign whose objects stand where they do on the emulated hand of a seed: what `tools/thesis/search.py`
searches on. share: of what the settings say, for each object alike.

Example: python tools/thesis/displaced.py out/displaced_0.8.h5 --share 0.8
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.campaign.setup import Setup
from taxel.campaign.simulated import SimSettings, simulate_planned_grasp
from taxel.campaign.store import open_campaign_writer
from taxel.campaign.variation import Variation, sample_grasp_variation
from taxel.grasp.plan import thesis_plan
from taxel.sim.closing import RATE_HZ
from taxel.thesis.settings import SCATTER, TOUCHED


@dataclass(frozen=True)
class AsOnTheHand(Variation):
    """draw: of the hand, in place of the simulator's own."""

    draw: tuple[float, ...] = ()

    def apply(self, draw: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
        """See `Variation`."""
        return super().apply(np.array(self.draw))


def main() -> None:
    """See the module."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--share", type=float, default=1.0)
    parser.add_argument("--seed", type=int, default=1)
    chosen = parser.parse_args()
    move, turn = (chosen.share * one for one in (SCATTER.object_m, SCATTER.object_rad))
    setup, settings = Setup(placings=TOUCHED), SimSettings(seed=chosen.seed + 1)
    model = settings.sensor.told(settings.sensing.stiffness_n_per_m, "uncoupled")
    with open_campaign_writer(
        chosen.out, "sim", setup, RATE_HZ, settings.describe(), overwrite=True, sensor_model=model
    ) as out:
        for planned in thesis_plan(chosen.seed):
            draw = tuple(sample_grasp_variation(chosen.seed, planned.id).tolist())
            variation = AsOnTheHand(object_m=move, object_rad=turn, draw=draw)
            out.add(simulate_planned_grasp(setup, planned, replace(settings, variation=variation)), planned.id)


if __name__ == "__main__":
    main()
