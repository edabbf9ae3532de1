"""Does `taxel gap diagnose` find the original programs' own errors? One pair of datasets for each (docs/thesis-gap.md).

Both sides of a pair are simulated grasps of the thesis (the first iterations of every approach), written once as a hand
and once as a simulator, that differ in one effect only. The hand therefore has no other gap than this effect. Prints
one row for each pair: verdict, named effects with the share of the gap that they remove, differences that the report
states, or the error line with which the pair is refused.

Example: python tools/thesis/diagnose_own_gap.py --out out/thesis-gap/diagnosis
"""

import argparse
import sys
from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from taxel.campaign.setup import Setup
from taxel.campaign.simulated import SimSettings, run_simulated
from taxel.errors import TaxelError
from taxel.gap.diagnosis import diagnose
from taxel.gap.effects.catalogue import DROPOUT
from taxel.grasp.original_plan import Setting
from taxel.grasp.plan import make_thesis_plan
from taxel.hand import load_hand
from taxel.recording import DatasetHeader, GraspDatasetWriter, GraspRecord
from taxel.recording.grasp import Grasp
from taxel.recording.grasp_dataset import GraspDataset
from taxel.recording.grasp_tables import TaxelTable
from taxel.sim.original_sensing import OriginalRules
from taxel.sim.sensing import Sensing
from taxel.thesis.own_gap.effects import NO_EFFECTS, OwnEffects
from taxel.thesis.own_gap.plugin import make_rules
from taxel.thesis.own_gap.taxel_sets import get_centres, make_taxel_sets
from taxel.thesis.settings import SIM_LAYER_M, SIM_VARIATION
from taxel.types import BoolArray, CountArray

HAND_SEED, SIM_SEED = 3, 2
"""Seeds of the two sides, so that their noise of 4 counts differs."""

HAND = load_hand("original")
SETS = make_taxel_sets(HAND)

EditCounts = Callable[[CountArray], CountArray]


def simulate(out: Path, name: str, seed: int, iterations: int, setting: Setting, rules: OriginalRules | None) -> Path:
    """Simulate the first iterations of every approach and return the path of the dataset, which is kept if it exists.

    out: folder of the dataset. iterations: number of iterations of each approach. setting: source of the tool poses and
    of the finger torques. rules: rules of the original contact plug-in; None: the simulator with an elastic layer.
    """
    path, setup = out / f"{name}.h5", Setup(setting=setting, torques=setting)
    plan = [planned for planned in make_thesis_plan(seed) if planned.iteration < iterations]
    settings = SimSettings(seed=seed, variation=SIM_VARIATION)
    if rules is None:
        setup = Setup(replace(setup.hand, layer_m=SIM_LAYER_M), setting=setting, torques=setting)
    else:
        settings = replace(settings, sensing=Sensing("original", original=rules))
    print(f"simulating {path.name}", file=sys.stderr)
    run_simulated(path, plan, settings, setup, resume=True)
    return path


def write_as_hand(sim: Path, out: Path, edit: EditCounts | None = None, taxels: TaxelTable | None = None) -> Path:
    """Write a simulated dataset as one of a hand, without forces, and return its path.

    edit: changes the raw counts u16[T, n] of a grasp. taxels: table that replaces that of the simulation.
    """
    with closing(GraspDataset(sim)) as data:
        header = DatasetHeader("real", data.hand, taxels or data.taxels, data.sensors, data.objects, "simulated hand")
        with GraspDatasetWriter.create(out, header, overwrite=True) as writer:
            for grasp in data:
                writer.add(_make_record(grasp, edit), grasp.id)
    return out


def _make_record(grasp: Grasp, edit: EditCounts | None) -> GraspRecord:
    """Create the record of a hand from a simulated grasp. edit: changes its raw counts; None: unchanged."""
    counts = grasp.raw_counts.copy()
    return GraspRecord(
        grasp.object,
        grasp.approach,
        grasp.iteration,
        grasp.session,
        grasp.timestamp,
        grasp.phase,
        counts if edit is None else edit(counts),
        grasp.valid,
        grasp.sensor_pose,
        grasp.object_pose,
        joint_position=grasp.joint_position,
    )


def freeze_masked(counts: CountArray) -> CountArray:
    """Replace the counts u16[T, n] of the masked taxels with their first count.

    The original host never reports a change of these taxels.
    """
    counts[:, SETS.is_masked] = counts[0, SETS.is_masked]
    return counts


def describe_diagnosis(real: Path, sim: Path) -> str:
    """Diagnose a pair of datasets and return part of a table row: verdict, named effects, stated differences."""
    try:
        report = diagnose(real, sim).report
    except TaxelError as error:
        return f"refused | | {str(error).replace(f'{real.parent}/', '')}"
    verdict, gap = report["verdict"], report["gap"]
    named = [_describe_effect(entry) for entry in report["effects"] if entry["in_verdict"]]
    unknown = [name for name in verdict["effects"] if name == "unknown"]
    numbers = f"{verdict['status']}, {gap['value']:.1f} counts (floor {gap['floor']:.1f})"
    return f"{numbers} | {', '.join([*named, *unknown]) or '-'} | {'; '.join(report['losses']) or '-'}"


