"""`taxel monitor` with an emulator, a port and a capture, on a terminal and in a pipe."""

import fcntl
import json
import os
import re
import shlex
import struct
import sys
import termios
import threading

import pytest
from rich.console import Console

from host.tests.command_line import run_refused_command, run_taxel
from taxel.cli import monitor as command

SHORT_BASELINE = ("--baseline-frames", 5)
ENTER_ALTERNATE_SCREEN, LEAVE_ALTERNATE_SCREEN = "\x1b[?1049h", "\x1b[?1049l"
"""Control sequences of xterm. The alternate screen leaves the user's screen unchanged."""


@pytest.fixture(scope="module")
def capture(tmp_path_factory):
    """A capture of 0.6 s of the emulated hand."""
    path = tmp_path_factory.mktemp("monitor") / "capture.bin"
    assert run_taxel("record", "emulator:?speed=max", "--seconds", 0.6, "--out", path) == 0
    return path


def run_json(capsys, *arguments):
    """Run the command with --json and return the readings that it prints."""
    assert run_taxel("monitor", *arguments, "--json") == 0
    return [json.loads(line) for line in capsys.readouterr().out.splitlines()]


def test_once_prints_one_reading_without_losses_of_the_emulated_hand(capsys):
    (reading,) = run_json(capsys, "emulator:?speed=max", "--once", *SHORT_BASELINE)
    assert reading["boards_streaming"] == 17
    assert reading["baseline"] == 1.0
    assert reading["active"] == 0
    assert 18.0 < reading["scans_hz"] < 20.0  # a poll cycle of 17 boards at 400 kHz takes about 53 ms
    assert reading["lost_on_wire"] == reading["missing"] == reading["damaged"] == 0


def test_once_completes_the_baseline_of_the_other_boards_if_a_branch_stops_during_the_baseline(capsys):
    url = (
        "emulator:?speed=max&fault=3 branch_open index 0"  # the cable of the 5 boards of the index finger opens at 3 s
    )
    (reading,) = run_json(capsys, url, "--once", "--seconds", 10)
    assert reading["boards_streaming"] == 17 - 5
    assert reading["baseline"] == 1.0


def test_reading_of_a_serial_port_has_all_boards_and_the_age_of_the_frames(capsys, emulated_port):
    (reading,) = run_json(capsys, f"serial://{emulated_port}", "--once", *SHORT_BASELINE)
    assert reading["boards_streaming"] == 17
    median_age_s, largest_age_s = reading["age_s"]
    assert median_age_s < largest_age_s < 5.0


def test_capture_is_played_to_its_end_without_a_lost_frame(capsys, capture):
    *_, last = run_json(capsys, f"file:{capture}", "--speed", 50, *SHORT_BASELINE)
    assert last["advice"] == f"{capture} has ended"
    capsys.readouterr()
    assert run_taxel("replay", capture, "--json") == 0
    frames = sum(board["frames"] for board in json.loads(capsys.readouterr().out)["boards"])
    assert last["frames"] == frames > 100


def test_output_in_a_pipe_is_one_line_of_text_for_each_reading(capsys, capture):
    # At this speed the capture ends before the second reading, so there is only the line of the last reading.
    assert run_taxel("monitor", f"file:{capture}", "--speed", 50) == 0
    (line,) = capsys.readouterr().out.splitlines()
    assert re.search(r"17/17 boards, \d+ frames/s, baseline \d+ %", line)
    assert line.endswith("has ended")


def test_example_of_the_help_runs(capsys):
    (example,) = re.findall(r"Example: taxel (.*)", command.monitor.__doc__)
    assert run_taxel(*shlex.split(example)) == 0
    assert "17/17 boards" in capsys.readouterr().out


