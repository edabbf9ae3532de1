"""Simulated campaign with the object poses of the emulated hand, the input of `tools/thesis/search_settings.py`.

--share scales the pose variation of `taxel.thesis.settings`, equally for all objects.

Example: python tools/thesis/simulate_displaced.py out/displaced_0.8.h5 --share 0.8
"""

import argparse
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taxel.campaign.setup import Setup
from taxel.campaign.simulated import SimSettings, simulate_planned_grasp
from taxel.campaign.store import open_campaign_writer
from taxel.campaign.variation import Variation, sample_grasp_variation
from taxel.grasp.plan import make_thesis_plan
from taxel.sim.closing import RATE_HZ
from taxel.thesis.settings import OBJECT_VARIATION


@dataclass(frozen=True)
class EmulatedVariation(Variation):
    """Variation with the given unit samples of a grasp on the emulated hand, instead of random ones."""

    unit_samples: tuple[float, ...] = ()

    def apply(self, draw: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
        """Return the object offset f64[6] and the torque factor of a grasp, from the fixed samples `unit_samples`.

        Overrides `Variation.apply`, which uses the random samples `draw`; they are ignored here, because the
        displacement must be that of the same grasp on the emulated hand.
        """
        return super().apply(np.array(self.unit_samples))


def main() -> None:
    """Simulate a campaign of grasps, in which each object is displaced as in the same grasp of the emulated hand."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path, help="dataset to write")
    parser.add_argument("--share", type=float, default=1.0, help="factor on the pose variation")
    parser.add_argument("--seed", type=int, default=1, help="seed of the campaign of the emulated hand")
    options = parser.parse_args()
    object_m, object_rad = (options.share * std for std in (OBJECT_VARIATION.object_m, OBJECT_VARIATION.object_rad))
    setup, settings = Setup(setting="hardware"), SimSettings(seed=options.seed + 1)
    model = settings.sensor.make_dataset_model(setup.hand, settings.sensing.stiffness_n_per_m, "uncoupled")
    with open_campaign_writer(
        options.out, "sim", setup, RATE_HZ, settings.describe(), overwrite=True, sensor_model=model
    ) as out:
        for planned in make_thesis_plan(options.seed):
            samples = tuple(sample_grasp_variation(options.seed, planned.id).tolist())
            variation = EmulatedVariation(object_m=object_m, object_rad=object_rad, unit_samples=samples)
            out.add(simulate_planned_grasp(setup, planned, replace(settings, variation=variation)), planned.id)


if __name__ == "__main__":
    main()
