"""Every frame that was sent is received or counted as lost, and every board's missing frames are known."""

from __future__ import annotations

import random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taxel.errors import TaxelError
from taxel.link import CaptureError, CaptureLink, Chunk
from taxel.stream import FrameStream, HubClient
from taxel_protocol import ReferenceDecoder

BOARDS = (0x20, 0x23, 0x77)


def drain(stream):
    """(frames, how the stream ended)."""
    frames = []
    try:
        while True:
            stream.poll()
            while stream.frames:
                frames.append(stream.frames.popleft())
    except (EOFError, TaxelError) as end:
        return frames, end


@pytest.fixture(scope="session")
def account_of(prepared, cut):
    """Count a stream that comes in pieces of the given sizes, which repeat."""

    def count(data, sizes=(10_000,)):
        stream = FrameStream(prepared(cut(data, sizes), one_at_a_time=True), lambda message: None)
        drain(stream)
        return stream.losses

    return count


def cycles(hub, count, first=0, boards=BOARDS):
    """(board or None, wire bytes) of every frame of `count` poll cycles."""
    sent = []
    for cycle in range(first, first + count):
        sent += [(board, hub.taxels(board, cycle)) for board in boards]
        if cycle % 7 == 0:
            sent.append((None, hub.log()))
    return sent


def test_a_whole_stream_has_no_losses(account_of, hub):
    account = account_of(b"".join(wire for _, wire in cycles(hub, 20)))
    assert (account.frames_received, account.lost_on_wire, account.restarts) == (63, 0, 0)
    assert account.frames_sent == 63
    counts = {address: tuple(count) for address, count in account.boards.items()}
    assert counts == dict.fromkeys(BOARDS, (20, 0, 0))


def test_a_stream_heard_from_its_middle_has_no_losses_before(account_of, make_hub):
    hub = make_hub(40_000)
    assert account_of(b"".join(wire for _, wire in cycles(hub, 5, first=600))).lost_on_wire == 0


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32), first=st.sampled_from([0, 65_400, 65_535]), rate=st.sampled_from([0.01, 0.2, 0.9]))
def test_dropped_frames_are_counted_exactly(account_of, make_hub, seed, first, rate):
    rng = random.Random(seed)
    hub = make_hub(first)  # sequence and cycle numbers wrap at 65,536 in most examples
    sent = cycles(hub, 100, first)
    kept = [0, *(i for i in range(1, len(sent)) if rng.random() > rate)]
    sizes = [rng.randrange(1, 300) for _ in range(5)]
    account = account_of(b"".join(sent[i][1] for i in kept), sizes)
    span = kept[-1] + 1  # what was dropped after the last one that arrived, nobody can know
    assert account.frames_received == len(kept)
    assert account.frames_sent == account.frames_received + account.lost_on_wire == span
    for board in BOARDS:
        all_of_it = [i for i, (address, _) in enumerate(sent) if address == board]
        arrived = [i for i in all_of_it if i in set(kept)]
        if not arrived:
            assert board not in account.boards
            continue
        between = [i for i in all_of_it if arrived[0] <= i <= arrived[-1]]
        count = account.boards[board]
        assert (count.received, count.missing) == (len(arrived), len(between) - len(arrived))


@pytest.mark.parametrize("lost", [1, 2, 1000, 65_535])
def test_a_gap_is_exact_up_to_65535_frames(account_of, make_hub, lost):
    hub = make_hub(65_000)
    first = hub.log()
    hub.sequence = (hub.sequence + lost) % 65536
    assert account_of(first + hub.log()).lost_on_wire == lost


def test_bytes_damaged_on_the_wire_are_a_lost_frame(account_of, hub):
    parts = [hub.taxels(0x20, cycle) for cycle in range(5)]
    parts[2] = parts[2][:10] + bytes([parts[2][10] ^ 4 or 1]) + parts[2][11:]
    account = account_of(b"".join(parts))
    assert (account.frames_received, account.lost_on_wire) == (4, 1)
    assert account.boards[0x20].missing == 1


