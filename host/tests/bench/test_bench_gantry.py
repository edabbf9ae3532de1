"""Probe on a G-code gantry, here a program behind a pseudo-terminal that indents an emulated board."""

import numpy as np
import pytest

from host.tests.bench.conftest import ADDRESS, find_phase, find_value, list_faults, make_short_plan
from host.tests.bench.fake_gantry import PITCH_MM, SPRING, TOUCH_Z, FakeGantry, PtyGantry, X, Y, press_with
from host.tests.scripted_operator import ScriptedOperator
from taxel.hand import load_hand
from taxel_tools.bench.probe import ProbeError, ProbeRequest, gcode
from taxel_tools.bench.probe.gcode import open_gcode_probe
from taxel_tools.testing.operator import NoOperator
from taxel_tools.testing.record import Outcome

KIND = load_hand("allegro").get_board(ADDRESS).kind


@pytest.fixture
def gantries(monkeypatch):
    """Factory of gantries whose port is an object, with immediate answers or none."""
    gantries_by_port = {}

    def make(**options):
        gantry = FakeGantry(**options)
        gantry.port = f"/dev/ttyFAKE{len(gantries_by_port)}"
        gantries_by_port[gantry.port] = gantry
        return gantry

    monkeypatch.setattr(gcode.serial, "Serial", lambda port, baud, timeout: gantries_by_port[port])
    return make


@pytest.fixture
def pty_gantries():
    """Factory of gantries that pyserial opens."""
    gantries = []

    def make(**options):
        gantries.append(PtyGantry(**options))
        return gantries[-1]

    yield make
    for gantry in gantries:
        gantry.close()


def format_gantry_url(gantry, **options):
    """Format the URL of a probe on a fake gantry. options: values that replace the defaults."""
    values = {"x": X, "y": Y, "touch_z": TOUCH_Z, "spring_n_mm": SPRING, "tip": 3} | options
    return f"gcode://{gantry.port}?" + "&".join(f"{name}={value}" for name, value in values.items())


def open_probe(gantry, operator=None, kind=KIND, **options):
    """Open a probe on a fake gantry, by default over the smallest board. options: values of the URL."""
    url = format_gantry_url(gantry, **options)
    return open_gcode_probe(ProbeRequest(url, kind, PITCH_MM * 1e-3, operator or NoOperator(), ADDRESS))


def test_a_gantry_indents_every_taxel_of_a_board(benches, pty_gantries):
    bench = benches()
    gantry = pty_gantries(on_press=press_with(bench.board.kind, bench.emulated_probe))
    bench.board.probe = open_probe(gantry, kind=bench.board.kind)
    record = bench.run(make_short_plan("presses"))
    bench.board.probe.close()
    assert (record.outcome, list_faults(record)) == (Outcome.PASS, [])
    assert find_value(record, "presses", "response") == pytest.approx(730.0, rel=0.15)  # counts
    assert gantry.deepest == pytest.approx(TOUCH_Z - 1.0 / SPRING)  # 1 N
    assert gantry.position["Z"] > TOUCH_Z


def test_an_indentation_gives_the_expected_g_code(gantries):
    """Touch at Z = 2 mm, clear 5 mm above, spring of 10 N/mm, TX 0 and RX 0 cross at (10, 20) mm, pitch 5 mm.

    TX 3 is 15 mm from TX 0 in X, and RX 2 is 10 mm from RX 0 in Y. Forces of 2 N and 4 N compress the spring by 0.2 mm
    and 0.4 mm.
    """
    gantry = gantries()
    probe = open_probe(gantry)
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


def test_a_board_with_unequal_pitch_is_indented_at_its_taxel_centres(gantries):
    kind = load_hand("original").find_board("palm").kind
    gantry = gantries()
    probe = open_probe(gantry, kind=kind)
    places = []
    for taxel in range(kind.taxel_count):
        probe.press(taxel, 1.0, 3e-3)
        places.append((gantry.position["X"] - X, gantry.position["Y"] - Y))
    places = np.array(places)
    assert np.array_equal(places[0], [0.0, 0.0])
    centres = 1e3 * kind.surface.position
    distance = np.linalg.norm(centres[:, None] - centres, axis=-1)
    assert np.linalg.norm(places[:, None] - places, axis=-1) == pytest.approx(distance, abs=0.002)
    assert places[kind.row > kind.row[0], 0].min() > 0.0  # rows along +x
    assert places[kind.column > kind.column[0], 1].min() > 0.0  # columns along +y


