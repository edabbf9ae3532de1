"""A gantry that speaks G-code, here a program behind a pseudo-terminal that presses an emulated board."""

from __future__ import annotations

import numpy as np
import pytest

from host.tests.bench.conftest import ADDRESS, faults_of, phase_of, short_plan, value_of
from host.tests.bench.fake_gantry import PITCH_MM, SPRING, TOUCH_Z, FakeGantry, PtyGantry, X, Y, pressing
from taxel.hand import load_hand
from taxel_tools.bench.probe import ProbeError, gcode
from taxel_tools.bench.probe.gcode import open_gcode
from taxel_tools.testing.operator import NoOperator, ScriptedOperator
from taxel_tools.testing.record import Outcome

KIND = load_hand("allegro").board(ADDRESS).kind


@pytest.fixture
def gantries(monkeypatch):
    """Gantries whose port is an object: they answer at once, or never."""
    opened = {}

    def make(**options):
        gantry = FakeGantry(**options)
        gantry.port = f"/dev/ttyFAKE{len(opened)}"
        opened[gantry.port] = gantry
        return gantry

    monkeypatch.setattr(gcode.serial, "Serial", lambda port, baud, timeout: opened[port])
    return make


@pytest.fixture
def behind_a_pty():
    """Gantries that pyserial opens."""
    opened = []

    def make(**options):
        opened.append(PtyGantry(**options))
        return opened[-1]

    yield make
    for one in opened:
        one.close()


def url_of(gantry, **options):
    values = {"x": X, "y": Y, "touch_z": TOUCH_Z, "spring_n_mm": SPRING, "tip": 3} | options
    return f"gcode://{gantry.port}?" + "&".join(f"{name}={value}" for name, value in values.items())


def probe_of(gantry, operator=None, **options):
    """A probe on a gantry, over the smallest board."""
    return open_gcode(url_of(gantry, **options), KIND, PITCH_MM * 1e-3, operator or NoOperator())


def test_a_board_is_pressed_from_end_to_end(benches, behind_a_pty):
    bench = benches()
    gantry = behind_a_pty(on_press=pressing(bench.station.kind, bench.finger))
    bench.station.probe = open_gcode(url_of(gantry), bench.station.kind, PITCH_MM * 1e-3, NoOperator())
    record = bench.run(short_plan("presses"))
    bench.station.probe.close()
    assert (record.outcome, faults_of(record)) == (Outcome.PASS, [])
    assert value_of(record, "presses", "response") == pytest.approx(730.0, rel=0.15)
    assert gantry.deepest == pytest.approx(TOUCH_Z - 1.0 / SPRING)
    assert gantry.at["Z"] > TOUCH_Z


def test_lines_are_those_of_a_gantry_with_a_spring(gantries):
    gantry = gantries()
    probe = probe_of(gantry)
    taxel = np.flatnonzero((KIND.tx == 3) & (KIND.rx == 2))[0]
    probe.press(taxel, 2.0, 3e-3)
    probe.press(taxel, 4.0, 3e-3)
    probe.release()
    assert gantry.lines == [
        "G21",
        "G90",
        "G0 Z7.000",
        "G4 P0",
        "G0 Z7.000",
        "G4 P0",
        "G0 X25.000 Y30.000",
        "G1 Z1.800 F120",
        "G4 P0",
        "G1 Z1.600 F120",
        "G4 P0",
        "G0 Z7.000",
        "G4 P0",
    ]


def test_it_never_presses_harder_than_is_allowed(gantries):
    gantry = gantries()
    probe = probe_of(gantry, travel=4)
    for force, words in (
        (61.0, "expected a force from 0 to 60 N, found 61"),
        (-1.0, "found -1"),
        (50.0, "it gives 4 mm"),
    ):
        with pytest.raises(ProbeError, match=words):
            probe.press(0, force, 3e-3)
    with pytest.raises(ProbeError, match="found nan"):
        probe.press(0, float("nan"), 3e-3)
    assert gantry.deepest > TOUCH_Z
    probe.press(0, 40.0, 3e-3)
    assert gantry.deepest == pytest.approx(TOUCH_Z - 4.0)


def test_another_tip_is_asked_for_and_the_gantry_waits_clear_of_the_board(gantries):
    gantry = gantries()
    heights = []
    operator = ScriptedOperator([], lambda text: heights.append(gantry.at["Z"]))
    probe = probe_of(gantry, operator)
    probe.press(0, 1.0, 3e-3)
    assert operator.heard == []
    probe.press(0, 1.0, 12e-3)
    probe.press(1, 1.0, 12e-3)
    assert operator.heard == ["put the 12 mm tip into the gantry's holder"]
    assert heights == [TOUCH_Z + 5.0]


def test_a_tip_that_nobody_can_change_is_an_error_of_the_phase(benches, gantries):
    bench = benches()
    gantry = gantries()
    bench.station.probe = open_gcode(url_of(gantry), bench.station.kind, PITCH_MM * 1e-3, NoOperator())
    record = bench.run(short_plan("loading"))
    expected = "nobody is there to answer 'put the 12 mm tip into the gantry's holder'"
    assert phase_of(record, "loading").problem.startswith(expected)


