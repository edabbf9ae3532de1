"""A simulated campaign whose objects stand a little elsewhere in each grasp: what `tools/thesis/search.py` searches on.

Example: python tools/thesis/displaced.py out/displaced.h5 --move 0.0034 --turn 0.04
"""

from __future__ import annotations

import argparse
from pathlib import Path

from taxel.campaign.scatter import Scatter
from taxel.campaign.simulated import SimSettings, run_simulated
from taxel.grasp.plan import thesis_plan


def main() -> None:
    """See the module."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--move", type=float, default=0.0007, help="Metres, standard deviation along each axis.")
    parser.add_argument("--turn", type=float, default=0.01, help="Radians, about each axis.")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=None)
    chosen = parser.parse_args()
    scatter = Scatter(object_m=chosen.move, object_rad=chosen.turn)
    settings = SimSettings(seed=chosen.seed + 1, scatter=scatter)
    run_simulated(chosen.out, thesis_plan(chosen.seed), settings, jobs=chosen.jobs, overwrite=True)


if __name__ == "__main__":
    main()
