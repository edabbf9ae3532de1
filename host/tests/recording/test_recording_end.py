"""A recording ends at the requested duration, and its summary describes the file, also at full speed."""

import json

import pytest

from host.tests.command_line import run_refused_command, run_taxel
from taxel.link import CaptureLink, CaptureWriter, Chunk
from taxel.skin.capture_bytes import CaptureBytes
from taxel.skin.recorder import open_recorded

SECONDS = 1.0
CYCLE_S = 0.06
"""Longest poll cycle of the emulated hand, seconds."""


def replay(capsys, path):
    """Return the summary of `taxel replay --json`."""
    capsys.readouterr()
    assert run_taxel("replay", path, "--json") == 0
    return json.loads(capsys.readouterr().out)


def read_last_line(capsys):
    """Return the totals that `taxel record` has printed in its last line."""
    return capsys.readouterr().out.strip().splitlines()[-1]


def format_totals(summary):
    """Return the totals of a summary as `taxel record` prints them."""
    return (
        f"frames: {summary['frames_received']} received, {summary['frames_lost_on_wire']} lost on the wire; "
        f"bytes: {summary['bytes_received']} received, {summary['bytes_discarded']} discarded"
    )


@pytest.mark.parametrize("name", ["skin.bin", "skin.mcap", "skin.pcapng"])
def test_recording_at_full_speed_has_the_requested_duration(capsys, tmp_path, name):
    path = tmp_path / name
    assert run_taxel("record", "emulator:?speed=max", "--seconds", SECONDS, "--out", path) == 0
    printed = read_last_line(capsys)
    summary = replay(capsys, path)
    assert SECONDS - CYCLE_S <= summary["seconds"] <= SECONDS + CYCLE_S
    assert printed == format_totals(summary)
    assert summary["bytes_discarded"] == 0


@pytest.mark.parametrize("name", ["skin.bin", "skin.mcap", "skin.pcapng"])
@pytest.mark.parametrize("taken", [0, 1, 40])
def test_recording_contains_the_frames_that_the_reader_has_received(capsys, tmp_path, name, taken):
    path = tmp_path / name
    with open_recorded("emulator:?speed=max&duration_s=2", path) as skin:
        frames = [frame for _, frame in zip(range(taken), skin, strict=False)]
        skin.end_recording()
        received, counted = skin.bytes_received, sum(board.received for board in skin.losses.boards.values())
    summary = replay(capsys, path)
    assert sum(board["frames"] for board in summary["boards"]) == counted == len(frames) == taken
    assert summary["bytes_received"] == received


def test_a_recording_of_a_complete_stream_contains_all_its_frames(capsys, tmp_path):
    path = tmp_path / "skin.bin"
    with open_recorded("emulator:?speed=max&duration_s=1", path) as skin:
        count = sum(1 for _ in skin)
    assert sum(board["frames"] for board in replay(capsys, path)["boards"]) == count


def test_negative_duration_is_refused(capsys, tmp_path):
    assert "--seconds" in run_refused_command(
        capsys, "record", "emulator:", "--seconds", -1, "--out", tmp_path / "x.bin"
    )
    assert not (tmp_path / "x.bin").exists()


@pytest.mark.parametrize("position", range(13))
def test_capture_can_be_cut_at_any_byte(tmp_path, position):
    path = tmp_path / "x.bin"
    writer = CaptureBytes(CaptureWriter(path))
    chunks = [Chunk(b"abc", 10), Chunk(b"defg", 20), Chunk(b"h", 30), Chunk(b"ijkl", 40)]
    for chunk in chunks:
        writer.write(*chunk)
    writer.confirm(min(position, 5))  # the first bytes cannot be cut off any more: at most 5, inside the second chunk
    writer.cut(position)
    writer.close()
    data, times = b"", []
    with CaptureLink(path) as link:
        try:
            while True:
                chunk = link.read()
                data += chunk.data
                times.append(chunk.arrival_ns)
        except EOFError:
            pass
    assert data == b"abcdefghijkl"[:position]
    assert times == [10, 20, 30, 40][: len(times)]


def test_memory_of_a_capture_is_bounded_by_unconfirmed_bytes(tmp_path):
    writer = CaptureBytes(CaptureWriter(tmp_path / "x.bin"))
    for number in range(1000):
        writer.write(b"data", number)
        writer.confirm(4 * number)
    assert len(writer._unconfirmed) <= 2
    writer.close()
