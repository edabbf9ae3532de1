"""Every sent frame is received or counted as lost, and missing frames are counted per board."""

import random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taxel.errors import TaxelError
from taxel.link import CaptureError, CaptureLink, Chunk
from taxel.stream import FrameStream, HubClient
from taxel.stream.accounting import LossAccount
from taxel.stream.decoder import StreamDecoder
from taxel_protocol import FrameType, ReferenceDecoder, crc32, encode_body, encode_frame
from taxel_protocol.frames import FRAMES

BOARDS = (0x20, 0x23, 0x77)


def drain(stream):
    """Read the stream to its end; return (frames, exception that ended it)."""
    frames = []
    try:
        while True:
            stream.poll()
            while stream.frames:
                frames.append(stream.frames.popleft())
    except (EOFError, TaxelError) as end:
        return frames, end


@pytest.fixture(scope="session")
def count_losses(make_prepared_link, divide):
    """Function that counts the losses of a stream in pieces of the given sizes, which repeat."""

    def count(data, sizes=(10_000,)):
        stream = FrameStream(make_prepared_link(divide(data, sizes), reads_single_chunks=True), lambda message: None)
        drain(stream)
        return stream.losses

    return count


def make_cycles(hub, count, first=0, boards=BOARDS):
    """Make the frames of `count` poll cycles: (address of the board, None for a log frame; wire bytes)."""
    sent = []
    for cycle in range(first, first + count):
        sent += [(board, hub.encode_taxels(board, cycle)) for board in boards]
        if cycle % 7 == 0:
            sent.append((None, hub.encode_log()))
    return sent


def test_a_complete_stream_has_no_losses(count_losses, hub):
    account = count_losses(b"".join(wire for _, wire in make_cycles(hub, 20)))
    frame_count = 3 * 20 + 3  # taxel frames of three boards and a log frame every seven cycles
    assert (account.frames_received, account.lost_on_wire, account.restarts) == (frame_count, 0, 0)
    assert account.frames_sent == frame_count
    counts = {address: tuple(count) for address, count in account.boards.items()}
    assert counts == dict.fromkeys(BOARDS, (20, 0, 0))  # received, missing, damaged


def test_frames_before_the_first_received_frame_are_not_counted_as_lost(count_losses, make_hub):
    hub = make_hub(40_000)
    assert count_losses(b"".join(wire for _, wire in make_cycles(hub, 5, first=600))).lost_on_wire == 0


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 2**32), first=st.sampled_from([0, 65_400, 65_535]), rate=st.sampled_from([0.01, 0.2, 0.9]))
def test_dropped_frames_are_counted_exactly(count_losses, make_hub, seed, first, rate):
    rng = random.Random(seed)
    hub = make_hub(first)  # sequence and cycle numbers wrap at 65,536 in most examples
    sent = make_cycles(hub, 100, first)
    received = [0, *(i for i in range(1, len(sent)) if rng.random() > rate)]
    sizes = [rng.randrange(1, 300) for _ in range(5)]
    account = count_losses(b"".join(sent[i][1] for i in received), sizes)
    span = received[-1] + 1  # losses after the last received frame are not detectable
    assert account.frames_received == len(received)
    assert account.frames_sent == account.frames_received + account.lost_on_wire == span
    for board in BOARDS:
        sent_by_board = [i for i, (address, _) in enumerate(sent) if address == board]
        arrived = [i for i in sent_by_board if i in set(received)]
        if not arrived:
            assert board not in account.boards
            continue
        between = [i for i in sent_by_board if arrived[0] <= i <= arrived[-1]]
        count = account.boards[board]
        assert (count.received, count.missing) == (len(arrived), len(between) - len(arrived))


@pytest.mark.parametrize("lost", [1, 2, 1000, 65_535])
def test_a_gap_is_exact_up_to_65535_frames(count_losses, make_hub, lost):
    hub = make_hub(65_000)
    first_frame = hub.encode_log()
    hub.sequence = (hub.sequence + lost) % 65536
    assert count_losses(first_frame + hub.encode_log()).lost_on_wire == lost


