"""Signals of an untouched board with drift: with a baseline that follows drift, and with a fixed baseline."""

import numpy as np
import pytest

from taxel.hand import load_hand
from taxel.monitor.board_state import BoardState
from taxel.stream import TaxelFrame

UNTOUCHED_COUNTS = 4000.0
DRIFT_COUNTS = 200.0
SECONDS = 60.0
RATE_HZ = 20.0


def compute_largest_signal(is_tracked: bool) -> float:
    """Compute the last largest signal of an untouched board whose counts fall by `DRIFT_COUNTS` within a minute.

    is_tracked: whether the baseline follows drift.
    """
    board = load_hand("original").boards[0]
    rng = np.random.default_rng(1)
    n = board.kind.taxel_count
    raw, lowest = np.zeros(n, np.uint16), np.zeros(n, np.uint16)
    state = BoardState(board, slice(0, n), raw, lowest, 100, is_tracked)
    for number in range(int(SECONDS * RATE_HZ)):
        time_s = number / RATE_HZ
        # The drift begins when the first baseline of 100 frames is complete, after 5 s.
        untouched_counts = UNTOUCHED_COUNTS - DRIFT_COUNTS * max(time_s - 5.0, 0.0) / (SECONDS - 5.0)
        counts = np.round(untouched_counts + rng.normal(0.0, 1.5, n)).astype(np.uint16)
        state.take_activation(time_s)
        state.take(TaxelFrame(board.address, number, number, time_s, 0, 0, counts), time_s, threshold=150.0)
    activation = state.take_activation(SECONDS)
    assert activation is not None
    return float(activation.signal_counts.max())


@pytest.mark.parametrize(("is_tracked", "expected_counts"), [(True, (-5.0, 20.0)), (False, (180.0, 220.0))])
def test_drift_is_a_signal_with_a_fixed_baseline_but_not_with_a_tracked_baseline(is_tracked, expected_counts):
    lowest, highest = expected_counts
    assert lowest < compute_largest_signal(is_tracked) < highest
