"""The line that is kept up reading by reading is least squares over the last readings, and Theil-Sen if one is off."""

from __future__ import annotations

import random

import numpy as np
import pytest
from scipy.stats import theilslopes

from taxel.stream.board_line import SYNC_WINDOW, BoardLine

BEGIN_US = 2**50
"""A stream of 36 years: float sums would have lost the microseconds."""


def readings(count, jitter_us, seed=1):
    rng = random.Random(seed)
    hub = [BEGIN_US + 60_000 * k + rng.randrange(1000) for k in range(count)]
    return [(round(0.98 * us) + rng.randrange(-jitter_us, jitter_us + 1), us) for us in hub]


@pytest.mark.parametrize("count", [2, SYNC_WINDOW, 5 * SYNC_WINDOW])
def test_it_is_least_squares_over_the_last_readings(count):
    line, taken = BoardLine(), readings(count, 100)
    for board_us, hub_us in taken:
        line.add(board_us, hub_us)
    assert len(line) == min(count, SYNC_WINDOW)
    since = np.array(taken[-SYNC_WINDOW:]) - taken[-1]
    slope, offset = np.polyfit(since[:, 0], since[:, 1], 1)
    assert line.fit() == pytest.approx((offset, slope), rel=1e-9, abs=1e-6)


def test_a_damaged_reading_is_outvoted_as_long_as_it_is_in_the_window():
    line, taken = BoardLine(), readings(2 * SYNC_WINDOW, 2)
    taken[20] = taken[20][0] ^ 512, taken[20][1]
    for place, (board_us, hub_us) in enumerate(taken):
        line.add(board_us, hub_us)
        if place == 30:
            since = np.array(taken[:31]) - taken[30]
            slope, offset, _, _ = theilslopes(since[:, 1], since[:, 0])
            assert line.fit() == pytest.approx((offset, slope), rel=1e-12)
    offset, slope = line.fit()
    assert abs(offset) < 5.0
    assert slope == pytest.approx(1.0 / 0.98, rel=1e-5)


def test_readings_of_one_microsecond_make_no_line():
    line = BoardLine()
    line.add(5, 7)
    assert line.fit() is None
    line.add(5, 8)
    assert line.fit() is None
