"""Manual probe: an operator follows the instructions, here with a probe in the emulated world."""

import re

import pytest

from host.tests.bench.conftest import ADDRESS, find_phase, find_value, list_faults, make_short_plan
from host.tests.scripted_operator import ScriptedOperator
from taxel_tools.bench.probe import ManualProbe
from taxel_tools.testing.operator import NoOperator
from taxel_tools.testing.record import Outcome

BOARD = f"board=0x{ADDRESS:02X}"
INDENTATION = re.compile(
    r"(once more: )?press taxel (\d+) \(TX \d+, RX \d+\) with the ([\d.]+) mm probe at ([\d.]+) N and hold"
)


class FollowingOperator:
    """Follows the instructions, and misses some taxels at the first attempt."""

    def __init__(self, bench, missed_taxels=()):
        self.probe = bench.emulated_probe
        self.missed_taxels = set(missed_taxels)
        self.requests = []
        self.operator = ScriptedOperator([], self)
        bench.board.probe = ManualProbe(bench.board.kind, self.operator)

    def __call__(self, text):
        """Carry out an instruction; the first request of a missed taxel indents the previous taxel instead."""
        if text == "release the probe":
            self.probe.release()
            return
        repetition, taxel, diameter_mm, force_n = INDENTATION.match(text).groups()
        self.requests.append((bool(repetition), int(taxel), float(force_n)))
        pressed_taxel = int(taxel)
        if pressed_taxel in self.missed_taxels:
            self.missed_taxels.remove(pressed_taxel)
            pressed_taxel -= 1
        self.probe.press(pressed_taxel, float(force_n), float(diameter_mm) * 1e-3)


def test_each_taxel_is_requested_once(benches):
    """The force of an operator is not known accurately, so the response at 1 N is not a measurement of the record."""
    bench = benches()
    operator = FollowingOperator(bench)
    record = bench.run(make_short_plan("presses"))
    assert (record.outcome, list_faults(record)) == (Outcome.PASS, [])
    # Each request: whether it is a repetition, the taxel, the force in newtons.
    assert operator.requests == [(False, taxel, 1.0) for taxel in range(27)]
    assert operator.operator.texts.count("release the probe") == 27
    assert "response" not in {measurement.name for measurement in find_phase(record, "presses").measurements}


def test_a_missed_taxel_is_requested_again_and_is_not_a_fault(benches):
    bench = benches()
    operator = FollowingOperator(bench, missed_taxels={5, 20})
    record = bench.run(make_short_plan("presses"))
    assert (record.outcome, list_faults(record)) == (Outcome.PASS, [])
    assert [taxel for repetition, taxel, _ in operator.requests if repetition] == [5, 20]


@pytest.mark.parametrize(
    ("effect", "fault", "repetitions_max"),
    [
        # TX 3 and TX 4 have four taxels each, and all eight may be requested twice.
        (f"exchange lines {BOARD} axis=0 index=3 other=4", ("swapped lines", "TX 3 and TX 4"), 8),
        (f"dead rest {BOARD} taxel=7", ("dead taxel", "taxel 7"), 1),
    ],
)
def test_a_taxel_without_response_is_requested_twice_and_reported(benches, effect, fault, repetitions_max):
    bench = benches(f"effect {effect}", wire="i2c")
    operator = FollowingOperator(bench)
    assert list_faults(bench.run(make_short_plan("presses"))) == [fault]
    assert sum(repetition for repetition, _, _ in operator.requests) <= repetitions_max


def test_a_loading_curve_can_be_recorded_manually(benches):
    bench = benches()
    operator = FollowingOperator(bench)
    record = bench.run(make_short_plan("loading"))
    assert record.outcome is Outcome.PASS
    # `fall`: share of the count at rest by which the largest force lowers the count.
    assert find_value(record, "loading", "fall") == pytest.approx(0.66, abs=0.03)
    # Two taxels are loaded and unloaded in 4 steps. Step k has the force 50 N * (k / 4)^2.
    forces = [force for _, _, force in operator.requests]
    assert forces == pytest.approx(2 * [3.125, 12.5, 28.1, 50.0, 28.1, 12.5, 3.12], rel=0.01)
    assert operator.operator.texts.count("release the probe") == 2


def test_forces_too_small_for_an_operator_are_skipped(benches):
    bench = benches()
    FollowingOperator(bench)
    record = bench.run(make_short_plan("small_forces"))
    assert find_phase(record, "small_forces").notes == ["cannot run: an operator cannot set forces this small"]


def test_without_an_operator_the_error_contains_the_instruction(benches):
    bench = benches()
    bench.board.probe = ManualProbe(bench.board.kind, NoOperator())
    record = bench.run(make_short_plan("presses"))
    assert record.outcome is Outcome.ERROR
    assert find_phase(record, "presses").problem.startswith("no operator to answer 'press taxel 0 (TX 0, RX ")


def test_the_operator_is_instructed_to_release_when_a_test_is_stopped(benches):
    bench = benches()
    operator = FollowingOperator(bench)

    def stop(phase, fraction):
        if phase == "presses" and len(operator.requests) > 3:
            bench.board.probe.press(3, 2.0, 3e-3)
            raise KeyboardInterrupt

    record = bench.run(make_short_plan("presses"), stop)
    assert find_phase(record, "presses").problem == "stopped from the keyboard"
    assert find_phase(record, "faults").outcome is Outcome.SKIP
    assert operator.operator.texts[-1] == "release the probe"