class Terminal:
    """A terminal of `width` x `height` characters. The attribute `output` contains all bytes written so far."""

    def __init__(self, width: int, height: int) -> None:
        self.master, slave = os.openpty()
        fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", height, width, 0, 0))
        self.out, self.input = open(slave, "w"), open(os.dup(slave))  # noqa: SIM115
        self.output = b""
        self._thread = threading.Thread(target=self._store_output, daemon=True)
        self._thread.start()

    def _store_output(self) -> None:
        with open(self.master, "rb", buffering=0, closefd=False) as screen:
            try:
                while data := screen.read(65536):
                    self.output += data
            except OSError:  # the last writer has closed the terminal
                return

    def close(self) -> str:
        self.out.close()
        self.input.close()
        self._thread.join(timeout=10)
        os.close(self.master)
        return self.output.decode()


@pytest.fixture
def terminal(monkeypatch):
    """A terminal of 80 x 24 characters in true colour, which the command uses. `close` returns its output."""
    terminal_80x24 = Terminal(80, 24)
    monkeypatch.setattr(sys, "stdin", terminal_80x24.input)
    monkeypatch.setattr(
        command,
        "Console",
        lambda **options: Console(
            file=terminal_80x24.out, force_terminal=True, color_system="truecolor", width=80, height=24, **options
        ),
    )
    return terminal_80x24


def test_taxels_are_drawn_on_the_alternate_screen_and_the_terminal_is_restored(terminal, capture):
    modes = termios.tcgetattr(terminal.input.fileno())
    assert run_taxel("monitor", f"file:{capture}", "--speed", 2, *SHORT_BASELINE) == 0
    assert termios.tcgetattr(terminal.input.fileno()) == modes
    output = terminal.close()
    start, end = output.index(ENTER_ALTERNATE_SCREEN), output.index(LEAVE_ALTERNATE_SCREEN)
    assert start < output.index("▀") < end
    assert "has ended" in output[end:]  # the last line stays on the user's screen


def test_key_q_ends_the_monitor_of_a_port_and_restores_the_screen(terminal, emulated_port):
    os.write(terminal.master, b"btq")  # b: new baseline, t: table, q: quit; typed before the skin is opened
    assert run_taxel("monitor", f"serial://{emulated_port}", *SHORT_BASELINE) == 0
    assert LEAVE_ALTERNATE_SCREEN in terminal.close()


@pytest.mark.parametrize(("once", "expected_status"), [((), 0), (("--once",), 1)])
def test_capture_without_frames_is_reported_and_is_an_error_only_with_once(capsys, tmp_path, once, expected_status):
    from taxel.link import CaptureWriter

    with CaptureWriter(tmp_path / "empty.bin"):
        pass
    status = run_taxel("monitor", f"file:{tmp_path / 'empty.bin'}", *once)
    output = capsys.readouterr()
    assert "has ended without a frame" in output.out + output.err
    assert status == expected_status


@pytest.mark.parametrize(
    ("arguments", "expected_text"),
    [
        (("file:nothing.bin",), "nothing.bin: cannot be read"),
        (("/dev/nothing",), "/dev/nothing: cannot be opened"),
        (("emulator:", "--speed", 2), "a speed is for a recording"),
        (("emulator:", "--hand", "unknown"), "unknown"),
    ],
)
def test_invalid_arguments_give_an_error_of_one_line(capsys, arguments, expected_text):
    assert expected_text in run_refused_command(capsys, "monitor", *arguments)


def test_missing_viser_gives_the_install_command(capsys, monkeypatch, capture):
    monkeypatch.setitem(sys.modules, "viser", None)
    assert "pip install 'taxel[web]'" in run_refused_command(capsys, "monitor", f"file:{capture}", "--web")


def test_web_option_prints_a_loopback_address_with_a_token(capsys, capture):
    pytest.importorskip("viser")
    arguments = ("monitor", f"file:{capture}", "--speed", 50, "--web", "--port", 0, "--seconds", 5)
    assert run_taxel(*arguments) == 0
    assert re.search(
        r"the skin is at http://127\.0\.0\.1:\d+/\?token=[\w-]{32} \(press Ctrl-C to quit\)", capsys.readouterr().out
    )
