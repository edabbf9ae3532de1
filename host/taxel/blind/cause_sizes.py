"""Size of a hidden cause: the gap that the cause alone produces, in floors."""

from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from taxel.gap.comparison.evidence import SMALLEST_FLOOR
from taxel.gap.data.pair import read_pair
from taxel.gap.data.prepare import prepare_pair
from taxel.gap.data.simulator_faults import SimulatorFault
from taxel.gap.features.metric import compute_gap_of_change, measure_gap
from taxel.gap.fitting.fit_data import FitData
from taxel.types import FloatArray


class CauseSizes:
    """Gaps of causes, measured with one simulated dataset.

    The simulated dataset is examined for faulty grasps once, and each dataset without a cause is read once, because
    both take longer than the rest of a measurement.
    """

    def __init__(self, sim: Path) -> None:
        """Prepare the measurement of the gaps that causes produce.

        sim: simulated dataset, with which each measured dataset is paired; it has the same taxels and conditions.
        """
        self._sim = sim
        # Faulty grasps of the simulated dataset: found by the first measurement, and reused by all others.
        self._faults: tuple[SimulatorFault, ...] | None = None
        # Datasets without a cause that have already been read, by path.
        self._without: dict[Path, FitData] = {}

    def measure(self, real: Path, without: Path) -> float:
        """Measure the gap between the same grasps with and without a cause, in floors of the dataset with the cause.

        real: dataset with all sessions and the cause. without: its first session without the cause, with equal random
        numbers otherwise. Raises DatasetError and GapInputError.
        """
        with_cause, change = self._read_change(real, without)
        floor = measure_gap(with_cause.sessions, with_cause.state.mean, with_cause.layout).floor
        return compute_gap_of_change(change, with_cause.layout) / floor

    def estimate(self, first: Path, without: Path, sessions: int, repeats: int) -> float:
        """Estimate the gap between the same grasps with and without a cause, in expected floors, from one session.

        first: grasps of one session with the cause. without: the same grasps without the cause, with equal random
        numbers otherwise. repeats: number of simulated grasps of each condition. The expected floor of a dataset with
        `sessions` grasps of each condition follows from the variance of the simulated means (`State.mean_variance`).
        Raises DatasetError and GapInputError.
        """
        with_cause, change = self._read_change(first, without)
        variance = with_cause.state.mean_variance
        assert variance is not None
        expected = np.sqrt(np.nan_to_num(variance) * repeats / sessions)
        floor = max(compute_gap_of_change(expected, with_cause.layout), SMALLEST_FLOOR)
        return compute_gap_of_change(change, with_cause.layout) / floor

    def _read_change(self, path: Path, without: Path) -> tuple[FitData, FloatArray]:
        """Return a dataset with a cause, and the change of its features by the cause in the first session, f64[C, F, n]
        (C conditions, F features, n taxels), counts; 0 where unknown.
        """
        with threadpool_limits(limits=1):
            if without not in self._without:
                self._without[without] = self._read(without)
            with_cause = self._read(path)
        reference = self._without[without].sessions.value[:, 0]
        return with_cause, np.nan_to_num(with_cause.sessions.value[:, 0] - reference)

    def _read(self, path: Path) -> FitData:
        """Read a dataset of the hand together with the simulated dataset."""
        pair = read_pair(path, self._sim, faults=self._faults)
        self._faults = pair.faults
        return prepare_pair(pair)
