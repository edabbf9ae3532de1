"""`taxel emulate`: a virtual serial port of this project's hub, or of the original hub."""

import io
import os
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path

import pytest
from rich.console import Console

from host.tests.command_line import run_refused_command
from taxel.cli import progress
from taxel.cli.emulate import print_port
from taxel.hand import load_hand
from taxel.hand.world import WorldSettings, format_world
from taxel.link.emulator import EmulatorLink
from taxel.link.errors import LinkError


def read_port(arguments: list[str], size: int) -> bytes:
    """Run `taxel emulate ARGUMENTS`, and read at least `size` bytes from its virtual serial port, for at most 10 s."""
    command = [str(Path(sys.executable).with_name("taxel")), "emulate", *arguments]
    data = b""
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            port = os.open(process.stdout.readline().strip(), os.O_RDONLY | os.O_NOCTTY)
            deadline = time.monotonic() + 10.0
            while len(data) < size and time.monotonic() < deadline:
                data += os.read(port, size)
            os.close(port)
        finally:
            process.terminate()
    return data


def test_the_port_of_the_original_hub_sends_messages_without_a_command():
    data = read_port(["--hand", "original", "--protocol", "original", "--seconds", "10"], size=3000)
    palm_address, palm_taxels = 0x15, 121
    # Start byte, length of the message (2 bytes for each taxel, 8 other bytes), address.
    message_start = bytes([0x01, 2 * palm_taxels + 8, palm_address])
    assert message_start in data


def test_an_unknown_protocol_is_rejected_with_the_known_ones(capsys):
    assert "expected taxel or original, found 'modbus'" in run_refused_command(
        capsys, "emulate", "--protocol", "modbus"
    )


@pytest.mark.parametrize(
    ("effect", "problem"),
    [
        ("foo", "--effect 'foo': expected 'effect NAME FORM key=value ...', found no form"),
        ("noise purple", "--effect 'noise purple': effect noise: expected one of the forms white, line, pink, impulse"),
    ],
)
def test_a_wrong_effect_is_named_by_its_option_and_not_by_a_temporary_file(capsys, effect, problem):
    line = run_refused_command(capsys, "emulate", "--effect", effect)
    assert problem in line
    assert "world.txt" not in line


def test_a_wrong_effect_of_a_url_is_quoted_without_a_temporary_file():
    world = format_world(load_hand("rig4"), WorldSettings(effects=["foo"]))
    with closing(EmulatorLink(world)) as link, pytest.raises(LinkError) as caught:
        link.read(10.0)
    assert "found 'effect foo'" in str(caught.value)
    assert "world.txt" not in str(caught.value)


def test_the_port_is_printed_with_its_use_on_a_terminal_and_alone_in_a_pipe(capsys, monkeypatch):
    monkeypatch.setattr("sys.stdout.isatty", lambda: True, raising=False)
    print_port("original", "/dev/pts/7")
    assert "taxel monitor serial:///dev/pts/7" in capsys.readouterr().out
    monkeypatch.setattr("sys.stdout.isatty", lambda: False, raising=False)
    print_port("original", "/dev/pts/7")
    assert capsys.readouterr().out == "/dev/pts/7\n"


def test_the_progress_bar_of_a_recording_shows_elapsed_and_total_seconds(monkeypatch):
    text = io.StringIO()
    console = Console(file=text, force_terminal=True, width=80)
    monkeypatch.setattr(progress, "_stderr_console", lambda: console)
    with progress.time_bar("recording x", 8.0) as show:
        show(2.0, "recording x: 40 frames")
    assert "2.0 of 8 s" in text.getvalue()
