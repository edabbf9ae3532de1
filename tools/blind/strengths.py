"""Gap over floor of every cause type of the blind check, from the weakest to the strongest.

    python tools/blind/strengths.py --emulator-effects "spread film,noise pink" --strengths 0,0.5,1 --worlds 2

Each world has one cause and the indentations of a blind check; nothing is diagnosed. `FLOORS` in
`host/taxel/blind/sampling.py` states the intended root of the excess, in floors, at strength 0 and 1. The ratio of gap
to floor is the root of 1 plus the square of this number: 1.1 and 6.1. A cause type with a different ratio needs another
parameter range.
The ratio of a cause on one board or line depends on the load of this location: use the median of several worlds. A
world takes about 8 s on one core.
"""

import argparse
import os
import sys
import tempfile
import zlib
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Final

import numpy as np

from taxel.blind.catalogue_causes import CATALOGUE_CAUSES, sample_nuisance_lines
from taxel.blind.hidden import HiddenCauses
from taxel.blind.out_of_catalogue import LOOKALIKES, OUT_OF_CATALOGUE
from taxel.blind.world import World
from taxel.blind.world_datasets import make_world
from taxel.errors import TaxelError
from taxel.gap.data.pair import read_pair
from taxel.gap.data.prepare import prepare_pair
from taxel.gap.features.metric import measure_gap
from taxel.hand import load_hand

CAUSE_TYPES: Final = {
    cause_type.emulator_effect: cause_type for cause_type in (*CATALOGUE_CAUSES, *OUT_OF_CATALOGUE, *LOOKALIKES)
}
HAND: Final = "rig4"


def main(arguments: list[str]) -> int:
    """Print for each cause type of the blind check the ratio of gap to floor at several strengths.

    Each table entry is the median over the worlds, with the smallest and the largest ratio. Returns 0.
    """
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--emulator-effects", help="separated by commas; default: all")
    parser.add_argument("--strengths", default="0,0.5,1", help="between 0 and 1, separated by commas")
    parser.add_argument("--worlds", type=int, default=2, help="worlds per cause type and strength")
    parser.add_argument("--seed", type=int, default=0, help="random seed")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="parallel worlds")
    options = parser.parse_args(arguments)
    requested = options.emulator_effects
    names = list(CAUSE_TYPES) if requested is None else [name.strip() for name in requested.split(",")]
    for name in names:
        if name not in CAUSE_TYPES:
            parser.error(f"--emulator-effects: expected {', '.join(CAUSE_TYPES)}, found '{name}'")
    try:
        strengths = [float(word) for word in options.strengths.split(",")]
    except ValueError:
        strengths = []
    if not strengths or not all(0.0 <= strength <= 1.0 for strength in strengths):
        parser.error(f"--strengths: expected numbers from 0 to 1, separated by commas, found '{options.strengths}'")
    if min(options.worlds, options.jobs) < 1:
        parser.error("--worlds, --jobs: expected at least 1")
    ratios: dict[tuple[str, float], list[float]] = {}
    with ProcessPoolExecutor(options.jobs) as pool:
        jobs = {
            pool.submit(compute_ratio, name, strength, [options.seed, number, zlib.crc32(name.encode())]): (
                name,
                strength,
            )
            for name in names
            for strength in strengths
            for number in range(options.worlds)
        }
        for finished, job in enumerate(as_completed(jobs), 1):
            ratios.setdefault(jobs[job], []).append(job.result())
            print(f"\r{finished} of {len(jobs)} worlds", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    print("| emulator effect | " + " | ".join(f"{strength:g}" for strength in strengths) + " |")
    print("|---" * (len(strengths) + 1) + "|")
    for name in names:
        rows = [sorted(ratios[name, strength]) for strength in strengths]
        columns = [f"{np.median(row):.1f} ({row[0]:.1f} to {row[-1]:.1f})" for row in rows]
        print(f"| {name} | " + " | ".join(columns) + " |", flush=True)
    return 0


def compute_ratio(name: str, strength: float, seed: list[int]) -> float:
    """Simulate one world with one hidden cause, and return the ratio of its gap to its floor.

    name: cause type, a key of `CAUSE_TYPES`; strength: 0 to 1. Returns NaN if no grasp plan has an equilibrium.
    """
    rng = np.random.default_rng(seed)
    cause = CAUSE_TYPES[name].sample(rng, load_hand(HAND), strength)
    hidden = HiddenCauses("single", (cause,), sample_nuisance_lines(rng))
    world = World(0, HAND, int(rng.integers(2**62)), hidden, "")
    with tempfile.TemporaryDirectory() as folder:
        real, sim = Path(folder, "real.h5"), Path(folder, "sim.h5")
        try:
            make_world(world, real, sim)
        except TaxelError:
            return float("nan")
        fit_data = prepare_pair(read_pair(real, sim))
        gap = measure_gap(fit_data.sessions, fit_data.state.mean, fit_data.layout)
    return gap.gap.value / gap.floor


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