def test_a_frame_with_a_wrong_board_crc_is_damaged_and_not_missing(hub, prepared, cut):
    parts = [hub.taxels(0x20, cycle, damage=cycle == 2) for cycle in range(5)]
    stream = FrameStream(prepared(cut(b"".join(parts))), lambda message: None)
    stream.poll()
    assert [frame.cycle for frame in stream.frames] == [0, 1, 3, 4]
    count = stream.losses.boards[0x20]
    assert (count.received, count.missing, count.damaged) == (4, 0, 1)
    assert (stream.losses.frames_received, stream.losses.lost_on_wire) == (5, 0)


def test_a_wrong_board_crc_is_seen_on_boards_of_every_size(account_of, hub):
    """A board's CRC is told from the frame's by a table for each size of board, of which there are few, then read."""
    rng = np.random.default_rng(1)
    sizes = [1, 2, 3, 7, 8, 15, 16, 29, 63, 64, 77, 100, 113, 128, 199, 240]
    sent = [
        (0x20 + place, cycle, hub.taxels(0x20 + place, cycle, rng.integers(0, 65536, size), damage=damage))
        for cycle, damages in enumerate(([0] * 16, [1 << int(rng.integers(0, 32)) for _ in sizes], [0] * 16))
        for place, (size, damage) in enumerate(zip(sizes, damages, strict=True))
    ]
    account = account_of(b"".join(wire for _, _, wire in sent))
    assert {(count.received, count.damaged) for count in account.boards.values()} == {(2, 1)}
    assert len(account.boards) == len(sizes)


@pytest.mark.parametrize("size", [1, 50, 10_000], ids=["byte by byte", "in pieces", "at once"])
def test_a_hub_that_restarts_begins_anew_and_loses_nothing(account_of, make_hub, size):
    before = make_hub(500)
    after = make_hub(0)
    data = b"".join(wire for _, wire in cycles(before, 10, first=900))
    data += after.handshake(tag=0) + after.handshake(tag=1) + b"".join(wire for _, wire in cycles(after, 10, first=0))
    account = account_of(data, [size])
    assert account.restarts == 1
    assert account.lost_on_wire == 0
    assert all((count.received, count.missing) == (20, 0) for count in account.boards.values())


def test_losses_just_before_a_restart_do_not_blur_it(account_of, make_hub):
    before, after = make_hub(10), make_hub(0)
    data = before.taxels(0x20, 5)
    before.log()  # lost, and with the hub its number
    data += after.handshake() + after.taxels(0x20, 0)
    account = account_of(data)
    assert (account.restarts, account.lost_on_wire, account.boards[0x20].missing) == (1, 0, 0)


def test_the_first_handshake_of_a_hub_is_not_a_restart(account_of, hub):
    assert account_of(hub.handshake() + hub.handshake(tag=1) + hub.log()).restarts == 0


def test_a_requested_handshake_with_sequence_0_is_not_a_restart(account_of, make_hub):
    hub = make_hub(65_535)
    account = account_of(hub.taxels(0x20, 1) + hub.handshake(tag=5) + hub.taxels(0x20, 2))
    assert (account.restarts, account.lost_on_wire) == (0, 0)


def test_a_board_that_goes_and_comes_back_misses_the_cycles_between(account_of, hub):
    data = b"".join(wire for _, wire in cycles(hub, 3, 0))
    data += b"".join(wire for _, wire in cycles(hub, 4, 3, boards=BOARDS[1:]))
    data += b"".join(wire for _, wire in cycles(hub, 2, 7))
    account = account_of(data)
    assert account.boards[0x20].missing == 4
    assert account.boards[0x23].missing == 0
    assert account.lost_on_wire == 0


@settings(max_examples=15, deadline=None)
@given(sizes=st.lists(st.integers(1, 400), min_size=1, max_size=5), one=st.booleans())
def test_frames_come_out_the_same_however_they_arrive(make_hub, prepared, cut, sizes, one):
    hub = make_hub()
    data = b"".join(wire for _, wire in cycles(hub, 30))
    stream = FrameStream(prepared(cut(data, sizes), one_at_a_time=one), lambda message: None)
    frames, _ = drain(stream)
    assert [(frame.cycle, frame.address) for frame in frames] == [(c, a) for c in range(30) for a in BOARDS]
    assert stream.bytes_received == len(data)
    assert stream.bytes_discarded == 0