def test_a_controller_that_restarts_when_its_port_is_opened_is_waited_for(behind_a_pty, monkeypatch):
    monkeypatch.setattr(gcode, "WAKE_S", 0.2)
    monkeypatch.setattr(gcode, "WAKE_ATTEMPTS", 100)
    gantry = behind_a_pty(greeting=b"\r\nGrbl 1.1h ['$' for help]\r\n", deaf_lines=2)
    probe_of(gantry).press(0, 1.0, 3e-3)
    assert gantry.lines[-1] == "G4 P0"
    assert gantry.at["Z"] == pytest.approx(TOUCH_Z - 0.1)


def test_remarks_and_long_answers_are_passed_over(gantries):
    gantry = gantries()
    gantry.answer = lambda line: b"echo:busy: processing\r\nok P15 B3\r\n"
    probe = probe_of(gantry)
    probe.press(0, 1.0, 3e-3)
    probe.release()
    assert gantry.lines[-2:] == ["G0 Z7.000", "G4 P0"]


def test_a_port_that_says_nothing_is_one_line(behind_a_pty, monkeypatch):
    monkeypatch.setattr(gcode, "WAKE_S", 0.05)
    gantry = behind_a_pty(deaf_lines=10**6)
    with pytest.raises(ProbeError, match=r"no answer to 'G21' in 0\.3 s; is this the gantry's port\?"):
        probe_of(gantry)


def test_a_locked_controller_is_one_line(gantries):
    gantry = gantries()
    gantry.answer = lambda line: b"error:9\r\n"
    with pytest.raises(ProbeError, match="answered 'error:9' to 'G21'; home it, and clear its way"):
        probe_of(gantry)


@pytest.mark.parametrize("answer", [b"error:20\r\n", b"ALARM:1\r\n", b""])
def test_a_gantry_that_fails_half_way_is_lifted_and_moves_no_more(gantries, answer):
    gantry = gantries()
    probe = probe_of(gantry)
    probe.press(0, 1.0, 3e-3)
    gantry.answer = lambda line: answer if line.startswith("G1") else b"ok\r\n"
    with pytest.raises(ProbeError, match="G1 Z"):
        probe.press(0, 2.0, 3e-3)
    assert gantry.at["Z"] > TOUCH_Z
    said = len(gantry.lines)
    with pytest.raises(ProbeError, match="G1 Z"):
        probe.press(1, 1.0, 3e-3)
    probe.release()
    probe.close()
    probe.close()
    assert len(gantry.lines) == said


def test_a_failing_gantry_is_an_error_of_the_phase_and_the_record_stays(benches, gantries):
    bench = benches()
    gantry = gantries(on_press=pressing(bench.station.kind, bench.finger))
    bench.station.probe = open_gcode(url_of(gantry), bench.station.kind, PITCH_MM * 1e-3, NoOperator())
    gantry.answer = lambda line: b"error:2\r\n" if "X20" in line else b"ok\r\n"
    record = bench.run(short_plan("presses", "loading", "frames"))
    bench.station.probe.close()
    outcomes = {phase.name: phase.outcome for phase in record.phases}
    assert outcomes == {
        "frames": Outcome.PASS,
        "presses": Outcome.ERROR,
        "loading": Outcome.ERROR,
        "faults": Outcome.PASS,
    }
    assert "answered 'error:2' to 'G0 X20.000" in phase_of(record, "presses").problem
    assert gantry.at["Z"] > TOUCH_Z


def test_a_test_that_is_stopped_half_way_lets_go(benches, gantries):
    bench = benches()
    gantry = gantries(on_press=pressing(bench.station.kind, bench.finger))
    bench.station.probe = probe = open_gcode(url_of(gantry), bench.station.kind, PITCH_MM * 1e-3, NoOperator())
    ask, wait = probe._port.readline, []

    def interrupted():
        if gantry.at["Z"] < TOUCH_Z and not wait:
            wait.append("pressed")
            raise KeyboardInterrupt
        return ask()

    probe._port.readline = interrupted
    record = bench.run(short_plan("presses"))
    assert phase_of(record, "presses").problem == "stopped from the keyboard"
    assert gantry.at["Z"] == TOUCH_Z + 5.0
    assert gantry.lines[-2:] == ["G0 Z7.000", "G4 P0"]
    assert probe._owed == 0  # the answer to the line that was cut off has been taken too


@pytest.mark.parametrize(
    ("query", "words"),
    [
        ("x=1&y=1&touch_z=1", "option 'spring_n_mm' is missing; say where the board lies under the gantry"),
        ("x=1&y=1&touch_z=1&spring_n_mm=0", "option 'spring_n_mm' must be above 0, found 0"),
        ("x=1&y=1&touch_z=1&spring_n_mm=1&clear=-1", "option 'clear' must be above 0, found -1"),
        ("x=one&y=1&touch_z=1&spring_n_mm=1", "option 'x' must be a number, found 'one'"),
        ("x=1&y=nan&touch_z=1&spring_n_mm=1", "option 'y' must be a number, found 'nan'"),
        ("x=1&y=1&touch_z=1&spring_n_mm=1&speed=9", "unknown option 'speed'; known are x, y, touch_z"),
        ("x=1&y=1&touch_z=1&spring_n_mm=1", "check the port's name"),
    ],
)
def test_a_url_that_cannot_be_meant_is_one_line(query, words):
    with pytest.raises(ProbeError) as error:
        open_gcode(f"gcode:///dev/ttyNONE?{query}", KIND, 0.005, NoOperator())
    assert str(error.value).startswith("gcode:///dev/ttyNONE?")
    assert words in str(error.value)
    assert "\n" not in str(error.value)