def _describe_effect(entry: Mapping[str, Any]) -> str:
    """Return an effect's name and its share of the reducible gap.

    For a dropout, the text also states the number of its taxels, the number of their boards, and how many of the taxels
    are masked (the original host ignores them).
    """
    text = f"{entry['name']} ({100 * entry['shapley_share']:.0f} %"
    if entry["name"] == DROPOUT:
        taxels = find_dropped_taxels(entry["parameters"])
        boards = len(np.unique(HAND.sensor[taxels]))
        text += (
            f"; {taxels.sum()} taxels on {boards} boards, {np.count_nonzero(taxels & SETS.is_masked)} of them masked"
        )
    return text + ")"


def find_dropped_taxels(parameters: Mapping[str, Any]) -> BoolArray:
    """Return the taxels of a dropout in a gap report, bool[n]: single taxels, and those on whole lines and boards."""
    dropped = np.zeros(HAND.n_taxels, bool)
    dropped[np.array(parameters["taxels"]["value"], np.int64)] = True
    for address, axis, index in parameters["lines"]["value"]:
        dropped |= (HAND.sensor == address) & ((HAND.tx if axis == "tx" else HAND.rx) == index)
    return np.asarray(dropped | np.isin(HAND.sensor, parameters["sensors"]["value"]))


def make_pairs(out: Path, iterations: int, wanted: set[str]) -> dict[str, tuple[Path, Path]]:
    """Create the datasets of the wanted pairs and return (hand, simulator) by the name of the pair.

    wanted: names of pairs (`PAIRS`). A name is the effect in which both sides differ; the sides of "none" and
    "none_plugin" differ only in the seed. A twin is a simulation with the seed of the hand, which is written as the
    dataset of the hand.
    """
    pairs: dict[str, tuple[Path, Path]] = {}
    if wanted & {"none", "mask", "tuned_poses", "coded_host"}:
        twin = simulate(out, "layer_twin", HAND_SEED, iterations, "hardware", None)
        layer = simulate(out, "layer_hardware", SIM_SEED, iterations, "hardware", None)
        hand = write_as_hand(twin, out / "hand.h5")
        pairs["none"] = (hand, layer)
        pairs["mask"] = (write_as_hand(twin, out / "hand_mask.h5", freeze_masked), layer)
        with closing(GraspDataset(twin)) as data:
            coded = replace(data.taxels, position=_get_coded_positions())
        pairs["coded_host"] = (write_as_hand(twin, out / "hand_coded.h5", taxels=coded), layer)
        if "tuned_poses" in wanted:
            pairs["tuned_poses"] = (hand, simulate(out, "layer_simulation", SIM_SEED, iterations, "simulation", None))
    plugin = {
        "none_plugin": NO_EFFECTS,
        "stale_contacts": OwnEffects(stale_contacts=True),
        "coded_simulation": OwnEffects(coded_simulation=True),
    }
    if wanted & set(plugin):
        rules = make_rules(NO_EFFECTS)
        twin = simulate(out, "plugin_twin", HAND_SEED, iterations, "simulation", rules)
        hand = write_as_hand(twin, out / "hand_plugin.h5")
        for name in wanted & set(plugin):
            rules = make_rules(plugin[name])
            pairs[name] = (hand, simulate(out, f"plugin_{name}", SIM_SEED, iterations, "simulation", rules))
    return pairs


def _get_coded_positions() -> np.ndarray:
    """Return the taxel centres f64[n, 3] from the code of the original host; true centres where the code has none."""
    coded = get_centres(SETS, OwnEffects(coded_host=True), is_real=True)
    coded[SETS.has_no_coordinates] = SETS.true_centres[SETS.has_no_coordinates]
    return coded


PAIRS = ("none", "mask", "coded_host", "tuned_poses", "none_plugin", "stale_contacts", "coded_simulation")
"""Names of all pairs. The effects `rises` and `back_boards` change no count, hence they make no pair of their own."""


def main() -> None:
    """Create the pairs of datasets, diagnose them, and print one row for each."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("out/thesis-gap/diagnosis"), help="folder of the datasets")
    parser.add_argument("--iterations", type=int, default=4, help="grasps of each approach")
    parser.add_argument("--pairs", default=",".join(PAIRS), help="names of the pairs, separated by commas")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    wanted = options.pairs.split(",")
    pairs = make_pairs(options.out, options.iterations, set(wanted))
    print("| effect | verdict, gap | named effects (share of the gap) | stated differences |\n|---|---|---|---|")
    for name in wanted:
        print(f"| {name} | {describe_diagnosis(*pairs[name])} |", flush=True)


if __name__ == "__main__":
    main()
