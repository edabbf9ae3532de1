"""A recording behind a pseudo-terminal: a host opens it as a hub, and a program that only listens gets the bytes."""

from __future__ import annotations

import queue
import threading
import time

import pytest
import serial

import taxel
from host.tests.command_line import exit_status, refusal
from host.tests.recordings import KEPT, differences
from taxel.link import CaptureError, CaptureWriter
from taxel.recording.forms import convert, open_recording
from taxel.recording.forms.virtual_port import VirtualPort


class Player:
    """Plays a recording on a thread of its own."""

    def __init__(self, path, hand, speed=None):
        self.port = VirtualPort(lambda: open_recording(path)[0], hand, speed)
        self.has_ended = None
        self._thread = threading.Thread(target=self._play)
        self._thread.start()

    def _play(self):
        self.has_ended = self.port.play(wait_s=20.0)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._thread.join(timeout=20.0)
        self.port.close()


def read_all(skin, count):
    """Frames until there are as many, or none come for a while."""
    frames = []
    deadline = time.monotonic() + 20.0
    while len(frames) < count and time.monotonic() < deadline:
        frames += skin.poll(0.1)
    return frames


@pytest.mark.parametrize("name", ["x.bin", "x.csv"])
def test_a_host_opens_the_port_as_a_hub_and_gets_every_frame(small, tmp_path, name):
    path = tmp_path / name
    convert(small.path, path)
    with Player(path, small.hand) as player, taxel.open(f"serial://{player.port.device}", small.hand) as skin:
        assert skin.missing_boards == []
        frames = read_all(skin, len(small.frames))
        assert skin.losses.lost_on_wire == 0
    assert differences(frames, small.frames, *KEPT) == []
    assert player.has_ended


def test_a_program_that_only_listens_gets_the_recorded_bytes(small, monkeypatch):
    monkeypatch.setattr("taxel.recording.forms.virtual_port.PATIENCE_S", 0.1)
    with Player(small.path, small.hand) as player, serial.Serial(player.port.device, timeout=0.5) as port:
        data = b"".join(iter(lambda: port.read(65_536), b""))
    link, _ = open_recording(small.path)
    whole = b""
    try:
        while True:
            whole += link.read().data
    except EOFError:
        link.close()
    assert len(data) > 0.9 * len(whole)
    assert whole.endswith(data[-50_000:])


def test_a_port_that_is_closed_early_ends_the_play(small):
    player = Player(small.path, small.hand, speed=1.0)
    with player, taxel.open(f"serial://{player.port.device}", small.hand) as skin:
        assert len(read_all(skin, 5)) >= 5
    assert player.has_ended is False


def test_the_play_keeps_the_recordings_time(small, monkeypatch):
    """Not how long it takes, which depends on the machine: never earlier than it is due."""
    monkeypatch.setattr("taxel.recording.forms.virtual_port.PATIENCE_S", 0.1)
    begun = time.monotonic()
    with (
        Player(small.path, small.hand, speed=16.0) as player,
        serial.Serial(player.port.device, timeout=1.0) as port,
    ):
        while port.read(65_536):
            pass
    span_s = small.frames[-1].time_s - small.frames[0].time_s
    assert time.monotonic() - begun > span_s / 16.0


def test_a_recording_without_frames_and_a_strange_speed_are_one_line(tmp_path, small, capsys):
    CaptureWriter(tmp_path / "empty.bin").close()
    with pytest.raises(CaptureError, match="has no taxel frame to play"):
        VirtualPort(lambda: open_recording(tmp_path / "empty.bin")[0], small.hand)
    assert "--speed: expected max or a number" in refusal(capsys, "replay", small.path, "--speed", "fast")


def test_the_command_prints_the_port_and_what_became_of_it(small, monkeypatch, capsys):
    made = queue.Queue()

    class Told(VirtualPort):
        def __init__(self, *arguments):
            super().__init__(*arguments)
            made.put(self.device)

    monkeypatch.setattr("taxel.cli.replay.VirtualPort", Told)
    status = []
    command = threading.Thread(
        target=lambda: status.append(exit_status("replay", small.path, "--to", "pty", "--speed", "max"))
    )
    command.start()
    device = made.get(timeout=20.0)
    with taxel.open(f"serial://{device}", small.hand) as skin:
        assert len(read_all(skin, len(small.frames))) == len(small.frames)
    command.join(timeout=20.0)
    assert status == [0]
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == device
    assert "played to its end" in lines[1]
