"""Soak: interruptions and restarts of a board."""

import numpy as np
import pytest

from host.tests.bench.conftest import ADDRESS, find_phase, find_value, list_faults, make_short_plan
from taxel_tools.bench.capture import Capture
from taxel_tools.bench.phases.soak import SoakLog
from taxel_tools.testing.record import Outcome


def run_soak(bench, faults, minutes=0.4):
    """Run a soak during which faults are injected, and return its record.

    faults: name of a fault of the emulator, by the fraction of the soak at which it is injected.
    """
    bench.board.draws_pictures = True
    pending = dict(faults)

    def report(phase, fraction):
        """Inject each fault once its fraction of the soak has elapsed."""
        for share in [share for share in pending if phase == "soak" and fraction >= share]:
            bench.world.inject(pending.pop(share), ADDRESS)

    record = bench.run(make_short_plan("soak", **{"minutes = 10": f"minutes = {minutes}"}), report)
    assert not pending
    return record


def list_counts(record):
    """Return the counts that a soak has measured: (silences, restarts)."""
    return find_value(record, "soak", "silences"), find_value(record, "soak", "restarts")


def test_a_healthy_board_passes_a_soak(benches):
    record = run_soak(benches(), {})
    assert (record.outcome, list_counts(record)) == (Outcome.PASS, (0.0, 0.0))
    assert find_value(record, "soak", "walk") < 5.0
    assert find_value(record, "soak", "noise_growth") < 1.5
    assert find_value(record, "soak", "missed_scans") < 50
    assert [attachment.name for attachment in find_phase(record, "soak").attachments] == ["soak.png"]


@pytest.mark.parametrize("wire", ["hub", "i2c"])
def test_a_restart_is_counted_and_reported(benches, wire):
    """The board restarts after 40 % of the soak. `list_counts`: number of silences, number of restarts."""
    record = run_soak(benches(wire=wire), {0.4: "restart"})
    assert list_counts(record) == (0.0, 1.0)
    assert list_faults(record) == [("unsteady", "board")]
    assert "stopped responding 0 times and restarted once in 0.4 minutes" in record.findings()[0].text


@pytest.mark.parametrize("wire", ["hub", "i2c"])
def test_a_replugged_board_counts_as_one_silence_and_one_restart(benches, wire):
    record = run_soak(benches(wire=wire), {0.3: "unplug", 0.6: "plug"})
    assert list_counts(record) == (1.0, 1.0)


def test_a_board_that_stays_unplugged_is_reported(benches):
    """The board is unplugged after 30 % of the soak. `list_counts`: number of silences, number of restarts."""
    record = run_soak(benches(), {0.3: "unplug"}, minutes=0.25)
    assert list_counts(record) == (1.0, 0.0)
    assert list_faults(record) == [("unsteady", "board")]
    assert "too few frames for the other measurements" in find_phase(record, "soak").notes


def make_clock(seconds):
    """Compute the value of the board's 32-bit microsecond clock, which wraps after 4295 s."""
    return round(seconds * 1e6) % 2**32


def test_a_clock_wrap_is_not_a_restart():
    """The board's 32-bit clock, in microseconds, wraps every 4295 s; it is 2 % faster than the host's clock."""
    soak_log = SoakLog()
    for time_s in range(0, 9000, 5):
        soak_log.add_clock(float(time_s), make_clock(1.02 * time_s + 4000.0))
    assert soak_log.restarts == 0


def test_a_clock_that_begins_again_is_one_restart():
    soak_log = SoakLog()
    for time_s, clock_s in ((8995.0, 4000.0), (9000.0, 3.0), (9005.0, 8.0)):
        soak_log.add_clock(time_s, make_clock(clock_s))
    assert soak_log.restarts == 1


def make_capture(sequence):
    """Create a capture with the given sequence numbers, one frame per second, counts 0 on two taxels."""
    frames, times = len(sequence), np.arange(float(len(sequence)))
    return Capture(np.zeros((frames, 2), np.uint16), times, times, np.array(sequence))


def test_successive_silences_count_once_until_frames_arrive():
    soak_log = SoakLog()
    for _ in range(4):
        soak_log.add_silence()
    assert soak_log.silences == 1
    soak_log.add_part(10.0, make_capture(sequence=[1, 2, 3]))
    soak_log.add_silence()
    assert soak_log.silences == 2


def test_the_missed_scans_of_a_part_are_counted():
    soak_log = SoakLog()
    soak_log.add_part(10.0, make_capture(sequence=[1, 2, 5]))
    assert soak_log.missed_scans == 2
