"""How far the simulator and an emulated hand without effects are apart, against what repeats and sessions make of it.

taxel grasp --source both --no-effects --out out/none
python tools/sim/measure_mismatch.py out/none/real.h5 out/none/sim.h5

--all counts every board's taxels, as presses on a rig need it; else those that the thesis's experiments used.
"""

import sys

import numpy as np
from numpy.typing import NDArray

from taxel.cloud.contacts import select_used_taxels
from taxel.recording.grasp_dataset import GraspDataset

Key = tuple[str, str]


def hold_signals(path: str, every: bool) -> tuple[dict[Key, dict[int, list[NDArray[np.float64]]]], NDArray[np.bool_]]:
    """Mean signal over hold, counts [n], of each grasp by (object, approach) and session; and the taxels that count."""
    signals: dict[Key, dict[int, list[NDArray[np.float64]]]] = {}
    with GraspDataset(path) as data:
        for grasp in data:
            own = signals.setdefault((grasp.object, grasp.approach), {})
            own.setdefault(grasp.session, []).append(grasp.mean_hold_signal())
        return signals, np.ones(data.taxels.n, bool) if every else select_used_taxels(data)


def main() -> int:
    """Print gap and floor of each approach and of all, counts, over the taxels that either side activates."""
    paths = [word for word in sys.argv[1:] if word != "--all"]
    if len(paths) != 2:
        print("usage: mismatch.py [--all] REAL.h5 SIM.h5", file=sys.stderr)
        return 2
    (real, used), (sim, _) = (hold_signals(path, "--all" in sys.argv[1:]) for path in paths)
    gaps, floors = [], []
    print(f"{'approach':<36}{'gap':>8}{'floor':>8}{'one grasp':>11}   counts, RMS over taxels")
    for key, sessions in sorted(real.items()):
        means = np.stack([np.mean(own, axis=0) for own in sessions.values()])
        grasps = np.stack([signal for own in sessions.values() for signal in own])
        model = np.mean([signal for own in sim[key].values() for signal in own], axis=0)
        mean = means.mean(axis=0)
        felt = used & ((mean > 10.0) | (model > 10.0))
        gap2 = float(np.mean((mean - model)[felt] ** 2))
        floor2 = float(np.mean(means.var(axis=0, ddof=1)[felt]) / len(means))
        spread = float(np.sqrt(np.mean(grasps.var(axis=0, ddof=1)[felt])))
        gaps.append(gap2)
        floors.append(floor2)
        print(f"{' '.join(key):<36}{np.sqrt(gap2):8.1f}{np.sqrt(floor2):8.1f}{spread:11.1f}")
    gap, floor = np.sqrt(np.mean(gaps)), np.sqrt(np.mean(floors))
    print(f"{'all':<36}{gap:8.1f}{floor:8.1f}   excess {np.sqrt(max(gap**2 - floor**2, 0.0)):.1f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
