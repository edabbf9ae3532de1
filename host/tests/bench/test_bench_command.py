"""`taxel bench`: exit status, what it prints and leaves behind, and what it refuses with one line."""

from __future__ import annotations

import io
import json
import sqlite3
import sys
import xml.etree.ElementTree as ET
from contextlib import contextmanager
from dataclasses import replace

import pytest
from rich.console import Console

from host.tests.bench.conftest import ADDRESS, url_of
from host.tests.command_line import exit_status
from taxel.errors import TaxelError
from taxel_tools import cli_bench
from taxel_tools.bench import running
from taxel_tools.bench.keeping import check_place, keep
from taxel_tools.bench.phases import presses
from taxel_tools.testing import history as history_module
from taxel_tools.testing.errors import HistoryError
from taxel_tools.testing.record import Outcome, TestRecord

BOARD = f"board=0x{ADDRESS:02X}"
PLAN = """taxel_test_plan = 1
name = "quick"
version = "2"
serial_pattern = "FT-[0-9]{4}"
[phases.electrical]
seconds = 0.5
[phases.electrical.limits]
capacitance = { min = 0.6 }
[phases.presses]
enabled = false
[phases.faults]
"""


@pytest.fixture
def place(tmp_path, monkeypatch):
    """A folder of its own, with a quick plan."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "quick.toml").write_text(PLAN)
    return tmp_path


@pytest.fixture
def run(place, capsys):
    """Runs `taxel bench`: exit status, output, complaints."""

    def call(*words, url=None, plan="quick.toml", serial="FT-0001"):
        chosen = ["--plan", plan] if plan else []
        chosen += ["--serial", serial] if serial else []
        status = exit_status("bench", url or url_of(), *chosen, *words)
        told = capsys.readouterr()
        return status, told.out, told.err

    return call


def refused(result):
    """The one line of a refusal: nothing was tested."""
    status, out, err = result
    assert (status, out) == (2, "")
    lines = err.splitlines()
    assert len(lines) == 1, err
    assert lines[0].startswith("taxel: ")
    return lines[0].removeprefix("taxel: ")


def test_help_has_an_example_and_says_what_the_exit_status_means(run):
    status, out, _ = run("--help")
    words = " ".join(out.split())
    assert status == 0
    assert 'Example: taxel bench "emulator:?board=0x22" --serial FT-0001' in words
    assert "Exit status: 0 passed, 1 failed, 2 could not be tested." in words


def test_a_good_board_is_0_and_leaves_three_files_and_a_history(run, place):
    status, out, _ = run()
    assert status == 0
    lines = out.splitlines()
    assert lines[0].split() == ["phase", "outcome", "time"]
    assert lines[1].split()[:4] == ["Opens", "and", "shorts", "pass"]
    assert lines[-1].startswith("FT-0001: PASS in ")
    (folder,) = (place / "out/bench").glob("FT-0001-*")
    assert sorted(path.name for path in folder.iterdir()) == ["junit.xml", "report.html", "result.json"]
    assert (place / "out/bench/history.sqlite").exists()
    assert str(folder.relative_to(place) / "report.html") in lines[-1]


def test_a_bad_board_is_1_and_junit_says_why(run, place):
    status, out, _ = run(url=url_of(f"effect line open {BOARD} axis=0 index=2"))
    assert status == 1
    assert "open line at TX 2: all its crossings have" in out
    assert "look at J1 pin 3 and its trace" in out
    suite = ET.parse(next((place / "out/bench").glob("FT-0001-*/junit.xml"))).getroot()
    failed = [case.get("name") for case in suite.iter("testcase") if case.find("failure") is not None]
    assert failed == ["capacitance at TX 2", "open line at TX 2"]


def test_a_board_that_dies_is_2_and_leaves_its_record(run, place):
    (place / "longer.toml").write_text(PLAN.replace("seconds = 0.5", "seconds = 1.5"))
    status, out, _ = run(url=url_of(f"fault 0.8 unplug 0x{ADDRESS:02X}"), plan="longer.toml")
    assert status == 2
    assert "board 0x2C: has sent no frame for 1." in out
    assert "FT-0001: ERROR in " in out


def test_a_test_of_nothing_is_2(run):
    status, out, _ = run("--probe", "none", "--phase", "presses")
    assert status == 2
    assert "cannot run here: no probe: give --probe" in out
    assert "FT-0001: SKIP in 0.0 s" in out


def test_json_is_one_document(run, place):
    status, out, _ = run("--json", url=url_of(f"effect line short {BOARD} axis=1 index=1"))
    document = json.loads(out)
    assert (status, document["outcome"]) == (1, "fail")
    assert [(one["fault"], one["place"]) for one in document["findings"]] == [("short", "RX 1 and RX 2")]
    assert json.loads((place / document["folder"] / "result.json").read_text())["serial_number"] == "FT-0001"


def test_one_phase_is_run_by_itself_and_faults_are_named_all_the_same(run):
    status, out, _ = run("--phase", "presses", url=url_of(f"effect dead rest {BOARD} taxel=3"))
    assert status == 1
    assert [line.split("  ")[0] for line in out.splitlines()[1:3]] == ["Each taxel pressed", "Named faults"]
    assert "dead taxel at taxel 3: " in out


def test_tests_of_one_second_have_a_folder_each(run, place):
    seen = {json.loads(run("--json")[1])["folder"] for _ in range(3)}
    assert len(seen) == 3


def test_the_history_of_a_serial_number_is_told_in_the_report(run, place):
    for _ in range(2):
        run()
    run(serial="FT-0002")
    run(url=url_of(f"effect line open {BOARD} axis=0 index=2 stub_pf=0.8"))
    pages = {path.parent.name: path.read_text() for path in (place / "out/bench").glob("*/report.html")}
    first, *_, last = (pages[name] for name in sorted(pages) if name.startswith("FT-0001"))
    assert "Earlier tests" in last
    assert "moved" in last.split("Earlier tests")[1]
    assert "moved" not in first.split("</header>")[1] or "Earlier tests" not in first


def test_the_history_may_lie_elsewhere(run, place):
    assert run("--history", "line/history.sqlite", "--out", "reports")[0] == 0
    assert (place / "line/history.sqlite").exists()
    assert not (place / "reports/history.sqlite").exists()


def test_the_only_board_on_the_bus_needs_no_address(run):
    assert run(url=f"emulator:?{BOARD}&wire=i2c")[0] == 0


def test_one_of_several_boards_must_be_named(run):
    several = "emulator:?board=0x2C&board=0x2F"
    assert refused(run(url=several)) == "virtual:: 2 boards answer (0x2C, 0x2F); name one with --board"
    assert run("--board", "0x2F", url=several)[0] == 0


@pytest.mark.parametrize(
    ("words", "options", "expected"),
    [
        ([], {"url": "nothing"}, "nothing: is not a URL that can be opened"),
        ([], {"url": "emulator:?board=0x60"}, "hand 'allegro' has no board 0x60"),
        ([], {"url": f"{url_of()}&word=blank 0x2C"}, "virtual:: no board with an application answers"),
        (["--board", "0x60"], {}, "board 0x60: does not answer; taxel scan shows who does"),
        (["--board", "x"], {}, "--board: expected an I2C address from 0x08 to 0x77, found 'x'"),
        (["--phase", "magic"], {}, "--phase: quick.toml has no phase 'magic'; it has electrical, presses, faults"),
        (["--probe", "magic"], {}, "--probe: expected none, operator, emulated or gcode:///dev/..., found 'magic'"),
        (["--probe", "gcode:///dev/ttyNONE?x=1"], {}, "gcode:///dev/ttyNONE?x=1: option 'y' is missing"),
        (["--probe", "operator"], {}, "--probe operator: nobody is at a terminal to be told what to press"),
        (["--hand", "none"], {}, "none: "),
        ([], {"plan": "none.toml"}, "none.toml: file: expected a test plan that can be read"),
        ([], {"serial": "7"}, "serial number: expected one that matches FT-[0-9]{4}, found '7'; read the label again"),
        ([], {"serial": None}, "--serial: nobody is at a terminal to be asked; give the board's serial number"),
        (["--out", "/proc/none"], {}, "/proc/none: "),
        (["--history", "quick.toml"], {}, "quick.toml: expected a history of tests, found: "),
    ],
)
def test_what_cannot_be_tested_is_one_line_and_2(run, words, options, expected):
    assert refused(run(*words, **options)).startswith(expected)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ("taxel_test_plan = 1", "taxel_test_plan = 2", "quick.toml: taxel_test_plan: expected 1, found 2"),
        ("seconds = 0.5", "seconds = -1", "quick.toml: phases.electrical.seconds: expected a number from 0.2 to 3600"),
        ("seconds = 0.5", "second = 1", "quick.toml: phases.electrical.second: expected an option of this phase"),
        (
            "capacitance =",
            "capacity =",
            "quick.toml: phases.electrical.limits.capacity: expected a measurement",
        ),
        ("[phases.faults]", "", "quick.toml: phases: expected 'faults' as the last phase, found 'electrical'"),
        ("[phases.faults]", "[phases.faults]\n[kinds.plam.faults]", "quick.toml: kinds.plam: expected a kind of board"),
    ],
)
def test_a_wrong_plan_is_refused_before_a_board_is_touched(run, place, old, new, expected):
    (place / "quick.toml").write_text(PLAN.replace(old, new))
    assert refused(run(url="serial:///dev/ttyNONE")).startswith(expected)
    assert not (place / "out").exists()


def test_the_emulated_probe_presses_no_board_on_a_wire(run, monkeypatch):
    @contextmanager
    def as_a_wire(url):
        with running.open_emulated(url_of()) as (wire, _):
            yield wire

    monkeypatch.setattr(running, "open_wire", as_a_wire)
    found = refused(run("--probe", "emulated", url="serial:///dev/ttyNONE"))
    assert found == "--probe: 'emulated' presses emulated boards only; this one is on a wire"
    assert run("--phase", "presses", url="serial:///dev/ttyNONE")[0] == 2  # no probe unless one is asked for


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture
def at_terminal(monkeypatch):
    """Somebody at a terminal who types these lines."""

    def sit(*lines):
        screen = Terminal()
        monkeypatch.setattr(
            cli_bench, "Console", lambda **options: Console(file=screen, force_terminal=True, width=200)
        )
        monkeypatch.setattr(sys, "stdin", Terminal("".join(f"{line}\n" for line in lines)))
        return screen

    return sit


def test_at_a_terminal_the_serial_number_is_asked_for_until_it_can_be(run, at_terminal, place):
    screen = at_terminal("7", "FT-0042")
    status, out, _ = run(serial=None)
    assert status == 0
    assert "FT-0042: PASS" in out
    assert "expected one that matches" in screen.getvalue()


def test_at_a_terminal_the_operator_is_told_what_to_press_and_bars_make_room(run, at_terminal, monkeypatch):
    monkeypatch.setattr(presses, "MANUAL_S", 0.05)
    screen = at_terminal(*[""] * 108)  # 27 taxels, each pressed and let go, and once more since nobody presses
    status, out, _ = run("--probe", "operator", "--phase", "presses")
    assert status == 1
    assert "no response at board: no taxel answers a press" in out
    told = screen.getvalue()
    assert 54 <= told.count("press Enter when done") <= 108  # of a late machine one taxel may look as if it was pressed
    assert all(f"press taxel {taxel} (TX " in told for taxel in range(27))
    assert "once more: press taxel 26 (TX 7, RX " in told


def test_a_place_for_reports_is_checked_before_the_test(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(Exception, match="file: File exists; choose another folder with --out or --history"):
        check_place(tmp_path / "file", tmp_path / "history.sqlite")
    (tmp_path / "other.sqlite").write_text("no database at all, but long enough to be taken for one" * 20)
    with pytest.raises(HistoryError, match=r"other\.sqlite: expected a history of tests"):
        check_place(tmp_path / "out", tmp_path / "other.sqlite")


def test_a_history_that_another_station_holds_costs_no_report(tmp_path, monkeypatch):
    monkeypatch.setattr(history_module, "PATIENCE_S", 0.05)
    file = tmp_path / "history.sqlite"
    check_place(tmp_path / "out", file)
    record = TestRecord("A-1", "", "", "p", "1", "", {}, "", "2026-01-02T03:04:05.678Z", Outcome.SKIP, [], 0.0)
    other = sqlite3.connect(file, isolation_level=None)
    other.execute("BEGIN EXCLUSIVE")
    folder = tmp_path / "out" / "A-1-20260102T030405"
    with pytest.raises(TaxelError, match=rf"cannot be used: database is locked;.* kept in {folder}"):
        keep(record, tmp_path / "out", file)
    other.close()
    assert {one.name for one in folder.iterdir()} == {"report.html", "result.json", "junit.xml"}


def test_a_serial_number_cannot_lead_out_of_the_folder(tmp_path):
    record = TestRecord("../../etc/x", "", "", "p", "1", "", {}, "", "2026-01-02T03:04:05.678Z", Outcome.SKIP, [], 0.0)
    folder = keep(record, tmp_path / "out", tmp_path / "history.sqlite")
    assert folder == tmp_path / "out" / "______etc_x-20260102T030405"
    assert keep(replace(record, serial_number=""), tmp_path / "out", tmp_path / "h.sqlite").name.startswith(
        "board-2026"
    )
