"""Shares of the original programs' own errors in the real-to-simulation distance of the thesis (docs/thesis-gap.md).

For each seed the real side is the emulated hand of `taxel thesis` (DIR/seed_N/real.h5, made if it is missing). The
simulated side is the original contact plug-in, or the simulator with an elastic layer, with the tool poses of the
hardware and with those of the original simulation. Every effect is applied alone to a comparison without effects, and
removed alone from the comparison with all effects. Prints one table for each simulator, and writes all distances and
shares to DIR/gap_shares.json.

Example: python tools/thesis/gap_shares.py --out out/thesis-gap --seeds 1,2,3
"""

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

from taxel.campaign.emulated import run_emulated
from taxel.campaign.progress import Progress
from taxel.campaign.settings import EmulatedSettings
from taxel.campaign.setup import Setup
from taxel.campaign.simulated import SimSettings, run_simulated
from taxel.grasp.original_plan import Setting
from taxel.grasp.plan import make_thesis_plan
from taxel.hand import load_hand
from taxel.output import write_whole
from taxel.recording.grasp_dataset import GraspDataset
from taxel.thesis.own_gap.clouds import (
    MeasuredGrasp,
    Points,
    collect_layer_points,
    collect_plugin_points,
    collect_real_points,
    read_measured_grasps,
)
from taxel.thesis.own_gap.effects import GROUPS, LAYER_GROUPS, OwnEffects
from taxel.thesis.own_gap.plugin import PluginGrasp, simulate_plugin_grasps
from taxel.thesis.own_gap.plugin_file import read_plugin_grasps, write_plugin_grasps
from taxel.thesis.own_gap.shares import (
    ALL_OBJECTS,
    TOGETHER,
    Distances,
    compute_distances,
    compute_interval,
    compute_shares,
)
from taxel.thesis.own_gap.taxel_sets import TaxelSets, make_taxel_sets
from taxel.thesis.settings import EFFECTS, OBJECT_VARIATION, SIM_LAYER_M, SIM_VARIATION

SIM_SEED = 2
"""Seed of the simulator; its grasps do not vary, so that the seed changes nothing but the order and 4 counts of noise.
"""

SETTINGS: tuple[Setting, ...] = ("hardware", "simulation")
"""Tool poses of the simulator: without and with the effect `tuned_poses`."""

OBJECTS = ("rectangular_prism", "cylinder", "triangular_prism")
"""Order of the objects in the tables, as on the page."""

CollectSim = Callable[[OwnEffects], Points]


def show(stage: str) -> Progress:
    """Return a progress function that writes the name of the stage and the finished share to standard error."""
    return lambda done, total: print(f"\r{stage}: {done}/{total}", end="\n" if done == total else "", file=sys.stderr)


def read_real(out: Path, seed: int, grasps: int | None, jobs: int | None) -> list[MeasuredGrasp]:
    """Read the grasps of the campaign on the emulated hand; a missing or interrupted campaign is completed first.

    grasps: only the first ones of the plan; None: all.
    """
    path = out / f"seed_{seed}" / "real.h5"
    path.parent.mkdir(parents=True, exist_ok=True)
    settings = EmulatedSettings(seed=seed, effects=EFFECTS, variation=OBJECT_VARIATION)
    plan, setup = make_thesis_plan(seed)[:grasps], Setup(setting="hardware")
    run_emulated(path, plan, settings, setup, jobs=jobs, resume=True, progress=show(f"hand, seed {seed}"))
    with closing(GraspDataset(path)) as data:
        return read_measured_grasps(data)[: len(plan)]


def prepare_plugin(sets: TaxelSets, out: Path, jobs: int | None) -> CollectSim:
    """Simulate the grasps with the contact sensors of the original, and return a function that collects the points.

    The grasps are simulated with both `SETTINGS` of tool poses. The function takes a combination of effects, whose
    effect `tuned_poses` selects one of these two simulations.
    """
    hand = load_hand("original")
    grasps = {setting: read_plugin(out, setting, jobs) for setting in SETTINGS}
    return lambda effects: collect_plugin_points(hand, grasps[SETTINGS[effects.tuned_poses]], sets, effects)


def read_plugin(out: Path, setting: Setting, jobs: int | None) -> list[PluginGrasp]:
    """Read the plug-in's grasps with the poses of `setting` (DIR/plugin_*.npz); they are simulated first if missing."""
    path, settings = out / f"plugin_{setting}.npz", SimSettings(seed=SIM_SEED, variation=SIM_VARIATION)
    description = f"{settings.describe()}, poses of {setting}"
    if not path.exists():
        plan = make_thesis_plan(SIM_SEED)
        progress = show(f"plug-in, poses of {setting}")
        grasps = simulate_plugin_grasps(plan, settings, Setup(setting=setting, torques=setting), jobs, progress)
        write_plugin_grasps(path, grasps, description)
    return read_plugin_grasps(path, description)