def test_a_bent_board_with_unequal_pitch_is_refused_in_one_line(gantries):
    gantry = gantries()
    kind = load_hand("original").find_board("fingertip_index").kind
    with pytest.raises(ProbeError, match="expected a flat board, found the bent board kind 'fingertip'"):
        open_probe(gantry, kind=kind)
    assert gantry.lines == []


def test_forces_beyond_the_limits_are_refused(gantries):
    gantry = gantries()
    probe = open_probe(gantry, travel=4)
    for force, expected_text in (
        (61.0, "expected a force from 0 to 60 N, found 61"),
        (-1.0, "found -1"),
        (50.0, "its travel is 4 mm"),
    ):
        with pytest.raises(ProbeError, match=expected_text):
            probe.press(0, force, 3e-3)
    with pytest.raises(ProbeError, match="found nan"):
        probe.press(0, float("nan"), 3e-3)
    assert gantry.deepest > TOUCH_Z
    probe.press(0, 40.0, 3e-3)
    assert gantry.deepest == pytest.approx(TOUCH_Z - 4.0)  # 40 N at 10 N/mm: the whole travel is permitted


def test_the_operator_changes_the_tip_while_the_gantry_is_clear_of_the_board(gantries):
    gantry = gantries()
    heights = []
    operator = ScriptedOperator([], lambda text: heights.append(gantry.position["Z"]))
    probe = open_probe(gantry, operator)
    probe.press(0, 1.0, 3e-3)
    assert operator.texts == []
    probe.press(0, 1.0, 12e-3)
    probe.press(1, 1.0, 12e-3)
    assert operator.texts == ["insert the 12 mm tip into the holder of the gantry"]
    assert heights == [TOUCH_Z + 5.0]  # 5 mm clear of the board, mm


def test_a_tip_change_without_an_operator_is_an_error_of_the_phase(benches, gantries):
    bench = benches()
    gantry = gantries()
    bench.board.probe = open_probe(gantry, kind=bench.board.kind)
    record = bench.run(make_short_plan("loading"))
    expected = "no operator to answer 'insert the 12 mm tip into the holder of the gantry'"
    assert find_phase(record, "loading").problem.startswith(expected)


def test_the_probe_waits_for_a_controller_that_restarts_when_its_port_is_opened(pty_gantries, monkeypatch):
    monkeypatch.setattr(gcode, "CONNECT_TIMEOUT_S", 0.2)
    monkeypatch.setattr(gcode, "CONNECT_ATTEMPTS", 100)
    gantry = pty_gantries(banner=b"\r\nGrbl 1.1h ['$' for help]\r\n", ignored_lines=2)
    open_probe(gantry).press(0, 1.0, 3e-3)
    assert gantry.lines[-1] == "G4 P0"
    assert gantry.position["Z"] == pytest.approx(TOUCH_Z - 0.1)  # 1 N at 10 N/mm


def test_remarks_and_long_answers_are_ignored(gantries):
    gantry = gantries()
    gantry.answer = lambda line: b"echo:busy: processing\r\nok P15 B3\r\n"
    probe = open_probe(gantry)
    probe.press(0, 1.0, 3e-3)
    probe.release()
    assert gantry.lines[-2:] == ["G0 Z7.000", "G4 P0"]


def test_a_port_without_an_answer_gives_one_error_line(pty_gantries, monkeypatch):
    monkeypatch.setattr(gcode, "CONNECT_TIMEOUT_S", 0.05)  # of each of the 6 attempts, 0.3 s in total
    gantry = pty_gantries(ignored_lines=10**6)
    with pytest.raises(ProbeError, match=r"no answer to 'G21' in 0\.3 s; is this the port of the gantry\?"):
        open_probe(gantry)


def test_a_locked_controller_gives_one_error_line(gantries):
    gantry = gantries()
    gantry.answer = lambda line: b"error:9\r\n"  # Grbl: commands are locked out during an alarm
    with pytest.raises(ProbeError, match="answered 'error:9' to 'G21'; home the gantry and clear its path"):
        open_probe(gantry)


