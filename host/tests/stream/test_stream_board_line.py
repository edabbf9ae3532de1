"""The incremental line equals least squares over the latest readings, and Theil-Sen if a reading is an outlier."""

import random

import numpy as np
import pytest
from scipy.stats import theilslopes

from taxel.stream.board_line import SYNC_WINDOW, BoardLine

BEGIN_US = 2**50
"""Start of the readings after 36 years; sums of floats would lose the microseconds."""


def make_readings(count, jitter_us, seed=1):
    """Make (board time, hub time) readings in microseconds, 60 ms apart.

    The board's clock runs at 0.98 of the hub's rate. jitter_us: largest error of a board time.
    """
    rng = random.Random(seed)
    hub = [BEGIN_US + 60_000 * k + rng.randrange(1000) for k in range(count)]
    return [(round(0.98 * us) + rng.randrange(-jitter_us, jitter_us + 1), us) for us in hub]


@pytest.mark.parametrize("count", [2, SYNC_WINDOW, 5 * SYNC_WINDOW])
def test_the_line_is_the_least_squares_fit_of_the_latest_readings(count):
    line, readings = BoardLine(), make_readings(count, 100)
    for board_us, hub_us in readings:
        line.add(board_us, hub_us)
    assert len(line) == min(count, SYNC_WINDOW)
    relative = np.array(readings[-SYNC_WINDOW:]) - readings[-1]
    slope, offset = np.polyfit(relative[:, 0], relative[:, 1], 1)
    assert line.fit() == pytest.approx((offset, slope), rel=1e-9, abs=1e-6)


def test_a_damaged_reading_does_not_change_the_line():
    line, readings = BoardLine(), make_readings(2 * SYNC_WINDOW, 2)
    readings[20] = readings[20][0] ^ 512, readings[20][1]  # one flipped bit: the board time is wrong by 512 us
    for index, (board_us, hub_us) in enumerate(readings):
        line.add(board_us, hub_us)
        if index == 30:  # the damaged reading is among the latest ones: the robust Theil-Sen line is used
            relative = np.array(readings[:31]) - readings[30]
            slope, offset, _, _ = theilslopes(relative[:, 1], relative[:, 0])
            assert line.fit() == pytest.approx((offset, slope), rel=1e-12)
    offset, slope = line.fit()
    assert abs(offset) < 5.0
    assert slope == pytest.approx(1.0 / 0.98, rel=1e-5)  # hub time per board time; the board runs at 0.98


def test_readings_with_the_same_board_time_give_no_line():
    line = BoardLine()
    line.add(5, 7)
    assert line.fit() is None
    line.add(5, 8)
    assert line.fit() is None
