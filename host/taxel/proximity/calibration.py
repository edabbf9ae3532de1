"""Calibration of the proximity response: curves by kind of board and target, with noise and drift."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from taxel.hand import Hand
from taxel.proximity.curve_fit import CurveFit, fit_curve
from taxel.proximity.hold_signals import HoldCounts, compute_held_signals
from taxel.proximity.response import ResponseCurve
from taxel.proximity.skin_points import compute_skin_points
from taxel.signal import measure_noise

MIN_NOISE_COUNTS = 0.3
"""Smallest assumed noise: that of rounding to whole counts, 1 / sqrt(12) counts."""

MIN_DRIFT_COUNTS = 0.3
"""Smallest assumed random walk of the baseline, counts per square root of a second (chosen: a change of a degree in a
minute has the order of 10 counts). A smaller value makes intervals of far targets too narrow after a change of the
temperature."""

MIN_CURVE_ERROR = 0.02
"""Smallest relative error of a curve: a distance of 2 mm that is set with 0.02 mm changes the signal by about 1 %."""


@dataclass(frozen=True, eq=False)
class TargetResponse:
    """Response of one kind of board to one target.

    curve, curve_error, gain_spread: as in `CurveFit`. boards: names of the boards from which the response was measured.
    """

    curve: ResponseCurve
    curve_error: float
    gain_spread: float
    boards: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class KindCalibration:
    """Calibration of one kind of board (boards with the same layout of taxels).

    noise_counts: standard deviation of the white noise of a taxel in one frame. drift_counts: random walk of a board's
    mean baseline, counts per square root of a second. targets: responses by the name of the target.
    """

    noise_counts: float
    drift_counts: float
    targets: dict[str, TargetResponse]


@dataclass(frozen=True, eq=False)
class ProximityCalibration:
    """Calibration of a skin. hand: name of its description. kinds: calibration of each kind of board, by its name."""

    hand: str
    kinds: dict[str, KindCalibration]


def calibrate(hand: Hand, counts: Sequence[HoldCounts]) -> ProximityCalibration:
    """Calibrate all kinds of boards for which `counts` contains a target at known distances.

    Raises `ProximityError` for a board without frames that were recorded without a target, or for too few distances.
    """
    signals = compute_held_signals(counts)
    kinds: dict[str, KindCalibration] = {}
    for kind in dict.fromkeys(hand.find_board(signal.board).kind.name for signal in signals):
        boards = [board for board in hand.boards if board.kind.name == kind]
        names = {board.name for board in boards}
        noise, drift = _measure_rest([each for each in counts if each.hold.board in names])
        points = {board.name: compute_skin_points(hand, board) for board in boards}
        of_kind = [signal for signal in signals if signal.board in names]
        targets = {}
        for target in dict.fromkeys(signal.target for signal in of_kind):
            at_target = [signal for signal in of_kind if signal.target == target]
            fit = fit_curve(points, at_target, noise)
            targets[target] = _make_response(fit, tuple(sorted({signal.board for signal in at_target})))
        kinds[kind] = KindCalibration(noise, drift, targets)
    return ProximityCalibration(hand.name, kinds)


def _make_response(fit: CurveFit, boards: tuple[str, ...]) -> TargetResponse:
    """Make the response of a fit, with an error of at least `MIN_CURVE_ERROR`."""
    return TargetResponse(fit.curve, max(fit.curve_error, MIN_CURVE_ERROR), fit.gain_spread, boards)


def _measure_rest(counts: Sequence[HoldCounts]) -> tuple[float, float]:
    """Measure noise and drift in the holds without a target.

    Returns the standard deviation of a taxel's white noise, counts, and the random walk of the mean over all taxels,
    counts per square root of a second. The random walk follows from the differences of successive one-second means: for
    a random walk of variance d^2 per second, their variance is 2/3 d^2. The variance from white noise is subtracted.
    """
    noises, walks = [], []
    for each in counts:
        if each.hold.distance_m is not None:
            continue
        white = measure_noise(each.raw_counts.astype(np.uint16)).white_sigma
        noises.append(float(np.nanmedian(white)))
        second = ((each.time_s - each.time_s[0]) // 1.0).astype(int)
        means = [each.raw_counts[second == number].mean(axis=0) for number in range(second[-1])]
        frames = max(len(each.time_s) / max(second[-1], 1), 1.0)
        if len(means) >= 3:
            steps = np.diff(np.array(means).mean(axis=1))
            white_part = 2.0 * noises[-1] ** 2 / frames / each.raw_counts.shape[1]
            walks += [max(step**2 - white_part, 0.0) * 1.5 for step in steps]
    noise = max(float(np.median(noises)), MIN_NOISE_COUNTS)
    drift = float(np.sqrt(np.mean(walks))) if walks else 0.0
    return noise, max(drift, MIN_DRIFT_COUNTS)
