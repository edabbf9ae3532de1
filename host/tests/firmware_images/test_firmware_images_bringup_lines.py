"""Bring-up with a scripted board: exceptions, noise on the wire and damaged lines give findings, not failures."""

import pytest

from taxel_tools.bringup.findings import DIFFERS, NOT_MEASURED, list_findings
from taxel_tools.bringup.measuring import ECHO, measure

START = "taxel-bringup version=1 causes=00 watchdog=0 stay=0 record=0 id=0102030405060708"
ANSWERS = {
    "e": [(0.0, f"echo bytes={ECHO.hex()}"), (0.0, "done")],
    "t": [*((0.2, f"tick n={number}") for number in range(21)), (0.0, "done")],
    "i": [(0.0, "interrupts scb0=10 scb1=11 csd=15"), (0.0, "converter sample_clock=5 cycles=16064"), (0.0, "done")],
    "b": [(0.0, "bus idle=3 scl_low=2 sda_low=1 acks=0 nacks=112 failed=0 first=0"), (0.0, "done")],
    "f": [(0.0, "flash row=255 wrong=0 stack=256"), (0.0, "done")],
    "c": [
        *((0.0, f"count capacitors=1 code={code} count={14520 // code}") for code in (4, 8, 16, 32, 64)),
        (0.0, "repeats capacitors=1 sense_clock=4 low=907 high=909"),
        (0.0, "repeats capacitors=2 sense_clock=255 low=0 high=0"),
        (0.0, "done"),
    ],
    "m": [(0.1, START.replace("causes=00", "causes=10").replace("stay=0 record=0", "stay=1 record=1"))],
    "w": [(0.2, "watchdog waits"), (2.0, START.replace("causes=00", "causes=01"))],
}


class ScriptedBoard:
    """Answers each command with lines after the stated delays, seconds."""

    name = "scripted board"

    def __init__(self, answers):
        self._answers, self._time_s = answers, 0.0
        self._queue = [(0.0, START + "\n")]

    def now_s(self):
        return self._time_s

    def write(self, data):
        """Queue the answer to a command; bytes that are no command have no answer."""
        time_s = self._time_s
        for delay_s, line in self._answers.get(chr(data[0]), []) if len(data) == 1 else []:
            time_s += delay_s
            self._queue.append((time_s, line + "\r\n"))

    def read(self, timeout_s):
        """Return the next line that is due within `timeout_s`; otherwise let this time pass and return b""."""
        if self._queue and self._queue[0][0] <= self._time_s + timeout_s:
            time_s, line = self._queue.pop(0)
            self._time_s = max(self._time_s, time_s)
            return line.encode("latin-1")
        self._time_s += max(timeout_s, 1e-3)
        return b""

    def close(self):
        """Do nothing, as there is nothing to close."""


def find_with(**changed):
    """Run the tests on a board with some changed answers; return the measurements and the findings.

    changed: answers by command, as in `ANSWERS`.
    """
    results = measure(ScriptedBoard(ANSWERS | changed))
    return results, list_findings(results, 2.2)


def list_differing(findings):
    return [(each.step, each.point) for each in findings if each.status == DIFFERS]


def test_the_scripted_board_has_no_deviation():
    assert list_differing(find_with()[1]) == []


def test_an_exception_ends_the_tests_and_names_its_step():
    """During the command f, the test of the flash row, the board reports an exception and starts again."""
    results, findings = find_with(f=[(0.0, "fault exception=2 pc=00000abc"), (0.1, START)])
    assert (results.ended_by.name, results.restart) == ("flash row", None)
    assert list_differing(findings) == [(7, "exceptions during the test of the flash row")]
    assert next(each for each in findings if each.status == DIFFERS).measured == "exception 2 at 0x00000abc"


def test_an_exception_hides_no_earlier_deviation():
    wrong = [(0.0, ANSWERS["i"][0][1].replace("csd=15", "csd=14")), *ANSWERS["i"][1:]]
    _, findings = find_with(i=wrong, f=[(0.0, "fault exception=3 pc=00000abc"), (0.1, START)])
    assert [step for step, _ in list_differing(findings)] == [4, 7]


def test_an_exception_during_the_watchdog_test_is_named():
    _, findings = find_with(w=[(0.0, "fault exception=3 pc=00000abc"), (0.1, START)])
    assert list_differing(findings) == [(9, "exceptions during the test of the watchdog")]


def test_noise_before_the_start_line_does_not_hide_a_watchdog_reset():
    _, findings = find_with(w=[(0.2, "watchdog waits"), (2.0, "\x00\xff"), (0.01, ANSWERS["w"][-1][1])])
    assert list_differing(findings) == []


def test_a_watchdog_that_does_not_reset_is_reported():
    _, findings = find_with(w=[(0.2, "watchdog waits"), (8.0, "watchdog none"), (0.0, "done")])
    assert list_differing(findings) == [(9, "watchdog")]


@pytest.mark.parametrize(
    ("command", "line", "point"),
    [
        ("e", "echo bytes=0q", "UART: received bytes"),
        ("f", "flash row=255 wr\x80ng=0", "flash row"),
        ("b", "bus idle=?", "I2C bus"),
        ("i", "interrupts scb0=1\xff scb1=11 csd=15", "interrupt of SCB0"),
    ],
)
def test_a_damaged_line_is_no_measured_value(command, line, point):
    _, findings = find_with(**{command: [(0.0, line), (0.0, "done")]})
    finding = next(each for each in findings if each.point == point)
    assert finding.status in (NOT_MEASURED, DIFFERS)


def test_a_board_that_receives_nothing_ends_the_tests():
    results, findings = find_with(e=[(0.0, "ready"), *[(2.0, "ready")] * 50])
    assert results.echo == b""
    assert list_differing(findings) == [(3, "UART: received bytes")]
