"""Playback of a recording on a pseudo-terminal, to a host that opens it as a hub and to a program that only reads."""

import queue
import threading
import time

import pytest
import serial

import taxel
from host.tests.command_line import run_refused_command, run_taxel
from host.tests.recordings import TABLE_FIELDS, find_differing_fields
from taxel.link import CaptureError, CaptureWriter
from taxel.recording.formats import convert, open_recording
from taxel.recording.formats.virtual_port import VirtualPort


class Player:
    """Playback of a recording on a pseudo-terminal in a separate thread.

    port: the virtual port. has_ended: whether the recording was played to its end; None while it plays.
    """

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


def read_frames_of(skin, count):
    """Read up to `count` frames of a skin, for at most 20 seconds."""
    frames = []
    deadline = time.monotonic() + 20.0
    while len(frames) < count and time.monotonic() < deadline:
        frames += skin.poll(0.1)
    return frames


@pytest.mark.parametrize("name", ["x.bin", "x.csv"])
def test_host_opens_the_port_as_a_hub_and_receives_every_frame(recorded_rig, tmp_path, name):
    path = tmp_path / name
    convert(recorded_rig.path, path)
    with (
        Player(path, recorded_rig.hand) as player,
        taxel.open(f"serial://{player.port.device}", recorded_rig.hand) as skin,
    ):
        assert skin.missing_boards == []
        frames = read_frames_of(skin, len(recorded_rig.frames))
        assert skin.losses.lost_on_wire == 0
    assert find_differing_fields(frames, recorded_rig.frames, *TABLE_FIELDS) == []
    assert player.has_ended


def test_program_that_only_reads_receives_the_recorded_bytes_up_to_their_end(recorded_rig, monkeypatch):
    monkeypatch.setattr("taxel.recording.formats.virtual_port.HANDSHAKE_TIMEOUT_S", 0.1)  # the program sends nothing
    with Player(recorded_rig.path, recorded_rig.hand) as player, serial.Serial(player.port.device, timeout=0.5) as port:
        data = b"".join(iter(lambda: port.read(65_536), b""))
    link, _ = open_recording(recorded_rig.path)
    recorded_bytes = b""
    try:
        while True:
            recorded_bytes += link.read().data
    except EOFError:
        link.close()
    # The playback replaces the bytes before the first taxel frame by empty log frames, so only the end is compared.
    assert len(data) > 0.9 * len(recorded_bytes)
    assert recorded_bytes.endswith(data[-50_000:])


def test_playback_ends_incomplete_if_the_host_closes_the_port_early(recorded_rig):
    player = Player(recorded_rig.path, recorded_rig.hand, speed=1.0)
    with player, taxel.open(f"serial://{player.port.device}", recorded_rig.hand) as skin:
        assert len(read_frames_of(skin, 5)) >= 5
    assert player.has_ended is False


def test_playback_takes_at_least_the_recorded_time_divided_by_the_speed(recorded_rig, monkeypatch):
    monkeypatch.setattr("taxel.recording.formats.virtual_port.HANDSHAKE_TIMEOUT_S", 0.1)
    speed = 16.0
    started_s = time.monotonic()
    with (
        Player(recorded_rig.path, recorded_rig.hand, speed) as player,
        serial.Serial(player.port.device, timeout=1.0) as port,
    ):
        while port.read(65_536):
            pass
    recorded_s = recorded_rig.frames[-1].time_s - recorded_rig.frames[0].time_s
    assert time.monotonic() - started_s > recorded_s / speed


def test_playback_of_a_recording_without_frames_is_refused(tmp_path, recorded_rig):
    CaptureWriter(tmp_path / "empty.bin").close()
    with pytest.raises(CaptureError, match="has no taxel frame to play"):
        VirtualPort(lambda: open_recording(tmp_path / "empty.bin")[0], recorded_rig.hand)


def test_playback_with_an_invalid_speed_is_refused(recorded_rig, capsys):
    assert "--speed: expected max or a number" in run_refused_command(
        capsys, "replay", recorded_rig.path, "--speed", "fast"
    )


def test_command_prints_the_port_and_the_result_of_the_playback(recorded_rig, monkeypatch, capsys):
    devices = queue.Queue()

    class ReportingPort(VirtualPort):
        """A virtual port that also reports its device to the test."""

        def __init__(self, *arguments):
            super().__init__(*arguments)
            devices.put(self.device)

    monkeypatch.setattr("taxel.cli.replay.VirtualPort", ReportingPort)
    status = []
    command = threading.Thread(
        target=lambda: status.append(run_taxel("replay", recorded_rig.path, "--to", "pty", "--speed", "max"))
    )
    command.start()
    device = devices.get(timeout=20.0)
    with taxel.open(f"serial://{device}", recorded_rig.hand) as skin:
        assert len(read_frames_of(skin, len(recorded_rig.frames))) == len(recorded_rig.frames)
    command.join(timeout=20.0)
    assert status == [0]
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == device
    assert "played to its end" in lines[1]
