"""Recorded skins: the frames of a recording, and the frames before its damage or its end."""

import itertools
from contextlib import closing, suppress

import numpy as np
import pytest

import taxel
from taxel.errors import TaxelError
from taxel.hand import Board, Hand, UnknownBoardError
from taxel.hand.world import format_world
from taxel.link import CaptureError, CaptureLink, CaptureWriter, EmulatorLink, PortVanishedError, write_stimulus
from taxel.skin import BoardMismatchError, Skin


class RecordedLink:
    """A link that records the bytes of another link in records of at most 500 bytes, like those of a serial port."""

    def __init__(self, link, writer):
        self._link, self._writer = link, writer
        self.name, self.baud = link.name, link.baud
        self.is_real_time, self.is_recorded = link.is_real_time, link.is_recorded

    def read(self, timeout_s):
        """Read a chunk of the other link and record it, divided into records of at most 500 bytes."""
        chunk = self._link.read(timeout_s)
        if chunk is not None:
            for start in range(0, len(chunk.data), 500):
                self._writer.write(chunk.data[start : start + 500], chunk.arrival_ns)
        return chunk

    def write(self, data):
        self._link.write(data)

    def close(self):
        self._link.close()
        self._writer.close()


def record_skin(hand, path, duration_s=1.5, stimulus=None):
    """Record an emulated skin; return its frames, the number of frames received, and the number of bytes."""
    link = EmulatorLink(format_world(hand), stimulus, fast=True, duration_s=duration_s)
    with Skin(RecordedLink(link, CaptureWriter(path, {"baud": 1e6})), hand) as skin:
        return list(skin), skin.losses.frames_received, skin.bytes_received


def read_chunks(path):
    """Return all records of a capture file."""
    chunks = []
    with closing(CaptureLink(path)) as link, suppress(EOFError):
        while True:
            chunks.append(link.read())
    return chunks


def collect_frames(skin, frames):
    """Append the frames of a skin to the list `frames`; after an exception, it has the frames before it."""
    for frame in skin:
        frames.append(frame)


def is_same_frame(a, b):
    """Return whether two frames are equal except for the time on the host."""
    return a._replace(raw_counts=None, time_s=0) == b._replace(raw_counts=None, time_s=0) and np.array_equal(
        a.raw_counts, b.raw_counts
    )


@pytest.fixture(scope="module")
def recording(tmp_path_factory, allegro):
    """Path of a recording of the emulated Allegro hand, its frames, the number of frames, and the number of bytes."""
    path = tmp_path_factory.mktemp("recorded") / "a.bin"
    frames, received, size = record_skin(allegro, path)
    return path, frames, received, size


@pytest.mark.parametrize("name", ["allegro", "flat8"])
def test_a_recording_gives_the_same_frames_as_the_live_skin(tmp_path, name):
    hand = taxel.load_hand(name)
    live_frames, received, size = record_skin(hand, tmp_path / "a.bin")
    with taxel.open(f"file:{tmp_path / 'a.bin'}", name) as skin:
        replayed_frames = list(skin)
        assert (skin.losses.frames_received, skin.bytes_received) == (received, size)
        assert skin.missing_boards == []
    assert len(live_frames) > 50
    assert len(replayed_frames) == len(live_frames)
    assert all(is_same_frame(a, b) for a, b in zip(live_frames, replayed_frames, strict=True))


