"""Estimates for all boards of a skin from its frames."""

import os

from taxel.hand import Hand
from taxel.proximity.calibration import ProximityCalibration
from taxel.proximity.calibration_file import read_calibration
from taxel.proximity.estimate import ProximityEstimate
from taxel.proximity.estimator import BoardEstimator
from taxel.stream import TaxelFrame

HORIZON_S = 0.19
"""Time after the arrival of a frame within which a contact is predicted, seconds. At 19 frames per second, a warning 80
ms ahead requires that the contact is predicted one frame interval (54 ms) earlier. With a longer horizon, contacts are
predicted earlier, but more often also contacts that a braking target avoids."""

WARNING_PROBABILITY = 0.7
"""Probability of a contact within the horizon above which the contact is treated as predicted. With a smaller value,
contacts are predicted earlier, but more often also contacts that do not follow."""


class ProximityWatch:
    """Estimators for all boards whose kind is calibrated. The first 40 frames of each board are its baseline.

    latest: newest estimate of each board, by I2C address.
    """

    def __init__(self, hand: Hand, calibration: ProximityCalibration, horizon_s: float = HORIZON_S) -> None:
        """Create the estimators. horizon_s: time after the arrival of a frame within which a contact is predicted."""
        self._hand, self._calibration, self._horizon_s = hand, calibration, horizon_s
        self.latest: dict[int, ProximityEstimate] = {}
        self.restart_baseline()

    def restart_baseline(self) -> None:
        """Discard all estimates, and take the baseline of every board again from its next frames."""
        kinds = self._calibration.kinds
        self.estimators = {
            board.address: BoardEstimator(self._hand, board, kinds[board.kind.name], self._horizon_s)
            for board in self._hand.boards
            if board.kind.name in kinds
        }
        self.latest.clear()

    @property
    def progress(self) -> float:
        """Completed share of the baseline, 0 to 1, averaged over the boards with frames; 0 before the first frame."""
        values = [estimator.progress for estimator in self.estimators.values() if estimator.progress > 0.0]
        return sum(values) / len(values) if values else 0.0

    def take(self, frame: TaxelFrame, arrival_s: float | None = None) -> ProximityEstimate | None:
        """Process a frame; return the estimate of its board, or None for a board whose kind is not calibrated.

        arrival_s: time at which the frame arrived, on the clock of `frame.time_s`; None: at the time of the scan.
        """
        estimator = self.estimators.get(frame.address)
        if estimator is None:
            return None
        age = 0.0 if arrival_s is None else max(arrival_s - frame.time_s, 0.0)
        estimate = estimator.update(frame.time_s, frame.raw_counts, age)
        self.latest[frame.address] = estimate
        return estimate


def open_watch(path: str | os.PathLike[str], hand: Hand, horizon_s: float = HORIZON_S) -> ProximityWatch:
    """Create the estimators of a hand from a calibration file. Raises `CalibrationFileError`."""
    return ProximityWatch(hand, read_calibration(path, hand), horizon_s)
