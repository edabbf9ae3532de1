"""Size of a hidden cause: the gap that the cause alone produces, in floors."""

from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from taxel.gap.comparison.evidence import SMALLEST_FLOOR
from taxel.gap.data.pair import read_pair
from taxel.gap.data.prepare import prepare_pair
from taxel.gap.features.metric import compute_gap_of_change, measure_gap
from taxel.gap.fitting.fit_data import FitData
from taxel.types import FloatArray


def measure_change(real: Path, without: Path, sim: Path) -> float:
    """Measure the gap between the same grasps with and without a cause, in floors of the dataset with the cause.

    real: dataset with all sessions and the cause. without: its first session without the cause, with equal random
    numbers otherwise. sim: simulated dataset, whose taxels and conditions both have. Raises DatasetError and
    GapInputError.
    """
    with_cause, change = _read_change(real, without, sim)
    floor = measure_gap(with_cause.sessions, with_cause.state.mean, with_cause.layout).floor
    return compute_gap_of_change(change, with_cause.layout) / floor


def estimate_change(first: Path, without: Path, sim: Path, sessions: int, repeats: int) -> float:
    """Estimate the gap between the same grasps with and without a cause, in expected floors, from one session.

    first: grasps of one session with the cause. without: the same grasps without the cause, with equal random numbers
    otherwise. sim: simulated dataset with `repeats` grasps of each condition. The expected floor of a dataset with
    `sessions` grasps of each condition follows from the variance of the simulated means (`State.mean_variance`).
    Raises DatasetError and GapInputError.
    """
    with_cause, change = _read_change(first, without, sim)
    variance = with_cause.state.mean_variance
    assert variance is not None
    expected = np.sqrt(np.nan_to_num(variance) * repeats / sessions)
    floor = max(compute_gap_of_change(expected, with_cause.layout), SMALLEST_FLOOR)
    return compute_gap_of_change(change, with_cause.layout) / floor


def _read_change(path: Path, without: Path, sim: Path) -> tuple[FitData, FloatArray]:
    """Return a dataset with a cause, and the change of its features by the cause in the first session, f64[C, F, n]
    (C conditions, F features, n taxels), counts; 0 where unknown.
    """
    with threadpool_limits(limits=1):
        with_cause, without_cause = (prepare_pair(read_pair(one, sim)) for one in (path, without))
    return with_cause, np.nan_to_num(with_cause.sessions.value[:, 0] - without_cause.sessions.value[:, 0])
