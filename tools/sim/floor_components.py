"""Components of the floor of a campaign on the emulated hand: object pose, grip, mounting, finger bases, noise.

python tools/sim/floor_components.py --out out/floor

Runs the first grasp of one approach to each object in six sessions, once with the full variation (all.h5) and once for
each source alone (one file each), without effects: 108 grasps. Prints, for each object, the floor (standard error of
the mean over the sessions, RMS over the taxels with a signal, counts) of each source, the root of the sum of their
squares, and the floor of the full variation with its 90 % interval. --seed selects the random samples.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from taxel.campaign.emulated import run_emulated
from taxel.campaign.floor_components import (
    ALL,
    SOURCES,
    FloorComponents,
    Key,
    compute_components,
    isolate_source,
    pool,
    select_grasps,
)
from taxel.campaign.settings import EmulatedSettings, parse_effects
from taxel.campaign.setup import Setup
from taxel.grasp.plan import SESSIONS, make_thesis_plan
from taxel.hand import load_hand

DEFAULT_APPROACHES = ("rectangular_prism:wide_side_1", "cylinder:side_1", "triangular_prism:side_1")


def get_path(folder: Path, source: str) -> Path:
    """Return the path of a source's dataset in the output folder."""
    return folder / f"{source.replace(' ', '_')}.h5"


def run_sources(folder: Path, keys: Sequence[Key], hand: str, settings: EmulatedSettings, jobs: int | None) -> None:
    """Run the grasps with each source of variation alone and with all sources, and write one dataset for each.

    keys: (object, approach) of the grasps.
    """
    folder.mkdir(parents=True, exist_ok=True)
    plan, setup = make_thesis_plan(settings.seed), Setup(load_hand(hand))
    for source in (*SOURCES, ALL):
        grasps = select_grasps(plan, keys, source)
        run_emulated(get_path(folder, source), grasps, isolate_source(settings, source), setup, jobs, overwrite=True)
        print(f"{source}: {len(grasps)} grasps", file=sys.stderr, flush=True)


def print_table(components: dict[Key, FloorComponents]) -> None:
    """Print one row of the floor's components for each object, and one for all objects together."""
    headings = "".join(f"{source:>14}" for source in SOURCES)
    print(f"{'object':<20}{'taxels':>8}{headings}{'sum':>8}{'all':>8}   interval   counts, RMS over taxels")
    names = sorted({name for name, _ in components})
    groups = {name: [part for key, part in components.items() if key[0] == name] for name in names}
    for name, parts in (groups | {"all objects": list(components.values())}).items():
        floor = pool(parts, SESSIONS)
        values = "".join(f"{floor.components[source]:14.1f}" for source in SOURCES)
        low, high = floor.interval
        print(f"{name:<20}{floor.taxels:8d}{values}{floor.sum:8.1f}{floor.total:8.1f}   {low:.0f} to {high:.0f}")


def main() -> int:
    """Run the grasps with each source of variation and print the components of the floor."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, required=True, help="folder for the datasets")
    parser.add_argument("--hand", default="original", help="a packaged hand or a description file")
    parser.add_argument("--seed", type=int, default=1, help="of the random samples")
    parser.add_argument("--jobs", type=int, help="number of processes; default: one per core")
    parser.add_argument("--effects", help="effect lines separated by ';', or thesis; default: none")
    parser.add_argument(
        "--approach", action="append", metavar="OBJECT:APPROACH", help="repeatable; default: one side of each object"
    )
    parser.add_argument("--compare-only", action="store_true", help="read the datasets that the folder contains")
    options = parser.parse_args()
    chosen = (text.partition(":") for text in options.approach or DEFAULT_APPROACHES)
    keys = [(name, approach) for name, _, approach in chosen]
    unknown = set(keys) - {(grasp.object, grasp.approach) for grasp in make_thesis_plan(options.seed)}
    if unknown:
        parser.error(f"--approach: expected OBJECT:APPROACH of the plan, found {':'.join(min(unknown))}")
    effects = tuple(parse_effects(options.effects)) if options.effects else ()
    if not options.compare_only:
        settings = EmulatedSettings(seed=options.seed, effects=effects)
        run_sources(options.out, keys, options.hand, settings, options.jobs)
    print_table(compute_components({source: get_path(options.out, source) for source in (*SOURCES, ALL)}))
    return 0


if __name__ == "__main__":
    sys.exit(main())
