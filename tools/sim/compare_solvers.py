"""Difference of the two grasp solvers in nominal grasps: no effect, no variation, one grasp per condition.

python tools/sim/compare_solvers.py --out out/solvers [--floor out/none/real.h5]

Writes real.h5 (emulated hand) and sim.h5 (simulator) to the folder and prints, for each object and approach, the RMS
difference of the mean signals in hold over the taxels with a signal. --floor: a dataset of the emulated hand with the
usual variation, for example from `taxel grasp --source emulated --no-effects`; its floor for each approach, computed
from sessions, is the reference of the differences.
"""

import argparse
import sys
from pathlib import Path

import numpy as np
from measure_mismatch import read_hold_signals

from taxel.campaign.emulated import run_emulated
from taxel.campaign.settings import EmulatedSettings
from taxel.campaign.setup import Setup
from taxel.campaign.simulated import SimSettings, run_simulated
from taxel.campaign.variation import NO_VARIATION
from taxel.grasp.plan import PlannedGrasp, make_thesis_plan
from taxel.hand import load_hand

SIGNAL_COUNTS = 10.0
"""Mean signal above which a taxel takes part in the comparison, counts (2.5 standard deviations of the noise)."""


def make_nominal_plan() -> tuple[PlannedGrasp, ...]:
    """Return the first planned grasp of each object and approach."""
    first: dict[tuple[str, str], PlannedGrasp] = {}
    for planned in make_thesis_plan(1, 6):  # The seed 1 and the 6 sessions determine only the order of the grasps.
        first.setdefault((planned.object, planned.approach), planned)
    return tuple(first.values())


def run_both(out: Path, hand: str) -> None:
    """Run the nominal grasps with both solvers and write them to real.h5 and sim.h5 in the folder `out`."""
    plan, setup = make_nominal_plan(), Setup(load_hand(hand))
    out.mkdir(parents=True, exist_ok=True)
    run_simulated(out / "sim.h5", plan, SimSettings(variation=NO_VARIATION), setup, overwrite=True)
    run_emulated(out / "real.h5", plan, EmulatedSettings(variation=NO_VARIATION, effects=()), setup, overwrite=True)


def compute_floors(path: Path) -> dict[tuple[str, str], float]:
    """Return the floor of each (object, approach) of a dataset, in counts.

    The floor is the standard error of the mean over the sessions, RMS over the taxels with a signal.
    """
    signals, used = read_hold_signals(str(path), False)
    floors = {}
    for key, sessions in signals.items():
        means = np.stack([np.mean(grasps, axis=0) for grasps in sessions.values()])
        has_signal = used & (means.mean(axis=0) > SIGNAL_COUNTS)
        floors[key] = float(np.sqrt(np.mean(means.var(axis=0, ddof=1)[has_signal]) / len(means)))
    return floors


def main() -> int:
    """Run both solvers and print their differences, in counts and relative to the floor."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, required=True, help="folder for the two datasets")
    parser.add_argument("--hand", default="original", help="a packaged hand or a description file")
    parser.add_argument("--floor", type=Path, help="dataset of the emulated hand with variation")
    parser.add_argument("--compare-only", action="store_true", help="compare the datasets that the folder contains")
    options = parser.parse_args()
    if not options.compare_only:
        run_both(options.out, options.hand)
    (real, used), (sim, _) = (read_hold_signals(str(options.out / name), False) for name in ("real.h5", "sim.h5"))
    floors = compute_floors(options.floor) if options.floor else {}
    print(f"{'approach':<36}{'taxels':>7}{'signal':>8}{'ratio':>7}{'rms':>8}{'floor':>8}{'of floor':>9}")
    squares, floor_squares = [], []
    for key, sessions in sorted(real.items()):
        mean = np.mean([signal for signals in sessions.values() for signal in signals], axis=0)
        model = np.mean([signal for signals in sim[key].values() for signal in signals], axis=0)
        has_signal = used & ((mean > SIGNAL_COUNTS) | (model > SIGNAL_COUNTS))
        square = float(np.mean((mean - model)[has_signal] ** 2))
        floor = floors.get(key, float("nan"))
        squares.append(square)
        floor_squares.append(floor**2)
        ratio = model[has_signal].sum() / mean[has_signal].sum()
        print(
            f"{' '.join(key):<36}{has_signal.sum():7d}{mean[has_signal].mean():8.1f}{ratio:7.3f}"
            f"{square**0.5:8.1f}{floor:8.1f}{square**0.5 / floor:9.2f}"
        )
    pooled, floor = np.sqrt(np.mean(squares)), np.sqrt(np.mean(floor_squares))
    print(f"{'pooled':<36}{'':22}{pooled:8.1f}{floor:8.1f}{pooled / floor:9.2f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
