"""`taxel monitor` on an emulator, a port, a capture; on a terminal and in a pipe."""

from __future__ import annotations

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

from host.tests.command_line import exit_status, refusal
from taxel.cli import monitor as command

QUICK = ("--baseline", 5)


@pytest.fixture(scope="module")
def capture(tmp_path_factory):
    """Six tenths of a second of the emulated hand."""
    path = tmp_path_factory.mktemp("monitor") / "capture.bin"
    assert exit_status("record", "emulator:?speed=max", "--seconds", 0.6, "--out", path) == 0
    return path


def told(capsys, *words):
    """What the command prints on standard output, as JSON."""
    assert exit_status("monitor", *words, "--json") == 0
    return [json.loads(line) for line in capsys.readouterr().out.splitlines()]


def test_the_emulated_hand_is_told_once(capsys):
    (reading,) = told(capsys, "emulator:?speed=max", "--once", *QUICK)
    assert reading["boards_streaming"] == 17
    assert reading["baseline"] == 1.0
    assert reading["active"] == 0
    assert 18.0 < reading["scans_hz"] < 20.0
    assert reading["lost_on_wire"] == reading["missing"] == reading["damaged"] == 0


def test_a_port_is_watched(capsys, emulated_port):
    (reading,) = told(capsys, f"serial://{emulated_port}", "--once", *QUICK)
    assert reading["boards_streaming"] == 17
    assert reading["age_s"][0] < reading["age_s"][1] < 5.0


def test_a_capture_plays_to_its_end(capsys, capture):
    *_, last = told(capsys, f"file:{capture}", "--speed", 50, *QUICK)
    assert last["advice"] == f"{capture} has ended"
    capsys.readouterr()
    assert exit_status("replay", capture, "--json") == 0
    frames = sum(board["frames"] for board in json.loads(capsys.readouterr().out)["boards"])
    assert last["frames"] == frames > 100


def test_into_a_pipe_goes_a_line_a_reading(capsys, capture):
    assert exit_status("monitor", f"file:{capture}", "--speed", 50) == 0
    (line,) = capsys.readouterr().out.splitlines()
    assert re.search(r"17/17 boards, \d+ frames/s, baseline \d+ %", line)
    assert line.endswith("has ended")


def test_the_example_of_the_help_runs(capsys):
    (example,) = re.findall(r"Example: taxel (.*)", command.monitor.__doc__)
    assert exit_status(*shlex.split(example)) == 0
    assert "17/17 boards" in capsys.readouterr().out


class Terminal:
    """A terminal of `width` x `height` that keeps what is written on it."""

    def __init__(self, width: int, height: int) -> None:
        self.master, slave = os.openpty()
        fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", height, width, 0, 0))
        self.out, self.input = open(slave, "w"), open(os.dup(slave))  # noqa: SIM115
        self.seen = b""
        self._thread = threading.Thread(target=self._keep, daemon=True)
        self._thread.start()

    def _keep(self) -> None:
        with open(self.master, "rb", buffering=0, closefd=False) as screen:
            try:
                while data := screen.read(65536):
                    self.seen += data
            except OSError:  # the last one has left
                return

    def close(self) -> str:
        self.out.close()
        self.input.close()
        self._thread.join(timeout=10)
        os.close(self.master)
        return self.seen.decode()


@pytest.fixture
def terminal(monkeypatch):
    """The command's terminal, in true colour; close it for what was written."""
    made = Terminal(80, 24)
    monkeypatch.setattr(sys, "stdin", made.input)
    monkeypatch.setattr(
        command,
        "Console",
        lambda **how: Console(file=made.out, force_terminal=True, color_system="truecolor", width=80, height=24, **how),
    )
    return made


def test_the_screen_is_drawn_and_given_back(terminal, capture):
    modes = termios.tcgetattr(terminal.input.fileno())
    assert exit_status("monitor", f"file:{capture}", "--speed", 2, *QUICK) == 0
    assert termios.tcgetattr(terminal.input.fileno()) == modes
    seen = terminal.close()
    assert "taxel monitor" in seen
    begun, left = seen.index("\x1b[?1049h"), seen.index("\x1b[?1049l")
    assert begun < seen.index("▀") < left
    assert "has ended" in seen[left:]  # what is left on the user's screen


def test_keys_end_it_and_take_the_baseline_again(terminal, emulated_port):
    os.write(terminal.master, b"btq")  # typed before the skin was open
    assert exit_status("monitor", f"serial://{emulated_port}", *QUICK) == 0
    assert "\x1b[?1049l" in terminal.close()


@pytest.mark.parametrize("once", [(), ("--once",)])
def test_a_capture_without_frames_is_said_to_have_none(capsys, tmp_path, once):
    from taxel.link import CaptureWriter

    with CaptureWriter(tmp_path / "empty.bin"):
        pass
    status = exit_status("monitor", f"file:{tmp_path / 'empty.bin'}", *once)
    said = capsys.readouterr()
    assert "has ended without a frame" in said.out + said.err
    assert status == (1 if once else 0)


@pytest.mark.parametrize(
    ("words", "part"),
    [
        (("file:nothing.bin",), "nothing.bin: cannot be read"),
        (("/dev/nothing",), "/dev/nothing: cannot be opened"),
        (("emulator:", "--speed", 2), "a speed is for a recording"),
        (("emulator:", "--hand", "nobody"), "nobody"),
    ],
)
def test_a_mistake_is_one_line(capsys, words, part):
    assert part in refusal(capsys, "monitor", *words)


def test_a_page_needs_viser(capsys, monkeypatch, capture):
    monkeypatch.setitem(sys.modules, "viser", None)
    assert "pip install 'taxel[web]'" in refusal(capsys, "monitor", f"file:{capture}", "--web")


def test_the_page_is_on_this_computer_alone(capsys, capture):
    pytest.importorskip("viser")
    words = ("monitor", f"file:{capture}", "--speed", 50, "--web", "--port", 0, "--seconds", 5)
    assert exit_status(*words) == 0
    assert re.search(r"the skin is at http://127\.0\.0\.1:\d+/; Ctrl-C ends it", capsys.readouterr().out)