def prepare_layer(sets: TaxelSets, out: Path, jobs: int | None) -> CollectSim:
    """Simulate the grasps with an elastic layer (DIR/layer_*.h5), and return the function that collects the points."""
    grasps, settings = {}, SimSettings(seed=SIM_SEED, variation=SIM_VARIATION)
    for setting in SETTINGS:
        path, setup = out / f"layer_{setting}.h5", Setup(setting=setting, torques=setting)
        layer = Setup(replace(setup.hand, layer_m=SIM_LAYER_M), setting=setting, torques=setting)
        progress = show(f"layer, poses of {setting}")
        run_simulated(path, make_thesis_plan(SIM_SEED), settings, layer, jobs, resume=True, progress=progress)
        with closing(GraspDataset(path)) as data:
            grasps[setting] = read_measured_grasps(data)
    return lambda effects: collect_layer_points(grasps[SETTINGS[effects.tuned_poses]], sets, effects)


def evaluate(
    real: Sequence[list[MeasuredGrasp]], collect_sim: CollectSim, sets: TaxelSets, groups: tuple[str, ...]
) -> dict[str, Any]:
    """Compute the distances and shares of all seeds.

    real: grasps of the hand for each seed. collect_sim: returns the simulated points with some effects. groups: effects
    of the table's rows. Keys of the result:

    - sim_points: number of simulated points by combination of effects and by object.
    - none_m, all_m: distances in metres without effects and with all effects, by object.
    - shares: fields of `Shares` by row, by field name ("alone", "removed") and by object.

    Each distance and each share is a list with one value per seed.
    """
    cache: dict[OwnEffects, Points] = {}
    per_seed = []
    for grasps in real:

        def measure(effects: OwnEffects, grasps: list[MeasuredGrasp] = grasps) -> Distances:
            """Return the distances of one seed with a combination of effects."""
            # The simulated points do not depend on these effects of the real side.
            key = replace(effects, coded_host=False, mask=False, rises=False)
            if key not in cache:
                cache[key] = collect_sim(key)
            return compute_distances(collect_real_points(grasps, sets, effects), cache[key])

        per_seed.append(compute_shares(groups, measure))
    objects = list(per_seed[0][0])
    return {
        "sim_points": {str(key): {name: len(points) for name, points in value.items()} for key, value in cache.items()},
        "none_m": {name: [none[name] for none, _, _ in per_seed] for name in objects},
        "all_m": {name: [full[name] for _, full, _ in per_seed] for name in objects},
        "shares": {
            row: {
                kind: {name: [getattr(shares[row], kind)[name] for _, _, shares in per_seed] for name in objects}
                for kind in ("alone", "removed")
            }
            for row in (*groups, TOGETHER)
        },
    }


def print_table(title: str, result: dict[str, Any]) -> None:
    """Print the table of one simulator: mean and 95 % interval over the seeds, in percent of the distance with all
    effects.
    """
    print(f"\n{title}")
    for label, key in (("without effects", "none_m"), ("all effects", "all_m")):
        text = ", ".join(f"{name} {format_interval(values, 1e3)}" for name, values in result[key].items())
        print(f"mean distance, {label}, mm: {text}")
    names = [ALL_OBJECTS, *sorted((name for name in result["none_m"] if name != ALL_OBJECTS), key=OBJECTS.index)]
    titles = (f"{name.replace('_', ' ')}: {kind}" for name in names for kind in ("alone", "removed"))
    print(f"| effect | {' | '.join(titles)} |")
    print("|---" * (1 + 2 * len(names)) + "|")
    for row, shares in result["shares"].items():
        columns = (format_interval(shares[kind][name], 100.0) for name in names for kind in ("alone", "removed"))
        print(f"| {row} | {' | '.join(columns)} |")
    for key, points in result["sim_points"].items():
        print(f"simulated points, {key}: {', '.join(f'{name} {number}' for name, number in points.items())}")


def format_interval(values: Sequence[float], scale: float) -> str:
    """Return the mean of values over seeds and half the width of its 95 % interval, multiplied by `scale`.

    Without an interval (its half width is NaN, as for a single seed), only the mean is returned.
    """
    interval = compute_interval(values)
    text = f"{scale * interval.mean:.1f}"
    return text if interval.half_width != interval.half_width else f"{text} ± {scale * interval.half_width:.1f}"


def main() -> None:
    """Make the missing campaigns, compute the shares with both simulators, and print and write them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("out/thesis-gap"), help="folder of the campaigns")
    parser.add_argument("--seeds", default="1,2,3", help="seeds of the real side, separated by commas")
    parser.add_argument("--grasps", type=int, default=None, help="first grasps of the plan on the hand; default: all")
    parser.add_argument("--jobs", type=int, default=None, help="number of processes; default: one per core")
    options = parser.parse_args()
    seeds = [int(text) for text in options.seeds.split(",")]
    sets = make_taxel_sets(load_hand("original"))
    real = [read_real(options.out, seed, options.grasps, options.jobs) for seed in seeds]
    print(f"seeds: {', '.join(map(str, seeds))}")
    results = {
        "plugin": evaluate(real, prepare_plugin(sets, options.out, options.jobs), sets, tuple(GROUPS)),
        "layer": evaluate(real, prepare_layer(sets, options.out, options.jobs), sets, LAYER_GROUPS),
    }
    print_table("Original contact plug-in", results["plugin"])
    print_table("Simulator with an elastic layer", results["layer"])
    write_whole(options.out / "gap_shares.json", json.dumps({"seeds": seeds, **results}, indent=1))


if __name__ == "__main__":
    main()
