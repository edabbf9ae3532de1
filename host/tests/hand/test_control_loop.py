"""The control loop keeps absolute deadlines and counts missed periods; tested with a simulated clock."""

import math

import pytest

from taxel.hand.control_loop import ControlLoop


class FakeTime:
    """Simulated clock that advances in sleep() and by explicit work."""

    def __init__(self, now_s: float = 0.0, oversleep_s: float = 0.0) -> None:
        """Create a clock. now_s: its first time. oversleep_s: time by which every sleep is too long."""
        self.now_s = now_s
        self.oversleep_s = oversleep_s
        self.slept_s: list[float] = []

    def clock(self) -> float:
        return self.now_s

    def sleep(self, seconds: float) -> None:
        self.slept_s.append(seconds)
        self.now_s += seconds + self.oversleep_s


def make_loop(time: FakeTime, period_s: float = 0.25) -> ControlLoop:
    return ControlLoop(period_s, time.clock, time.sleep)


def test_the_first_tick_starts_at_once_and_sets_the_schedule() -> None:
    time = FakeTime(now_s=7.0)
    assert make_loop(time).wait() == 0
    assert time.slept_s == []


def test_ticks_start_at_multiples_of_the_period_for_any_work_time() -> None:
    time = FakeTime()
    loop = make_loop(time)
    starts = []
    for work_s in (0.125, 0.0, 0.2, 0.01, 0.24):
        loop.wait()
        starts.append(time.now_s)
        time.now_s += work_s
    assert starts == pytest.approx([0.0, 0.25, 0.5, 0.75, 1.0])


def test_a_late_tick_does_not_shift_later_ticks() -> None:
    time = FakeTime(oversleep_s=0.0625)
    loop = make_loop(time)
    starts = []
    for _ in range(1000):
        loop.wait()
        starts.append(time.now_s)
    assert starts[1:] == [0.25 * k + 0.0625 for k in range(1, 1000)]
    statistics = loop.compute_statistics()
    assert (statistics.missed, statistics.periods) == (0, 1000)
    assert statistics.p50_s == statistics.max_s == 0.0625


@pytest.mark.parametrize(
    ("work_s", "next_period", "missed"), [(0.4375, 1, 0), (0.5, 2, 1), (0.5625, 2, 1), (1.3, 5, 4)]
)
def test_a_period_is_missed_if_its_tick_would_start_at_the_next_deadline_or_later(
    work_s: float, next_period: int, missed: int
) -> None:
    """The period is 0.25 s. After work of 0.4375 s, tick 1 is late, but starts before the deadline of tick 2."""
    time = FakeTime()
    loop = make_loop(time)
    loop.wait()
    time.now_s += work_s
    assert loop.wait() == next_period
    assert loop.compute_statistics().missed == missed
    assert loop.wait() == next_period + 1  # missed ticks are not executed
    assert time.now_s == 0.25 * (next_period + 1)


def test_missed_periods_count_towards_the_length_of_a_run() -> None:
    time = FakeTime()
    ticks = []

    def tick(period: int) -> None:
        """Work longer than three periods in period 2, otherwise for no time."""
        ticks.append(period)
        if period == 2:
            time.now_s += 0.8

    statistics = make_loop(time).run(tick, 8)
    # The work of period 2 ends 0.8 s after 0.5 s, in period 5: the periods 3 and 4 are missed.
    assert ticks == [0, 1, 2, 5, 6, 7]
    assert (statistics.periods, statistics.missed) == (6, 2)


def test_statistics_contain_percentiles_and_maximum_of_the_lateness() -> None:
    time = FakeTime()
    loop = make_loop(time)
    for k in range(100):
        time.oversleep_s = 0.125 if k == 50 else 0.0
        loop.wait()
    statistics = loop.compute_statistics()
    # One of 100 ticks is late by 0.125 s: the 99th percentile lies between the two largest values, 0 and 0.125 s.
    assert statistics.p50_s == 0.0
    assert 0.0 < statistics.p99_s < 0.125
    assert statistics.max_s == 0.125


def test_the_lateness_is_nan_before_the_first_tick() -> None:
    statistics = make_loop(FakeTime()).compute_statistics()
    assert (statistics.periods, statistics.missed) == (0, 0)
    assert math.isnan(statistics.p50_s)
    assert math.isnan(statistics.max_s)


def test_the_clock_is_polled_in_the_last_part_of_each_wait() -> None:
    time = FakeTime()
    reads = 0

    def clock() -> float:
        """Return the time, count the call, and let 1 ms pass."""
        nonlocal reads
        reads += 1
        time.now_s += 0.001  # every read of the clock advances the time
        return time.now_s

    loop = ControlLoop(0.25, clock, time.sleep, spin_s=0.02)
    loop.wait()
    reads = 0
    loop.wait()
    assert len(time.slept_s) == 1
    assert time.slept_s[0] == pytest.approx(0.25 - 0.02, abs=0.0025)  # a few reads of the clock
    assert reads >= 20


def test_a_sleep_that_ends_early_is_repeated() -> None:
    time = FakeTime(oversleep_s=-0.0625)

    def end_early_once(seconds: float) -> None:
        time.sleep(seconds)
        time.oversleep_s = 0.0

    loop = ControlLoop(0.25, time.clock, end_early_once)
    for _ in range(2):
        loop.wait()
    assert time.slept_s == [0.25, 0.0625]
    assert time.now_s == 0.25


@pytest.mark.parametrize("period_s", [0.0, -1.0, math.nan, math.inf])
def test_an_invalid_period_is_rejected(period_s: float) -> None:
    with pytest.raises(ValueError, match="period_s"):
        ControlLoop(period_s)
