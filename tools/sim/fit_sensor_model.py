"""Which numbers of the simulator's sensor model fit single taxels of the emulated skin?

python tools/sim/fit_sensor_model.py            a few seconds; prints signals, fit and residuals

One taxel in the middle of every board is pressed over a ladder of forces, as an experimenter calibrates a skin with a
probe and a load cell: only forces go in and only raw counts come out.
"""

import argparse
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import brentq, curve_fit

from taxel.hand import Hand, load_hand
from taxel.link import write_stimulus
from taxel.signal import ACTIVATION_THRESHOLD_COUNTS
from taxel.skin import open_skin
from taxel.types import FloatArray

LADDER_N = np.geomspace(0.02, 20.0, 31)
FIT_RANGE_N = (0.05, 5.0)
"""Forces that grasps put on single taxels; equal weight for each rung in it, none outside."""

BEGIN_S = 20.0
"""First press, virtual seconds: after discovery and baseline."""

HOLD_S = 2.0
SETTLE_S = 0.4
"""Left out at both ends of a rung: the force's ramp and the scans that saw both sides of it."""


@dataclass(frozen=True)
class Ladder:
    """What was measured: mean baseline, and the mean signal over boards and its spread between them at each force."""

    force_n: FloatArray
    baseline_counts: float
    signal_counts: FloatArray
    spread: FloatArray


def press_ladder(hand: Hand, seed: int) -> Ladder:
    """Press one taxel of every board with one force after the other."""
    pressed = np.array([hand.get_slice(board.address).start + board.kind.taxel_count // 2 for board in hand.boards])
    starts = BEGIN_S + HOLD_S * np.arange(len(LADDER_N))
    times = np.concatenate([[0.0, BEGIN_S - 0.1], np.stack([starts, starts + HOLD_S - 0.1], axis=1).ravel()])
    forces = np.zeros((len(times), hand.n_taxels))
    forces[2:, pressed] = np.repeat(LADDER_N, 2)[:, None]
    end_s = BEGIN_S + HOLD_S * len(LADDER_N)
    with tempfile.TemporaryDirectory(prefix="taxel-") as folder:
        stimulus = Path(folder) / "ladder.stm"
        write_stimulus(stimulus, times, forces)
        with open_skin(f"emulator:?speed=max&seed={seed}&stimulus={stimulus}", hand) as skin:
            baseline = skin.take_baseline().mean[pressed]
            seconds, counts = [], []
            for scan in skin.scans():
                if scan.time_s >= end_s:
                    break
                seconds.append(scan.time_s)
                counts.append(np.where(scan.valid[pressed], scan.raw_counts[pressed], np.nan))
    at, signals = np.array(seconds), baseline - np.array(counts)
    during = [(at > start + SETTLE_S) & (at < start + HOLD_S - SETTLE_S) for start in starts]
    means = np.array([np.nanmean(signals[rung], axis=0) for rung in during])
    return Ladder(LADDER_N, float(baseline.mean()), means.mean(axis=1), means.std(axis=1, ddof=1))


def saturating(force_n: FloatArray, full: float, half: float) -> FloatArray:
    """The form of the dataset's sensor model."""
    return full * force_n / (force_n + half)


def fit(ladder: Ladder) -> tuple[float, float]:
    """Full-scale signal (counts) and half force (newtons) that fit best, least squares."""
    low, high = FIT_RANGE_N
    used = (ladder.force_n >= low) & (ladder.force_n <= high)
    start = (ladder.signal_counts.max(), 5.0)
    found, _ = curve_fit(saturating, ladder.force_n[used], ladder.signal_counts[used], p0=start)
    return float(found[0]), float(found[1])


def main() -> None:
    """Print the fit."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--hand", default="allegro", help="a packaged hand or a description file")
    parser.add_argument("--seed", type=int, default=1, help="of the emulated world")
    options = parser.parse_args()
    ladder = press_ladder(load_hand(options.hand), options.seed)
    full, half = fit(ladder)
    residual = ladder.signal_counts - saturating(ladder.force_n, full, half)
    inside = (ladder.force_n >= FIT_RANGE_N[0]) & (ladder.force_n <= FIT_RANGE_N[1])
    print(f"seed {options.seed}, baseline {ladder.baseline_counts:.1f} counts")
    print(" force N    signal  spread     fit  residual")
    for force, signal, spread, left in zip(ladder.force_n, ladder.signal_counts, ladder.spread, residual, strict=True):
        print(f"{force:8.3f} {signal:7.1f} {spread:7.1f} {signal - left:7.1f} {left:9.1f}")
    worst = np.flatnonzero(inside)[np.abs(residual[inside]).argmax()]
    print(f"full_scale_drop_counts {full:.1f}, half_force_n {half:.3f}, fitted to {FIT_RANGE_N[0]}..{FIT_RANGE_N[1]} N")
    rms = np.sqrt(np.mean(residual[inside] ** 2))
    print(f"there RMS {rms:.1f} counts, largest {residual[worst]:.1f} at {LADDER_N[worst]:.3f} N")
    active = ACTIVATION_THRESHOLD_COUNTS
    measured = brentq(lambda force: np.interp(force, ladder.force_n, ladder.signal_counts) - active, 0.02, 20.0)
    print(f"{active:g} counts: {measured:.3f} N measured, {half * active / (full - active):.3f} N by the fit")


if __name__ == "__main__":
    main()
