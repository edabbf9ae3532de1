"""The monitor with a baseline that follows drift, beside the fixed baseline."""

import numpy as np
import pytest

from taxel.hand import load_hand
from taxel.monitor.board_state import BoardState
from taxel.stream import TaxelFrame

REST_COUNTS = 4000.0
DRIFT_COUNTS = 200.0
SECONDS = 60.0
RATE_HZ = 20.0


def run_with_drift(is_tracked: bool) -> float:
    """Largest signal of an untouched board whose counts fall by `DRIFT_COUNTS` within a minute."""
    board = load_hand("original").boards[0]
    rng = np.random.default_rng(1)
    n = board.kind.taxel_count
    raw, lowest = np.zeros(n, np.uint16), np.zeros(n, np.uint16)
    state = BoardState(board, slice(0, n), raw, lowest, 100, is_tracked)
    for number in range(int(SECONDS * RATE_HZ)):
        time_s = number / RATE_HZ
        rest = REST_COUNTS - DRIFT_COUNTS * max(time_s - 5.0, 0.0) / (SECONDS - 5.0)
        counts = np.round(rest + rng.normal(0.0, 1.5, n)).astype(np.uint16)
        state.take_activation(time_s)
        state.take(TaxelFrame(board.address, number, number, time_s, 0, 0, counts), time_s, 150.0)
    found = state.take_activation(SECONDS)
    assert found is not None
    return float(found.signal_counts.max())


@pytest.mark.parametrize(("is_tracked", "limits"), [(True, (-5.0, 20.0)), (False, (180.0, 220.0))])
def test_tracked_baseline_follows_a_drift_that_the_fixed_one_shows_as_a_signal(is_tracked, limits):
    assert limits[0] < run_with_drift(is_tracked) < limits[1]
