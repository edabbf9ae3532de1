"""Fit the parameters of the simulator's sensor model to single taxels of the emulated skin.

python tools/sim/fit_sensor_model.py            a few seconds; prints signals, fit and residuals

One taxel in the middle of every board is loaded with increasing forces, as in a calibration with a probe and a load
cell. The fit uses only the applied forces and the raw counts.
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

FORCES_N = np.geomspace(0.02, 20.0, 31)
"""Applied forces."""

FIT_RANGE_N = (0.05, 5.0)
"""Range of the forces of grasps on single taxels. Forces in this range have equal weights, other forces none."""

START_S = 20.0
"""Virtual time of the first force: after discovery and baseline."""

HOLD_S = 2.0
SETTLE_S = 0.4
"""Time omitted after the start and before the end of each force: the ramp of the force, and scans during the ramp."""


@dataclass(frozen=True)
class Calibration:
    """Mean baseline; mean signal over the boards and its standard deviation between boards, for each force; counts."""

    force_n: FloatArray
    baseline_counts: float
    signal_counts: FloatArray
    std_counts: FloatArray


def measure_signals(hand: Hand, seed: int) -> Calibration:
    """Load one taxel of each emulated board with one force after the other, and return baseline and signals.

    After an unloaded baseline, each force acts for `HOLD_S`; the signal is averaged in the middle of this time.
    """
    loaded = np.array([hand.get_slice(board.address).start + board.kind.taxel_count // 2 for board in hand.boards])
    starts = START_S + HOLD_S * np.arange(len(FORCES_N))
    # Each force is constant from its start until 0.1 s before its end; the first two times are the unloaded baseline.
    times = np.concatenate([[0.0, START_S - 0.1], np.stack([starts, starts + HOLD_S - 0.1], axis=1).ravel()])
    forces = np.zeros((len(times), hand.n_taxels))
    # The force is proportional to the area of the taxel, so that the pressure is the same on all boards.
    forces[2:, loaded] = np.repeat(FORCES_N, 2)[:, None] * hand.area_share[loaded]
    end_s = START_S + HOLD_S * len(FORCES_N)
    with tempfile.TemporaryDirectory(prefix="taxel-") as folder:
        stimulus = Path(folder) / "forces.stm"
        write_stimulus(stimulus, times, forces)
        with open_skin(f"emulator:?speed=max&seed={seed}&stimulus={stimulus}", hand) as skin:
            baseline = skin.take_baseline().mean[loaded]
            seconds, counts = [], []
            for scan in skin.scans():
                if scan.time_s >= end_s:
                    break
                seconds.append(scan.time_s)
                counts.append(np.where(scan.valid[loaded], scan.raw_counts[loaded], np.nan))
    time_s, signals = np.array(seconds), baseline - np.array(counts)
    is_settled = [(time_s > start + SETTLE_S) & (time_s < start + HOLD_S - SETTLE_S) for start in starts]
    means = np.array([np.nanmean(signals[scans], axis=0) for scans in is_settled])
    return Calibration(FORCES_N, float(baseline.mean()), means.mean(axis=1), means.std(axis=1, ddof=1))


def compute_signal(force_n: FloatArray, full: float, half: float) -> FloatArray:
    """Compute the signal in counts of a taxel under a force in N: full F / (F + half).

    This is the sensor model of grasp datasets. full: signal in counts at infinite force. half: force in N at half of
    this signal.
    """
    return full * force_n / (force_n + half)


def fit(calibration: Calibration) -> tuple[float, float]:
    """Fit the sensor model by least squares.

    Returns the signal in counts at infinite force, and the force in N at half of it.
    """
    low, high = FIT_RANGE_N
    is_used = (calibration.force_n >= low) & (calibration.force_n <= high)
    start = (calibration.signal_counts.max(), 5.0)
    parameters, _ = curve_fit(
        compute_signal, calibration.force_n[is_used], calibration.signal_counts[is_used], p0=start
    )
    return float(parameters[0]), float(parameters[1])


def main() -> None:
    """Measure the emulated skin, and print its signals and the fitted sensor model."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--hand", default="original", help="a packaged hand or a description file")
    parser.add_argument("--seed", type=int, default=1, help="seed of the emulated world")
    options = parser.parse_args()
    data = measure_signals(load_hand(options.hand), options.seed)
    full, half = fit(data)
    model = compute_signal(data.force_n, full, half)
    residual = data.signal_counts - model
    is_used = (data.force_n >= FIT_RANGE_N[0]) & (data.force_n <= FIT_RANGE_N[1])
    print(f"seed {options.seed}, baseline {data.baseline_counts:.1f} counts")
    print(" force N    signal     std   model  residual")
    for row in zip(data.force_n, data.signal_counts, data.std_counts, model, residual, strict=True):
        print("{:8.3f} {:7.1f} {:7.1f} {:7.1f} {:9.1f}".format(*row))
    worst = np.flatnonzero(is_used)[np.abs(residual[is_used]).argmax()]
    print(f"full_scale_drop_counts {full:.1f}, half_force_n {half:.3f}, fitted to {FIT_RANGE_N[0]}..{FIT_RANGE_N[1]} N")
    rms = np.sqrt(np.mean(residual[is_used] ** 2))
    print(f"residual in this range: RMS {rms:.1f}, largest {residual[worst]:.1f} counts at {FORCES_N[worst]:.3f} N")
    active = ACTIVATION_THRESHOLD_COUNTS
    measured = brentq(lambda force: np.interp(force, data.force_n, data.signal_counts) - active, 0.02, 20.0)
    print(f"{active:g} counts: {measured:.3f} N measured, {half * active / (full - active):.3f} N by the model")


if __name__ == "__main__":
    main()
