"""Gap between the simulator and an emulated hand without effects, compared with the floor from repeats and sessions.

taxel grasp --source both --no-effects --out out/none
python tools/sim/measure_mismatch.py out/none/real.h5 out/none/sim.h5

--all: use the taxels of all boards, as for indentations; default: the taxels that the experiments of the thesis used.
"""

import sys

import numpy as np
from numpy.typing import NDArray

from taxel.cloud.contacts import select_used_taxels
from taxel.recording.grasp_dataset import GraspDataset

Key = tuple[str, str]


def read_hold_signals(
    path: str, use_all: bool
) -> tuple[dict[Key, dict[int, list[NDArray[np.float64]]]], NDArray[np.bool_]]:
    """Read the mean signals f64[n] over the hold phase of all grasps of a dataset, in counts.

    Returns lists of these signals by (object, approach) and session, and the mask bool[n] of the taxels to use.
    use_all: use all taxels, not only the taxels that worked in the experiments of the thesis.
    """
    signals: dict[Key, dict[int, list[NDArray[np.float64]]]] = {}
    with GraspDataset(path) as data:
        for grasp in data:
            by_session = signals.setdefault((grasp.object, grasp.approach), {})
            by_session.setdefault(grasp.session, []).append(grasp.mean_hold_signal())
        return signals, np.ones(data.taxels.n, bool) if use_all else select_used_taxels(data)


def main() -> int:
    """Print the gap between simulator and emulated hand and its floor in counts, for each approach and for all.

    Only the taxels with a signal above 10 counts in either dataset are used. The floor is the standard error of the
    mean over sessions. The exit status is 2 for wrong arguments.
    """
    paths = [argument for argument in sys.argv[1:] if argument != "--all"]
    if len(paths) != 2:
        print("usage: measure_mismatch.py [--all] REAL.h5 SIM.h5", file=sys.stderr)
        return 2
    (real, used), (sim, _) = (read_hold_signals(path, "--all" in sys.argv[1:]) for path in paths)
    gaps, floors = [], []
    print(f"{'approach':<36}{'gap':>8}{'floor':>8}{'grasp std':>11}   counts, RMS over taxels")
    for key, sessions in sorted(real.items()):
        means = np.stack([np.mean(signals, axis=0) for signals in sessions.values()])
        grasps = np.stack([signal for signals in sessions.values() for signal in signals])
        model = np.mean([signal for signals in sim[key].values() for signal in signals], axis=0)
        mean = means.mean(axis=0)
        has_signal = used & ((mean > 10.0) | (model > 10.0))
        gap2 = float(np.mean((mean - model)[has_signal] ** 2))
        floor2 = float(np.mean(means.var(axis=0, ddof=1)[has_signal]) / len(means))
        std = float(np.sqrt(np.mean(grasps.var(axis=0, ddof=1)[has_signal])))
        gaps.append(gap2)
        floors.append(floor2)
        print(f"{' '.join(key):<36}{np.sqrt(gap2):8.1f}{np.sqrt(floor2):8.1f}{std:11.1f}")
    gap, floor = np.sqrt(np.mean(gaps)), np.sqrt(np.mean(floors))
    print(f"{'all':<36}{gap:8.1f}{floor:8.1f}   excess {np.sqrt(max(gap**2 - floor**2, 0.0)):.1f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