def test_a_failure_comes_after_every_frame_that_stands_before_it(hub, prepared, cut):
    data = b"".join(wire for _, wire in cycles(hub, 10))
    failure = CaptureError("a.bin", "is cut short")
    link = prepared(cut(data, [100]), end=failure)
    stream = FrameStream(link, lambda message: None)
    frames, end = drain(stream)
    assert end is failure
    assert len(frames) == 30
    with pytest.raises(CaptureError):
        stream.poll()
    stream.close()
    assert link.closed


def test_a_last_frame_without_its_delimiter_is_delivered(hub, prepared, cut):
    data = hub.taxels(0x20, 1)[:-1]
    stream = FrameStream(prepared(cut(data)), lambda message: None)
    frames, _ = drain(stream)
    assert len(frames) == 1


def test_messages_are_told_in_order_with_their_fields(hub, prepared, cut):
    data = hub.handshake(tag=3, uptime_us=17) + hub.log(b"one") + hub.taxels(0x20, 1) + hub.sync(0x20, 5, 6)
    data += hub.log(b"two")
    client = HubClient(prepared(cut(data)))
    client.stream.poll()
    assert client.last_handshake is not None
    assert (client.last_handshake["tag"], client.last_handshake["uptime_us"]) == (3, 17)
    assert list(client.logs) == ["one", "two"]


def test_a_board_that_scans_more_slowly_than_it_is_polled_misses_nothing(account_of, hub):
    data = b"".join(hub.taxels(0x20, cycle, board_sequence=cycle // 4) for cycle in range(0, 80, 4))
    assert account_of(data).boards[0x20].missing == 0


def test_a_lost_frame_of_a_slow_board_is_missing(account_of, hub):
    parts = [hub.taxels(0x20, cycle, board_sequence=cycle // 4) for cycle in range(0, 80, 4)]
    assert account_of(b"".join(parts[:5] + parts[6:])).boards[0x20].missing == 1


def test_a_board_whose_every_frame_is_damaged_is_counted_and_gives_no_frame(hub, prepared, cut):
    data = b"".join(hub.taxels(0x20, cycle, damage=1) for cycle in range(3))
    stream = FrameStream(prepared(cut(data)), lambda message: None)
    frames, _ = drain(stream)
    assert frames == []
    assert {address: tuple(count) for address, count in stream.losses.boards.items()} == {0x20: (0, 0, 3)}


def test_a_capture_that_another_program_wrote_is_read(hub, tmp_path):
    """Its bytes are those of part 4 of protocol/SPEC.md, written here number by number."""
    frame = hub.taxels(0x20, 1)
    header = b'{"baud": 500000}'
    path = tmp_path / "a.bin"
    start = b"TAXELCAP" + b"\1\0" + b"\0\0" + bytes([len(header), 0, 0, 0])
    path.write_bytes(start + header + (2_000_000_000).to_bytes(8, "little") + bytes([len(frame), 0, 0, 0]) + frame)
    link = CaptureLink(path)
    assert (link.baud, link.read()) == (500_000.0, (frame, 2_000_000_000))
    with pytest.raises(EOFError):
        link.read()
    link.close()


def test_a_frame_that_ends_with_its_chunk_arrived_with_it(hub, prepared):
    data = [hub.log() + hub.taxels(0x20, i, hub_us=1_000_000 * i) for i in range(2)]
    chunks = [Chunk(data[i], 1_000_000_000 * (10 + i)) for i in range(2)]
    frames, _ = drain(FrameStream(prepared(chunks), lambda message: None))
    assert [frame.time_s for frame in frames] == pytest.approx([10.0, 11.0], abs=0.005)


def test_the_host_numbers_its_frames_modulo_65536(prepared, monkeypatch):
    link, written = prepared([]), []
    monkeypatch.setattr(link, "write", written.append)
    client = HubClient(link)
    for _ in range(65_537):
        client.send_stop()
    decoder = ReferenceDecoder()
    frames = [decoder.push(data)[0] for data in written[-3:]]
    assert [sequence for _, sequence, _ in frames] == [65_534, 65_535, 0]
