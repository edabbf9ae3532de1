"""`taxel bench`: exit status, printed output, files, and refusals with one error line."""

import io
import json
import sqlite3
import sys
import xml.etree.ElementTree as ET
from contextlib import contextmanager

import pytest
from rich.console import Console

from host.tests.bench.conftest import ADDRESS, make_bench_url
from host.tests.command_line import run_taxel
from taxel.errors import TaxelError
from taxel_tools import cli_bench
from taxel_tools.bench import running
from taxel_tools.bench.phases import indentations
from taxel_tools.bench.saving import check_output, save_record
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
def folder(tmp_path, monkeypatch):
    """Working directory with a short plan."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "quick.toml").write_text(PLAN)
    return tmp_path


@pytest.fixture
def run(folder, capsys):
    """Runs `taxel bench`; returns exit status, standard output and standard error."""

    def call(*arguments, url=None, plan="quick.toml", serial="FT-0001"):
        options = ["--plan", plan] if plan else []
        options += ["--serial", serial] if serial else []
        status = run_taxel("bench", url or make_bench_url(), *options, *arguments)
        captured = capsys.readouterr()
        return status, captured.out, captured.err

    return call


def read_refusal(result):
    """Read the single error line of a command that was refused before any test."""
    status, out, err = result
    assert (status, out) == (2, "")
    lines = err.splitlines()
    assert len(lines) == 1, err
    assert lines[0].startswith("taxel: ")
    return lines[0].removeprefix("taxel: ")


def test_the_help_has_an_example_and_explains_the_exit_status(run):
    status, out, _ = run("--help")
    text = " ".join(out.split())
    assert status == 0
    assert 'Example: taxel bench "emulator:?board=0x1C" --serial FT-0001' in text
    assert "Exit status: 0 passed, 1 failed, 2 could not be tested." in text


def test_a_healthy_board_gives_exit_status_0_three_files_and_a_history(run, folder):
    status, out, _ = run()
    assert status == 0
    lines = out.splitlines()
    assert lines[0].split() == ["phase", "outcome", "time"]
    assert lines[1].split()[:4] == ["Opens", "and", "shorts", "pass"]
    assert lines[-1].startswith("FT-0001: PASS in ")
    (report_folder,) = (folder / "out/bench").glob("FT-0001-*")
    assert sorted(path.name for path in report_folder.iterdir()) == ["junit.xml", "report.html", "result.json"]
    assert (folder / "out/bench/history.sqlite").exists()
    assert str(report_folder.relative_to(folder) / "report.html") in lines[-1]


def test_a_faulty_board_gives_exit_status_1_and_junit_failures(run, folder):
    """Axis 0 has the TX lines. TX 2 is on pin 3 of the connector, because pins are numbered from 1."""
    status, out, _ = run(url=make_bench_url(f"effect line open {BOARD} axis=0 index=2"))
    assert status == 1
    assert "open line at TX 2: its crossings have" in out
    assert "check J1 pin 3 and its trace" in out
    suite = ET.parse(next((folder / "out/bench").glob("FT-0001-*/junit.xml"))).getroot()
    failed_cases = [case.get("name") for case in suite.iter("testcase") if case.find("failure") is not None]
    assert failed_cases == ["capacitance at TX 2", "open line at TX 2"]


def test_a_board_that_fails_gives_exit_status_2_and_a_record(run, folder):
    """The board is unplugged 0.8 s after the start; the phase reads the frames of 1.5 s.

    The printed outcome of the test is ERROR.
    """
    (folder / "longer.toml").write_text(PLAN.replace("seconds = 0.5", "seconds = 1.5"))
    status, out, _ = run(url=make_bench_url(f"fault 0.8 unplug 0x{ADDRESS:02X}"), plan="longer.toml")
    assert status == 2
    assert "board 0x2C: no frame for 1." in out
    assert "FT-0001: ERROR in " in out


def test_a_test_without_measurements_gives_exit_status_2(run):
    status, out, _ = run("--probe", "none", "--phase", "presses")
    assert status == 2
    assert "cannot run: no probe; choose one with --probe" in out
    assert "FT-0001: SKIP in 0.0 s" in out


def test_the_json_output_is_one_document(run, folder):
    status, out, _ = run("--json", url=make_bench_url(f"effect line short {BOARD} axis=1 index=1"))
    document = json.loads(out)
    assert (status, document["outcome"]) == (1, "fail")
    assert [(finding["fault"], finding["place"]) for finding in document["findings"]] == [("short", "RX 1 and RX 2")]
    assert json.loads((folder / document["folder"] / "result.json").read_text())["serial_number"] == "FT-0001"


def test_a_single_phase_runs_with_the_merging_phase(run):
    """The phase "Named faults" merges the faults of the other phases, so it runs together with any single phase."""
    status, out, _ = run("--phase", "presses", url=make_bench_url(f"effect dead rest {BOARD} taxel=3"))
    assert status == 1
    assert [line.split("  ")[0] for line in out.splitlines()[1:3]] == ["Response of each taxel", "Named faults"]
    assert "dead taxel at taxel 3: " in out


def test_tests_within_one_second_have_separate_folders(run, folder):
    folders = {json.loads(run("--json")[1])["folder"] for _ in range(3)}
    assert len(folders) == 3


def test_the_report_contains_the_history_of_the_serial_number(run, folder):
    """In the third test of FT-0001, a line has the capacitance of a stub, which the report marks as moved."""
    for _ in range(2):
        run()
    run(serial="FT-0002")
    run(url=make_bench_url(f"effect line open {BOARD} axis=0 index=2 stub_pf=0.8"))
    pages = {path.parent.name: path.read_text() for path in (folder / "out/bench").glob("*/report.html")}
    first_page, *_, last_page = (pages[name] for name in sorted(pages) if name.startswith("FT-0001"))
    assert "Earlier tests" in last_page
    assert "moved" in last_page.split("Earlier tests")[1]
    assert "Earlier tests" not in first_page


def test_the_history_can_be_in_another_folder(run, folder):
    assert run("--history", "line/history.sqlite", "--out", "reports")[0] == 0
    assert (folder / "line/history.sqlite").exists()
    assert not (folder / "reports/history.sqlite").exists()


def test_a_single_board_on_the_bus_needs_no_address(run):
    assert run(url=f"emulator:?hand=allegro&{BOARD}&wire=i2c")[0] == 0


def test_one_of_several_boards_must_be_selected(run):
    url = "emulator:?hand=allegro&board=0x2C&board=0x2F"
    assert read_refusal(run(url=url)) == "virtual:: expected one board, found 2 (0x2C, 0x2F); select one with --board"
    assert run("--board", "0x2F", url=url)[0] == 0


@pytest.mark.parametrize(
    ("arguments", "options", "expected"),
    [
        ([], {"url": "nothing"}, "nothing: is not a URL that can be opened"),
        ([], {"url": "emulator:?hand=allegro&board=0x60"}, "hand 'allegro' has no board 0x60"),
        (
            [],
            {"url": f"{make_bench_url()}&word=blank 0x2C"},
            "virtual:: expected a board with an application, found none",
        ),
        (["--board", "0x60"], {}, "board 0x60: does not answer; run taxel scan to list the boards"),
        (["--board", "x"], {}, "--board: expected an I2C address from 0x08 to 0x77, found 'x'"),
        (
            ["--phase", "magic"],
            {},
            "--phase: expected a phase of quick.toml (electrical, presses, faults), found 'magic'",
        ),
        (["--probe", "magic"], {}, "--probe: expected one of none, operator, emulated, gcode, found 'magic'"),
        (["--probe", "gcode:///dev/ttyNONE?x=1"], {}, "gcode:///dev/ttyNONE?x=1: option 'y' is missing"),
        (["--probe", "operator"], {}, "--probe: 'operator' requires a terminal, found none; choose another probe"),
        (["--hand", "none"], {}, "none: "),
        ([], {"plan": "none.toml"}, "none.toml: file: expected a readable test plan"),
        ([], {"serial": "7"}, "serial number: expected a number that matches FT-[0-9]{4}, found '7'; read the"),
        ([], {"serial": None}, "--serial: expected a serial number, found none and no terminal to enter it; add --"),
        (["--out", "/proc/none"], {}, "/proc/none: "),
        (["--history", "quick.toml"], {}, "quick.toml: expected a history of tests, found: "),
    ],
)
def test_each_refusal_gives_one_error_line_and_exit_status_2(run, arguments, options, expected):
    assert read_refusal(run(*arguments, **options)).startswith(expected)


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
def test_an_invalid_plan_is_refused_before_the_bus_is_opened(run, folder, old, new, expected):
    (folder / "quick.toml").write_text(PLAN.replace(old, new))
    assert read_refusal(run(url="serial:///dev/ttyNONE")).startswith(expected)
    assert not (folder / "out").exists()


@pytest.fixture
def physical_url(monkeypatch):
    """URL of a board that the command takes for a physical one, because its emulated bench is hidden."""

    @contextmanager
    def open_without_bench(url):
        with running.open_emulated(make_bench_url()) as (wire, _):
            yield wire

    monkeypatch.setattr(running, "open_wire", open_without_bench)
    return "serial:///dev/ttyNONE"


def test_the_emulated_probe_refuses_a_physical_board(run, physical_url):
    message = read_refusal(run("--probe", "emulated", url=physical_url))
    assert message == "--probe: 'emulated' requires an emulated board, found a physical one; choose another probe"


def test_a_physical_board_has_no_probe_by_default(run, physical_url):
    status, out, _ = run("--phase", "presses", url=physical_url)
    assert status == 2
    assert "cannot run: no probe; choose one with --probe" in out


class Terminal(io.StringIO):
    """A text stream that is a terminal."""

    def isatty(self):
        return True


@pytest.fixture
def at_terminal(monkeypatch):
    """Factory of a terminal with an operator who types the given lines."""

    def make(*lines):
        screen = Terminal()
        monkeypatch.setattr(
            cli_bench, "Console", lambda **options: Console(file=screen, force_terminal=True, width=200)
        )
        monkeypatch.setattr(sys, "stdin", Terminal("".join(f"{line}\n" for line in lines)))
        return screen

    return make


def test_the_question_for_the_serial_number_is_repeated_until_it_is_valid(run, at_terminal, folder):
    screen = at_terminal("7", "FT-0042")
    status, out, _ = run(serial=None)
    assert status == 0
    assert "FT-0042: PASS" in out
    assert "expected a number that matches" in screen.getvalue()


def test_the_operator_is_instructed_at_the_terminal_without_progress_bars(run, at_terminal, monkeypatch):
    monkeypatch.setattr(indentations, "MANUAL_S", 0.05)
    # 27 taxels, each with two instructions, all repeated because the board is not pressed.
    screen = at_terminal(*[""] * 108)
    status, out, _ = run("--probe", "operator", "--phase", "presses")
    assert status == 1
    assert "no response at board: no taxel responds to an indentation" in out
    text = screen.getvalue()
    assert 54 <= text.count("press Enter when done") <= 108  # On a slow machine, a taxel may appear to be pressed.
    assert all(f"press taxel {taxel} (TX " in text for taxel in range(27))
    assert "once more: press taxel 26 (TX 7, RX " in text


def test_the_output_folders_are_checked_before_the_test(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(Exception, match="file: File exists; choose another folder with --out or --history"):
        check_output(tmp_path / "file", tmp_path / "history.sqlite")
    (tmp_path / "other.sqlite").write_text("not a database, but long enough to be read as one" * 20)
    with pytest.raises(HistoryError, match=r"other\.sqlite: expected a history of tests"):
        check_output(tmp_path / "out", tmp_path / "other.sqlite")


def test_reports_are_saved_although_another_station_locks_the_history(tmp_path, monkeypatch):
    monkeypatch.setattr(history_module, "LOCK_TIMEOUT_S", 0.05)
    file = tmp_path / "history.sqlite"
    check_output(tmp_path / "out", file)
    record = TestRecord("A-1", "", "", "p", "1", "", {}, "", "2026-01-02T03:04:05.678Z", Outcome.SKIP, [], 0.0)
    other_station = sqlite3.connect(file, isolation_level=None)
    other_station.execute("BEGIN EXCLUSIVE")
    folder = tmp_path / "out" / "A-1-20260102T030405"
    with pytest.raises(TaxelError, match=rf"cannot be used: database is locked;.* saved in {folder}"):
        save_record(record, tmp_path / "out", file)
    other_station.close()
    assert {path.name for path in folder.iterdir()} == {"report.html", "result.json", "junit.xml"}


def test_a_serial_number_cannot_leave_the_output_folder(tmp_path):
    record = TestRecord("../../etc/x", "", "", "p", "1", "", {}, "", "2026-01-02T03:04:05.678Z", Outcome.SKIP, [], 0.0)
    folder = save_record(record, tmp_path / "out", tmp_path / "history.sqlite")
    assert folder == tmp_path / "out" / "______etc_x-20260102T030405"


def test_the_folder_of_a_record_without_serial_number_is_named_board(tmp_path):
    record = TestRecord("", "", "", "p", "1", "", {}, "", "2026-01-02T03:04:05.678Z", Outcome.SKIP, [], 0.0)
    assert save_record(record, tmp_path / "out", tmp_path / "h.sqlite").name == "board-20260102T030405"