def test_a_frame_damaged_on_the_wire_is_lost(count_losses, hub):
    frames = [hub.encode_taxels(0x20, cycle) for cycle in range(5)]
    # The changed byte is not 0, which would be a delimiter.
    frames[2] = frames[2][:10] + bytes([frames[2][10] ^ 4 or 1]) + frames[2][11:]
    account = count_losses(b"".join(frames))
    assert (account.frames_received, account.lost_on_wire) == (4, 1)
    assert account.boards[0x20].missing == 1


def test_a_frame_with_a_wrong_board_crc_is_damaged_and_not_missing(hub, make_prepared_link, divide):
    frames = [hub.encode_taxels(0x20, cycle, damage=cycle == 2) for cycle in range(5)]
    stream = FrameStream(make_prepared_link(divide(b"".join(frames))), lambda message: None)
    stream.poll()
    assert [frame.cycle for frame in stream.frames] == [0, 1, 3, 4]
    count = stream.losses.boards[0x20]
    assert (count.received, count.missing, count.damaged) == (4, 0, 1)
    assert (stream.losses.frames_received, stream.losses.lost_on_wire) == (5, 0)


def test_a_wrong_board_crc_is_detected_for_every_board_size(count_losses, hub):
    # The decoder derives the board CRC from the frame CRC with a table per board size, and keeps few of these tables.
    rng = np.random.default_rng(1)
    sizes = [1, 2, 3, 7, 8, 15, 16, 29, 63, 64, 77, 100, 113, 128, 199, 240]
    sent = [
        (0x20 + position, cycle, hub.encode_taxels(0x20 + position, cycle, rng.integers(0, 65536, size), damage=damage))
        for cycle, damages in enumerate(([0] * 16, [1 << int(rng.integers(0, 32)) for _ in sizes], [0] * 16))
        for position, (size, damage) in enumerate(zip(sizes, damages, strict=True))
    ]
    account = count_losses(b"".join(wire for _, _, wire in sent))
    # Of the three frames of each board, only the second is damaged.
    assert {(count.received, count.damaged) for count in account.boards.values()} == {(2, 1)}
    assert len(account.boards) == len(sizes)


@pytest.mark.parametrize("size", [1, 50, 10_000], ids=["single bytes", "in pieces", "at once"])
def test_a_hub_restart_is_counted_and_gives_no_losses(count_losses, make_hub, size):
    hub_before = make_hub(500)
    hub_after = make_hub(0)
    data = b"".join(wire for _, wire in make_cycles(hub_before, 10, first=900))
    data += (
        hub_after.encode_handshake(tag=0)
        + hub_after.encode_handshake(tag=1)
        + b"".join(wire for _, wire in make_cycles(hub_after, 10, first=0))
    )
    account = count_losses(data, [size])
    assert account.restarts == 1
    assert account.lost_on_wire == 0
    assert all((count.received, count.missing) == (20, 0) for count in account.boards.values())


def test_a_restart_is_detected_after_a_lost_frame(count_losses, make_hub):
    hub_before, hub_after = make_hub(10), make_hub(0)
    data = hub_before.encode_taxels(0x20, 5)
    hub_before.encode_log()  # lost together with its sequence number
    data += hub_after.encode_handshake() + hub_after.encode_taxels(0x20, 0)
    account = count_losses(data)
    assert (account.restarts, account.lost_on_wire, account.boards[0x20].missing) == (1, 0, 0)


def test_a_restart_behind_a_closed_port_is_recognised_by_the_uptime(count_losses, make_hub):
    hub_before, hub_after = make_hub(5000), make_hub(3)  # the frames 0 to 2 of the restarted hub were lost
    data = hub_before.encode_handshake(tag=1, uptime_us=9_000_000) + hub_before.encode_taxels(0x20, 700)
    data += hub_after.encode_handshake(tag=2, uptime_us=2_000_000) + hub_after.encode_taxels(0x20, 0)
    account = count_losses(data)
    assert (account.restarts, account.lost_on_wire, account.boards[0x20].missing) == (1, 0, 0)


