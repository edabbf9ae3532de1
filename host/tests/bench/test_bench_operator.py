"""The operator's way: somebody presses what the prompts say, here a finger in the emulated world."""

from __future__ import annotations

import re

import pytest

from host.tests.bench.conftest import ADDRESS, faults_of, phase_of, short_plan, value_of
from taxel_tools.bench.probe import ManualProbe
from taxel_tools.testing.operator import NoOperator, ScriptedOperator
from taxel_tools.testing.record import Outcome

BOARD = f"board=0x{ADDRESS:02X}"
PRESS = re.compile(
    r"(once more: )?press taxel (\d+) \(TX \d+, RX \d+\) with the ([\d.]+) mm probe at ([\d.]+) N and hold"
)


class Person:
    """Does as the prompts say, and slips on some taxels the first time."""

    def __init__(self, bench, slips=()):
        self.finger = bench.finger
        self.slips = set(slips)
        self.asked = []
        self.operator = ScriptedOperator([], self)
        bench.station.probe = ManualProbe(bench.station.kind, self.operator)

    def __call__(self, text):
        if text == "let go":
            self.finger.release()
            return
        again, taxel, diameter_mm, force_n = PRESS.match(text).groups()
        self.asked.append((bool(again), int(taxel), float(force_n)))
        at = int(taxel)
        if at in self.slips:
            self.slips.remove(at)
            at -= 1
        self.finger.press(at, float(force_n), float(diameter_mm) * 1e-3)


def test_every_taxel_is_asked_for_once_and_ticked_off(benches):
    bench = benches()
    person = Person(bench)
    record = bench.run(short_plan("presses"))
    assert (record.outcome, faults_of(record)) == (Outcome.PASS, [])
    assert person.asked == [(False, taxel, 1.0) for taxel in range(27)]
    assert person.operator.heard.count("let go") == 27
    assert "response" not in {one.name for one in phase_of(record, "presses").measurements}  # nobody knows the force


def test_a_slip_of_the_finger_is_asked_for_again_and_is_no_fault(benches):
    bench = benches()
    person = Person(bench, slips={5, 20})
    record = bench.run(short_plan("presses"))
    assert (record.outcome, faults_of(record)) == (Outcome.PASS, [])
    assert [taxel for again, taxel, _ in person.asked if again] == [5, 20]


@pytest.mark.parametrize(
    ("effect", "fault", "again"),
    [
        (f"exchange lines {BOARD} axis=0 index=3 other=4", ("swapped lines", "TX 3 and TX 4"), 8),
        (f"dead rest {BOARD} taxel=7", ("dead taxel", "taxel 7"), 1),
    ],
)
def test_what_does_not_answer_is_asked_for_twice_and_named(benches, effect, fault, again):
    bench = benches(f"effect {effect}", wire="i2c")
    person = Person(bench)
    assert faults_of(bench.run(short_plan("presses"))) == [fault]
    assert sum(repeated for repeated, _, _ in person.asked) <= again


def test_a_loading_curve_can_be_pressed_by_hand(benches):
    bench = benches()
    person = Person(bench)
    record = bench.run(short_plan("loading"))
    assert record.outcome is Outcome.PASS
    assert value_of(record, "loading", "fall") == pytest.approx(0.66, abs=0.03)
    forces = [force for _, _, force in person.asked]
    assert forces == pytest.approx(2 * [3.125, 12.5, 28.1, 50.0, 28.1, 12.5, 3.12], rel=0.01)
    assert person.operator.heard.count("let go") == 2


def test_forces_that_no_hand_can_set_are_left_out(benches):
    bench = benches()
    Person(bench)
    record = bench.run(short_plan("small_forces"))
    assert phase_of(record, "small_forces").notes == ["cannot run here: forces this small cannot be set by hand"]


def test_without_anybody_the_phase_says_what_was_asked(benches):
    bench = benches()
    bench.station.probe = ManualProbe(bench.station.kind, NoOperator())
    record = bench.run(short_plan("presses"))
    assert record.outcome is Outcome.ERROR
    assert phase_of(record, "presses").problem.startswith("nobody is there to answer 'press taxel 0 (TX 0, RX ")


def test_the_finger_lets_go_when_a_test_is_stopped(benches):
    bench = benches()
    person = Person(bench)

    def stop(phase, fraction):
        if phase == "presses" and len(person.asked) > 3:
            bench.station.probe.press(3, 2.0, 3e-3)
            raise KeyboardInterrupt

    record = bench.run(short_plan("presses"), stop)
    assert phase_of(record, "presses").problem == "stopped from the keyboard"
    assert phase_of(record, "faults").outcome is Outcome.SKIP
    assert person.operator.heard[-1] == "let go"
