"""A recording gives the frames that were live, and a damaged one everything before the damage."""

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


class Recording:
    """A link that keeps what another link brings, in records as short as those of a port."""

    def __init__(self, link, writer):
        self._link, self._writer = link, writer
        self.name, self.baud = link.name, link.baud
        self.is_real_time, self.is_recorded = link.is_real_time, link.is_recorded

    def read(self, timeout_s):
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


def record(hand, path, duration_s=1.5, stimulus=None):
    """Frames of a live skin that is recorded."""
    link = EmulatorLink(format_world(hand), stimulus, fast=True, duration_s=duration_s)
    with Skin(Recording(link, CaptureWriter(path, {"baud": 1e6})), hand) as skin:
        return list(skin), skin.losses.frames_received, skin.bytes_received


def chunks_of(path):
    """All records of a recording."""
    chunks = []
    with closing(CaptureLink(path)) as link, suppress(EOFError):
        while True:
            chunks.append(link.read())
    return chunks


def keep(skin, frames):
    """Append every frame; what ends the skin's frames leaves those before it kept."""
    for frame in skin:
        frames.append(frame)


def same(a, b):
    return a._replace(raw_counts=None, time_s=0) == b._replace(raw_counts=None, time_s=0) and np.array_equal(
        a.raw_counts, b.raw_counts
    )


@pytest.fixture(scope="module")
def recorded(tmp_path_factory, allegro):
    path = tmp_path_factory.mktemp("recorded") / "a.bin"
    frames, received, size = record(allegro, path)
    return path, frames, received, size


@pytest.mark.parametrize("name", ["allegro", "flat8"])
def test_a_recording_gives_the_frames_that_were_live(tmp_path, name):
    hand = taxel.load_hand(name)
    live, received, size = record(hand, tmp_path / "a.bin")
    with taxel.open(f"file:{tmp_path / 'a.bin'}", name) as skin:
        again = list(skin)
        assert (skin.losses.frames_received, skin.bytes_received) == (received, size)
        assert skin.missing_boards == []
    assert len(live) > 50
    assert len(again) == len(live)
    assert all(same(a, b) for a, b in zip(live, again, strict=True))


def test_a_truncated_recording_gives_what_stands_before_and_then_an_error(tmp_path, recorded):
    path, frames, _, _ = recorded
    data = path.read_bytes()
    cut = tmp_path / "cut.bin"
    counts = []
    for size in range(len(data) - 1, len(data) // 2, -9973):
        cut.write_bytes(data[:size])
        with taxel.open(f"file:{cut}") as skin:
            got = []
            with pytest.raises(CaptureError, match="cut short"):
                keep(skin, got)
        assert all(same(a, b) for a, b in zip(got, frames, strict=False))
        counts.append(len(got))
    assert counts == sorted(counts, reverse=True)
    assert counts[0] > 0.9 * len(frames)


def test_a_flipped_bit_costs_the_frame_it_hits(tmp_path, recorded):
    path, frames, received, _ = recorded
    chunks = chunks_of(path)
    middle = len(chunks) // 2
    data = bytearray(chunks[middle].data)
    data[len(data) // 2] ^= 0x10
    chunks[middle] = chunks[middle]._replace(data=bytes(data))
    with closing(CaptureWriter(tmp_path / "flipped.bin", {"baud": 1e6})) as writer:
        for chunk in chunks:
            writer.write(chunk.data, chunk.arrival_ns)
    with taxel.open(f"file:{tmp_path / 'flipped.bin'}") as skin:
        got = list(skin)
        assert skin.losses.frames_received + skin.losses.lost_on_wire == received
        assert skin.losses.lost_on_wire <= 2  # two, if the bit made a delimiter's neighbour
    assert len(frames) - len(got) <= 2


def test_a_recording_of_a_hand_with_other_boards_is_refused(recorded):
    with taxel.open(f"file:{recorded[0]}", "flat8") as skin, pytest.raises(UnknownBoardError) as caught:
        list(skin)
    assert "\n" not in str(caught.value)


def test_a_recording_of_a_hand_with_boards_of_another_size_is_refused(recorded, allegro):
    first, *others = allegro.boards
    (kind, *_) = (board.kind for board in others if board.kind.taxel_count != first.kind.taxel_count)
    mine = Hand("mine", "", 0.005, 0.003, (Board(first.name, kind, first.address), *others))
    with taxel.open(f"file:{recorded[0]}", mine) as skin, pytest.raises(BoardMismatchError, match="'mine'") as caught:
        list(skin)
    assert "\n" not in str(caught.value)


def test_an_empty_recording_is_an_end_and_no_error(tmp_path):
    CaptureWriter(tmp_path / "a.bin").close()
    with taxel.open(f"file:{tmp_path / 'a.bin'}") as skin:
        assert list(skin) == []
        with pytest.raises(TaxelError, match="0 scans"):
            skin.take_baseline()


def test_a_port_that_vanishes_mid_stream_leaves_the_frames_before_it(fake_hub, recorded, monkeypatch):
    """A hub plays a recording, and is unplugged."""
    link = CaptureLink(recorded[0])
    data = b""
    while len(data) < 8000:
        data += link.read().data
    link.close()
    hub = fake_hub(on_start=data)
    monkeypatch.setattr("taxel.skin.skin.DISCOVERY_TIMEOUT_S", 0.1)
    skin = taxel.open(hub.url)
    with taxel.open(f"file:{recorded[0]}") as replay:
        expected = list(itertools.islice(replay, 10))
    got = list(itertools.islice(skin, 10))
    assert all(same(a, b) for a, b in zip(got, expected, strict=True))
    hub.vanish()
    with pytest.raises(PortVanishedError) as caught:
        list(skin)
    assert hub.url.removeprefix("serial://") in str(caught.value)
    assert "\n" not in str(caught.value)
    skin.close()


def test_an_emulator_that_breaks_down_leaves_the_frames_before_it(tmp_path, flat8):
    path = tmp_path / "a.stm"
    write_stimulus(path, [0.0, 1.0, 2.0], np.full((3, 64), 777.0), "counts")
    path.write_bytes(path.read_bytes()[:-3])
    with taxel.open(f"emulator:?speed=max&stimulus={path}", "flat8") as skin:
        frames = []
        with pytest.raises(PortVanishedError, match="ends inside a record"):
            keep(skin, frames)
    assert len(frames) > 50
    assert all((frame.raw_counts == 777).all() for frame in frames)