def test_frames_of_a_hub_that_kept_running_behind_a_closed_port_are_lost(count_losses, make_hub):
    hub_before, hub_after = make_hub(10), make_hub(500)
    data = hub_before.encode_handshake(tag=1, uptime_us=9_000_000) + hub_before.encode_taxels(0x20, 5)
    data += hub_after.encode_handshake(tag=2, uptime_us=11_000_000) + hub_after.encode_taxels(0x20, 40)
    account = count_losses(data)
    # Received: handshake 10, frame 11, handshake 500, frame 501; lost: 12 to 499.
    assert (account.restarts, account.lost_on_wire) == (0, 488)


def test_the_first_handshake_of_a_hub_is_not_a_restart(count_losses, hub):
    assert count_losses(hub.encode_handshake() + hub.encode_handshake(tag=1) + hub.encode_log()).restarts == 0


def test_a_requested_handshake_with_sequence_0_is_not_a_restart(count_losses, make_hub):
    hub = make_hub(65_535)
    account = count_losses(hub.encode_taxels(0x20, 1) + hub.encode_handshake(tag=5) + hub.encode_taxels(0x20, 2))
    assert (account.restarts, account.lost_on_wire) == (0, 0)


def test_a_board_absent_for_some_cycles_has_as_many_missing_frames(count_losses, hub):
    data = b"".join(wire for _, wire in make_cycles(hub, 3, 0))
    data += b"".join(wire for _, wire in make_cycles(hub, 4, 3, boards=BOARDS[1:]))
    data += b"".join(wire for _, wire in make_cycles(hub, 2, 7))
    account = count_losses(data)
    assert account.boards[0x20].missing == 4
    assert account.boards[0x23].missing == 0
    assert account.lost_on_wire == 0


@settings(max_examples=15, deadline=None)
@given(sizes=st.lists(st.integers(1, 400), min_size=1, max_size=5), reads_single=st.booleans())
def test_frames_do_not_depend_on_the_chunk_sizes(make_hub, make_prepared_link, divide, sizes, reads_single):
    hub = make_hub()
    data = b"".join(wire for _, wire in make_cycles(hub, 30))
    stream = FrameStream(
        make_prepared_link(divide(data, sizes), reads_single_chunks=reads_single), lambda message: None
    )
    frames, _ = drain(stream)
    assert [(frame.cycle, frame.address) for frame in frames] == [(c, a) for c in range(30) for a in BOARDS]
    assert stream.bytes_received == len(data)
    assert stream.bytes_discarded == 0


def test_a_link_failure_is_raised_after_all_frames_before_it(hub, make_prepared_link, divide):
    data = b"".join(wire for _, wire in make_cycles(hub, 10))
    failure = CaptureError("a.bin", "is cut short")
    link = make_prepared_link(divide(data, [100]), end=failure)
    stream = FrameStream(link, lambda message: None)
    frames, end = drain(stream)
    assert end is failure
    assert len(frames) == 30
    with pytest.raises(CaptureError):
        stream.poll()
    stream.close()
    assert link.is_closed


def test_a_last_frame_without_its_delimiter_is_delivered(hub, make_prepared_link, divide):
    data = hub.encode_taxels(0x20, 1)[:-1]
    stream = FrameStream(make_prepared_link(divide(data)), lambda message: None)
    frames, _ = drain(stream)
    assert len(frames) == 1


def test_hub_messages_are_delivered_in_order_with_their_fields(hub, make_prepared_link, divide):
    data = (
        hub.encode_handshake(tag=3, uptime_us=17)
        + hub.encode_log(b"one")
        + hub.encode_taxels(0x20, 1)
        + hub.encode_sync(0x20, 5, 6)
    )
    data += hub.encode_log(b"two")
    client = HubClient(make_prepared_link(divide(data)))
    client.stream.poll()
    assert client.last_handshake is not None
    assert (client.last_handshake["tag"], client.last_handshake["uptime_us"]) == (3, 17)
    assert list(client.logs) == ["one", "two"]