def test_a_truncated_recording_gives_the_frames_before_the_truncation_and_then_an_error(tmp_path, recording):
    path, frames, _, _ = recording
    data = path.read_bytes()
    truncated = tmp_path / "truncated.bin"
    frame_counts = []
    for size in range(len(data) - 1, len(data) // 2, -9973):  # a prime step: truncation at varying positions
        truncated.write_bytes(data[:size])
        with taxel.open(f"file:{truncated}", "allegro") as skin:
            replayed_frames = []
            with pytest.raises(CaptureError, match="cut short"):
                collect_frames(skin, replayed_frames)
        assert all(is_same_frame(a, b) for a, b in zip(replayed_frames, frames, strict=False))
        frame_counts.append(len(replayed_frames))
    assert frame_counts == sorted(frame_counts, reverse=True)
    assert frame_counts[0] > 0.9 * len(frames)


def test_a_flipped_bit_in_a_recording_loses_at_most_two_frames(tmp_path, recording):
    path, frames, received, _ = recording
    chunks = read_chunks(path)
    middle = len(chunks) // 2
    data = bytearray(chunks[middle].data)
    data[len(data) // 2] ^= 0x10
    chunks[middle] = chunks[middle]._replace(data=bytes(data))
    with closing(CaptureWriter(tmp_path / "flipped.bin", {"baud": 1e6})) as writer:
        for chunk in chunks:
            writer.write(chunk.data, chunk.arrival_ns)
    with taxel.open(f"file:{tmp_path / 'flipped.bin'}", "allegro") as skin:
        replayed_frames = list(skin)
        assert skin.losses.frames_received + skin.losses.lost_on_wire == received
        assert skin.losses.lost_on_wire <= 2  # two if the flipped bit damages a delimiter between two frames
    assert len(frames) - len(replayed_frames) <= 2


def test_a_recording_with_unknown_boards_is_refused(recording):
    with taxel.open(f"file:{recording[0]}", "flat8") as skin, pytest.raises(UnknownBoardError) as caught:
        list(skin)
    assert "\n" not in str(caught.value)


def test_a_recording_with_boards_of_another_size_is_refused(recording, allegro):
    first_board, *other_boards = allegro.boards
    (other_kind, *_) = (board.kind for board in other_boards if board.kind.taxel_count != first_board.kind.taxel_count)
    changed_hand = Hand(
        "changed", "", 0.005, 0.003, (Board(first_board.name, other_kind, first_board.address), *other_boards)
    )
    with (
        taxel.open(f"file:{recording[0]}", changed_hand) as skin,
        pytest.raises(BoardMismatchError, match="'changed'") as caught,
    ):
        list(skin)
    assert "\n" not in str(caught.value)


def test_an_empty_recording_gives_no_frames_and_no_error(tmp_path):
    CaptureWriter(tmp_path / "a.bin").close()
    with taxel.open(f"file:{tmp_path / 'a.bin'}", "allegro") as skin:
        assert list(skin) == []
        with pytest.raises(TaxelError, match="0 scans"):
            skin.take_baseline()


def test_frames_received_before_the_port_vanishes_are_delivered(fake_hub, recording, monkeypatch):
    # The hub sends the first 8000 bytes of a recording and is then unplugged.
    link = CaptureLink(recording[0])
    data = b""
    while len(data) < 8000:
        data += link.read().data
    link.close()
    hub = fake_hub(on_start=data)
    monkeypatch.setattr("taxel.skin.skin.DISCOVERY_TIMEOUT_S", 0.1)
    skin = taxel.open(hub.url, "allegro")
    with taxel.open(f"file:{recording[0]}", "allegro") as replay:
        expected = list(itertools.islice(replay, 10))
    received_frames = list(itertools.islice(skin, 10))
    assert all(is_same_frame(a, b) for a, b in zip(received_frames, expected, strict=True))
    hub.unplug()
    with pytest.raises(PortVanishedError) as caught:
        list(skin)
    assert hub.url.removeprefix("serial://") in str(caught.value)
    assert "\n" not in str(caught.value)
    skin.close()


def test_frames_sent_before_the_emulator_fails_are_delivered(tmp_path, flat8):
    path = tmp_path / "a.stm"
    write_stimulus(path, [0.0, 1.0, 2.0], np.full((3, 64), 777.0), "counts")
    path.write_bytes(path.read_bytes()[:-3])
    with taxel.open(f"emulator:?speed=max&stimulus={path}", "flat8") as skin:
        frames = []
        with pytest.raises(PortVanishedError, match="ends inside a record"):
            collect_frames(skin, frames)
    assert len(frames) > 50
    assert all((frame.raw_counts == 777).all() for frame in frames)
