"""A long watch: a board that falls silent, that restarts, that stays away."""

from __future__ import annotations

import numpy as np
import pytest

from host.tests.bench.conftest import ADDRESS, faults_of, phase_of, short_plan, value_of
from taxel_tools.bench.capture import Capture
from taxel_tools.bench.phases.soak import Watch
from taxel_tools.testing.record import Outcome


def soaked(bench, faults, minutes=0.4):
    """Watch a board to which something happens: {share of the watch: fault}."""
    bench.station.draws = True
    waiting = dict(faults)

    def report(phase, fraction):
        for share in [share for share in waiting if phase == "soak" and fraction >= share]:
            bench.world.inject(waiting.pop(share), ADDRESS)

    record = bench.run(short_plan("soak", **{"minutes = 10": f"minutes = {minutes}"}), report)
    assert not waiting
    return record


def counts_of(record):
    return value_of(record, "soak", "silences"), value_of(record, "soak", "restarts")


def test_a_steady_board_passes(benches):
    record = soaked(benches(), {})
    assert (record.outcome, counts_of(record)) == (Outcome.PASS, (0.0, 0.0))
    assert value_of(record, "soak", "walk") < 5.0
    assert value_of(record, "soak", "noise_growth") < 1.5
    assert value_of(record, "soak", "missed_scans") < 50
    assert [one.name for one in phase_of(record, "soak").attachments] == ["soak.png"]


@pytest.mark.parametrize("wire", ["hub", "i2c"])
def test_a_restart_is_counted_and_named(benches, wire):
    record = soaked(benches(wire=wire), {0.4: "restart"})
    assert counts_of(record) == (0.0, 1.0)
    assert faults_of(record) == [("unsteady", "board")]
    assert "fell silent 0 times and restarted once in 0.4 minutes" in record.findings()[0].text


@pytest.mark.parametrize("wire", ["hub", "i2c"])
def test_a_board_that_goes_and_comes_back_fell_silent_once_and_restarted_once(benches, wire):
    record = soaked(benches(wire=wire), {0.3: "unplug", 0.6: "plug"})
    assert counts_of(record) == (1.0, 1.0)


def test_a_board_that_stays_away_is_named_too(benches):
    record = soaked(benches(), {0.3: "unplug"}, minutes=0.25)
    assert counts_of(record) == (1.0, 0.0)
    assert faults_of(record) == [("unsteady", "board")]
    assert "too few frames came to say more" in phase_of(record, "soak").notes


def clock_of(seconds):
    return round(seconds * 1e6) % 2**32


def test_a_clock_that_wraps_is_no_restart_and_one_that_begins_anew_is():
    watch = Watch()
    for time_s in range(0, 9000, 5):
        watch.take_clock(float(time_s), clock_of(1.02 * time_s + 4000.0))
    assert watch.restarts == 0
    watch.take_clock(9000.0, clock_of(3.0))
    watch.take_clock(9005.0, clock_of(8.0))
    assert watch.restarts == 1


def test_one_long_silence_counts_once():
    watch = Watch()
    part = Capture(np.zeros((3, 2), np.uint16), np.arange(3.0), np.arange(3.0), np.array([1, 2, 5]))
    for _ in range(4):
        watch.fell_silent()
    watch.take(10.0, part)
    watch.fell_silent()
    assert (watch.silences, watch.missed, watch.time_s) == (2, 2, [10.0])