@pytest.mark.parametrize("answer", [b"error:20\r\n", b"ALARM:1\r\n", b""])
def test_a_gantry_that_fails_is_lifted_and_moves_no_more(gantries, answer):
    gantry = gantries()
    probe = open_probe(gantry)
    probe.press(0, 1.0, 3e-3)
    gantry.answer = lambda line: answer if line.startswith("G1") else b"ok\r\n"
    with pytest.raises(ProbeError, match="G1 Z"):
        probe.press(0, 2.0, 3e-3)
    assert gantry.position["Z"] > TOUCH_Z
    line_count = len(gantry.lines)
    with pytest.raises(ProbeError, match="G1 Z"):
        probe.press(1, 1.0, 3e-3)
    probe.release()
    probe.close()
    probe.close()
    assert len(gantry.lines) == line_count


def test_a_failing_gantry_is_an_error_of_the_phase(benches, gantries):
    bench = benches()
    gantry = gantries(on_press=press_with(bench.board.kind, bench.emulated_probe))
    bench.board.probe = open_probe(gantry, kind=bench.board.kind)
    gantry.answer = lambda line: b"error:2\r\n" if "X20" in line else b"ok\r\n"  # fails at the third row of taxels
    record = bench.run(make_short_plan("presses", "loading", "frames"))
    bench.board.probe.close()
    outcomes = {phase.name: phase.outcome for phase in record.phases}
    assert outcomes == {
        "frames": Outcome.PASS,
        "presses": Outcome.ERROR,
        "loading": Outcome.ERROR,
        "faults": Outcome.PASS,
    }
    assert "answered 'error:2' to 'G0 X20.000" in find_phase(record, "presses").problem
    assert gantry.position["Z"] > TOUCH_Z


def test_an_interrupted_test_lifts_the_tip(benches, gantries):
    bench = benches()
    gantry = gantries(on_press=press_with(bench.board.kind, bench.emulated_probe))
    bench.board.probe = probe = open_probe(gantry, kind=bench.board.kind)
    original_readline, interruptions = probe._port.readline, []

    def interrupt_once():
        if gantry.position["Z"] < TOUCH_Z and not interruptions:
            interruptions.append("pressed")
            raise KeyboardInterrupt
        return original_readline()

    probe._port.readline = interrupt_once
    record = bench.run(make_short_plan("presses"))
    assert find_phase(record, "presses").problem == "stopped from the keyboard"
    assert gantry.position["Z"] == TOUCH_Z + 5.0
    assert gantry.lines[-2:] == ["G0 Z7.000", "G4 P0"]
    assert probe._unanswered_lines == 0  # The answer to the interrupted line has been read too.


@pytest.mark.parametrize(
    ("query", "expected_text"),
    [
        ("x=1&y=1&touch_z=1", "option 'spring_n_mm' is missing; add it to the URL"),
        ("x=1&y=1&touch_z=1&spring_n_mm=0", "option 'spring_n_mm' must be above 0, found 0"),
        ("x=1&y=1&touch_z=1&spring_n_mm=1&clear=-1", "option 'clear' must be above 0, found -1"),
        ("x=one&y=1&touch_z=1&spring_n_mm=1", "option 'x' must be a number, found 'one'"),
        ("x=1&y=nan&touch_z=1&spring_n_mm=1", "option 'y' must be a number, found 'nan'"),
        ("x=1&y=1&touch_z=1&spring_n_mm=1&speed=9", "unknown option 'speed', expected one of x, y, touch_z"),
        ("x=1&y=1&touch_z=1&spring_n_mm=1", "check the port's name"),
    ],
)
def test_an_invalid_url_gives_one_error_line(query, expected_text):
    with pytest.raises(ProbeError) as error:
        open_gcode_probe(ProbeRequest(f"gcode:///dev/ttyNONE?{query}", KIND, 0.005, NoOperator(), ADDRESS))
    assert str(error.value).startswith("gcode:///dev/ttyNONE?")
    assert expected_text in str(error.value)
    assert "\n" not in str(error.value)