def test_a_board_with_a_scan_period_above_the_poll_period_has_no_missing_frames(count_losses, hub):
    data = b"".join(hub.encode_taxels(0x20, cycle, board_sequence=cycle // 4) for cycle in range(0, 80, 4))
    assert count_losses(data).boards[0x20].missing == 0


def test_a_lost_frame_of_a_slow_board_is_missing(count_losses, hub):
    frames = [hub.encode_taxels(0x20, cycle, board_sequence=cycle // 4) for cycle in range(0, 80, 4)]
    assert count_losses(b"".join(frames[:5] + frames[6:])).boards[0x20].missing == 1


def test_a_board_with_only_damaged_frames_is_counted_and_gives_no_frames(hub, make_prepared_link, divide):
    data = b"".join(hub.encode_taxels(0x20, cycle, damage=1) for cycle in range(3))
    stream = FrameStream(make_prepared_link(divide(data)), lambda message: None)
    frames, _ = drain(stream)
    assert frames == []
    counts = {address: tuple(count) for address, count in stream.losses.boards.items()}
    assert counts == {0x20: (0, 0, 3)}  # received, missing, damaged


def test_a_capture_written_according_to_the_specification_is_read(hub, tmp_path):
    # The bytes follow part 4 of protocol/SPEC.md.
    frame = hub.encode_taxels(0x20, 1)
    header = b'{"baud": 500000}'
    path = tmp_path / "a.bin"
    start = b"TAXELCAP" + b"\1\0" + b"\0\0" + bytes([len(header), 0, 0, 0])
    path.write_bytes(start + header + (2_000_000_000).to_bytes(8, "little") + bytes([len(frame), 0, 0, 0]) + frame)
    link = CaptureLink(path)
    assert (link.baud, link.read()) == (500_000.0, (frame, 2_000_000_000))
    with pytest.raises(EOFError):
        link.read()
    link.close()


def test_a_frame_that_ends_with_a_chunk_has_the_arrival_time_of_that_chunk(hub, make_prepared_link):
    data = [hub.encode_log() + hub.encode_taxels(0x20, i, hub_us=1_000_000 * i) for i in range(2)]
    chunks = [Chunk(data[i], 1_000_000_000 * (10 + i)) for i in range(2)]
    frames, _ = drain(FrameStream(make_prepared_link(chunks), lambda message: None))
    assert [frame.time_s for frame in frames] == pytest.approx([10.0, 11.0], abs=0.005)


def test_the_sequence_of_host_frames_wraps_at_65536(make_prepared_link, monkeypatch):
    link, written = make_prepared_link([]), []
    monkeypatch.setattr(link, "write", written.append)
    client = HubClient(link)
    for _ in range(65_537):
        client.send_stop()
    decoder = ReferenceDecoder()
    frames = [decoder.push(data)[0] for data in written[-3:]]
    assert [sequence for _, sequence, _ in frames] == [65_534, 65_535, 0]


def test_frames_of_a_newer_hub_are_unknown_but_neither_damaged_nor_lost():
    def encode_unchecked(frame_type: int, sequence: int, payload: bytes) -> bytes:
        """Encode a frame of any type and length, with a correct CRC."""
        body = bytes([frame_type]) + sequence.to_bytes(2, "little") + len(payload).to_bytes(2, "little") + payload
        return encode_body(body + crc32(body).to_bytes(4, "little"))

    status = bytes(FRAMES[FrameType.HUB_STATUS].maximum)
    stream = encode_frame(FrameType.HUB_STATUS, 0, status)
    # Two frames of unknown types, and a status that is longer than in this version; frame 3 is lost.
    stream += encode_unchecked(0x0F, 1, bytes(range(34))) + encode_unchecked(FrameType.HUB_STATUS, 2, status + bytes(8))
    stream += encode_unchecked(0x7F, 4, b"") + encode_frame(FrameType.HUB_STATUS, 5, status)
    for size in (1, 7, len(stream)):
        decoder = StreamDecoder()
        batches = [b for at in range(0, len(stream), size) for b in decoder.push(stream[at : at + size])]
        account = LossAccount(decoder)
        assert [row["sequence"] for batch in batches for row in batch.message_rows] == [0, 5]
        assert [row["lost_before"] for batch in batches for row in batch.message_rows] == [0, 1]
        assert (account.unknown_frames, account.lost_on_wire, account.frames_received) == (3, 1, 5)
        assert decoder.discarded_bytes == 0
