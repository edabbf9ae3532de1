"""The batch decoder gives the same frames as the reference decoder, for any bytes in pieces of any size."""

import random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from taxel.stream import StreamDecoder
from taxel_protocol import FrameType, ReferenceDecoder, crc32, encode_frame
from taxel_protocol.frames import FRAMES
from taxel_protocol.limits import ADDRESS_MAX, ADDRESS_MIN, ENCODED_MAX, TAXELS_MAX

TO_HOST = [kind for kind in FRAMES if kind < 0x80]
TO_HUB = [kind for kind in FRAMES if kind >= 0x80]


def make_taxel_payload(address, counts, headers, damage=0):
    """Make the payload of a TAXELS frame.

    headers: 6 bytes of cycle and hub time, and 6 bytes of board sequence and board time. damage: combined with the
    board CRC by exclusive or.
    """
    snapshot = headers[6:] + np.asarray(counts, "<u2").tobytes()
    crc = crc32(bytes([address]) + snapshot) ^ damage
    return bytes([address, len(counts)]) + headers[:6] + snapshot + crc.to_bytes(4, "little")


@st.composite
def sample_frames(draw, kinds=tuple(TO_HOST)):
    """Strategy for (type, sequence, payload) of a valid frame."""
    kind = draw(st.sampled_from(kinds))
    sequence = draw(st.integers(0, 65535))
    spec = FRAMES[kind]
    if kind == FrameType.TAXELS:
        address = draw(st.integers(ADDRESS_MIN, ADDRESS_MAX))
        size = draw(st.integers(1, 12) | st.integers(1, TAXELS_MAX))
        fill = draw(st.sampled_from([0, 1, 0xFFFF]) | st.none())
        rng = random.Random(draw(st.integers(0, 2**32)))
        counts = [rng.randrange(65536) if fill is None else fill for _ in range(size)]
        damage = draw(st.sampled_from([0, 0, 0, 1]))
        return kind, sequence, make_taxel_payload(address, counts, draw(st.binary(min_size=12, max_size=12)), damage)
    payload = draw(st.binary(min_size=spec.minimum, max_size=spec.maximum))
    if spec.has_address:
        payload = bytes([ADDRESS_MIN + payload[0] % (ADDRESS_MAX - ADDRESS_MIN + 1)]) + payload[1:]
    return kind, sequence, payload


damages = st.sampled_from(["none", "none", "none", "flip", "lose", "add", "zero", "swap", "cut", "first", "last"])


def damage(wire, kind_of_damage, rng):
    """Return the wire bytes of a frame with one damage at a random position. kind_of_damage: one of `damages`."""
    i = rng.randrange(len(wire))
    return {
        "none": wire,
        "flip": wire[:i] + bytes([wire[i] ^ (1 << rng.randrange(8))]) + wire[i + 1 :],
        "lose": wire[:i] + wire[i + 1 :],
        "add": wire[:i] + bytes([rng.randrange(256)]) + wire[i:],
        "zero": wire[:i] + b"\0" + wire[i + 1 :],
        "swap": wire[:i] + wire[i : i + 2][::-1] + wire[i + 2 :],
        "cut": wire[:i],
        "first": wire[1:],
        "last": wire[:-1],
    }[kind_of_damage]


@st.composite
def sample_streams(draw):
    """Strategy for wire bytes of frames, some of them damaged, with random bytes between them."""
    rng = random.Random(draw(st.integers(0, 2**32)))
    parts = []
    for frame in draw(st.lists(sample_frames() | sample_frames(tuple(TO_HUB)), max_size=12)):
        parts.append(damage(encode_frame(*frame), draw(damages), rng))
        if draw(st.integers(0, 5)) == 0:
            parts.append(rng.randbytes(rng.choice([1, 10, 700])))
    return b"".join(parts)


def divide_randomly(data, rng):
    """Divide bytes into pieces of random sizes."""
    pieces = []
    while data:
        size = rng.choice([1, 2, 7, 62, 500, 4096])
        pieces.append(data[:size])
        data = data[size:]
    return pieces


def decode(pieces):
    """Decode with the batch decoder; return (taxel frames, messages, number of discarded bytes).

    A taxel frame is (sequence, address, cycle, hub time, board sequence, board time, counts, is_damaged). A message is
    (type, sequence, payload).
    """
    decoder = StreamDecoder()
    batches = [batch for piece in pieces for batch in decoder.push(piece)] + decoder.finish()
    taxels, messages = [], []
    for batch in batches:
        for row in batch.taxel_rows:
            counts = batch.counts[row["offset"] : row["offset"] + row["size"]].tolist()
            names = ("sequence", "address", "cycle", "hub_time_us", "board_sequence", "board_time_us")
            taxels.append((*(int(row[name]) for name in names), counts, bool(row["flags"] & 1)))
        for row in batch.message_rows:
            payload = batch.payloads[row["offset"] : row["offset"] + row["size"]]
            messages.append((int(row["type"]), int(row["sequence"]), payload))
    return taxels, messages, decoder.discarded_bytes


TAXEL_FRAMES = (FrameType.TAXELS, FrameType.COMPACT_TAXELS)


def decode_with_reference(data):
    """Decode with the reference decoder; return (taxel frames, messages) in the form of `decode`."""
    decoder = ReferenceDecoder()
    taxels, messages = [], []
    for kind, sequence, payload in decoder.push(data) + decoder.finish():
        if kind == FrameType.COMPACT_TAXELS:  # contains random bytes, so its CRC is wrong
            number = [int.from_bytes(payload[a:b], "little") for a, b in ((0, 1), (2, 4), (4, 8), (8, 10))]
            taxels.append((sequence, *number, 0, [], True))
            continue
        if kind != FrameType.TAXELS:
            messages.append((kind, sequence, payload))
            continue
        number = [int.from_bytes(payload[a:b], "little") for a, b in ((0, 1), (2, 4), (4, 8), (8, 10), (10, 14))]
        counts = np.frombuffer(payload[14:-4], "<u2").tolist()
        is_damaged = crc32(payload[:1] + payload[8:-4]) != int.from_bytes(payload[-4:], "little")
        taxels.append((sequence, *number, counts, is_damaged))
    return taxels, messages


@settings(max_examples=100, deadline=None)
@given(st.lists(sample_frames(), max_size=20), st.integers(0, 2**32))
def test_an_undamaged_stream_gives_every_frame(sent, seed):
    data = b"".join(encode_frame(*frame) for frame in sent)
    taxels, messages, discarded = decode(divide_randomly(data, random.Random(seed)))
    expected_taxels, expected_messages = decode_with_reference(data)
    assert len(expected_taxels) + len(expected_messages) == len(sent)
    assert taxels == expected_taxels
    assert messages == [frame for frame in sent if frame[0] not in TAXEL_FRAMES]
    assert discarded == 0


@settings(max_examples=150, deadline=None)
@given(sample_streams(), st.integers(0, 2**32))
def test_a_damaged_stream_gives_the_frames_of_the_reference_decoder(data, seed):
    taxels, messages, _ = decode(divide_randomly(data, random.Random(seed)))
    expected_taxels, expected_messages = decode_with_reference(data)
    assert taxels == expected_taxels
    # The only difference: the batch decoder ignores frames addressed to the hub.
    assert messages == [frame for frame in expected_messages if frame[0] < 0x80]


@settings(max_examples=80, deadline=None)
@given(st.binary(max_size=3000), st.integers(0, 2**32))
def test_the_decoded_frames_do_not_depend_on_the_piece_sizes(data, seed):
    expected = decode([data])
    assert decode(divide_randomly(data, random.Random(seed))) == expected
    assert decode([data[i : i + 1] for i in range(len(data))]) == expected
    _, _, discarded_bytes = expected
    assert discarded_bytes == len(data) - data.count(0)  # random bytes contain no valid frame; 0 is the delimiter


def test_discarded_bytes_are_the_bytes_outside_frames(hub):
    frames = [hub.encode_log(b"a"), hub.encode_taxels(0x20, 1), hub.encode_log(b"b")]
    noise = b"\x05\x06\x07\x08\x09"
    assert decode([frames[0] + noise + frames[1][1:] + frames[2]])[2] == len(noise)


@pytest.mark.parametrize("size", [1, 3, TAXELS_MAX])
def test_a_push_of_more_frames_than_a_table_holds_gives_every_frame(hub, size):
    count = 9_000  # frames; each table of the decoder has 4096 rows
    data = bytearray()
    for i in range(count):
        data += (
            hub.encode_taxels(0x20 + i % 2, i, [i % 65536] * size)
            if i % 3
            else hub.encode_log(bytes([65 + i % 20]) * 60)
        )
    taxels, messages, discarded = decode([bytes(data)])
    # taxel[0]: sequence number; taxel[6]: counts; message[1]: sequence number.
    assert [taxel[0] for taxel in taxels] == [i for i in range(count) if i % 3]
    assert all(taxel[6] == [taxel[0]] * size for taxel in taxels)
    assert [message[1] for message in messages] == list(range(0, count, 3))
    assert discarded == 0


def test_the_decoder_recovers_after_a_long_stream_without_a_delimiter(hub):
    noise = bytes(random.Random(3).choices(range(1, 256), k=20 * ENCODED_MAX))
    taxels, messages, discarded = decode([noise + hub.encode_log(b"after")])
    assert (taxels, len(messages), discarded) == ([], 1, len(noise))


def test_the_stream_position_of_a_row_is_the_end_of_its_frame(hub):
    parts = [hub.encode_log(b"a"), hub.encode_taxels(0x20, 1), hub.encode_taxels(0x21, 1)]
    batches = StreamDecoder().push(b"".join(parts))
    end_positions = [int(p) for batch in batches for p in batch.taxel_rows["stream_position"]]
    # Either the last byte of the frame or its delimiter.
    assert end_positions[0] in (len(parts[0] + parts[1]) - 1, len(parts[0] + parts[1]))
    assert end_positions[1] in (len(b"".join(parts)) - 1, len(b"".join(parts)))


def test_a_frame_with_a_wrong_board_crc_is_flagged_as_damaged(hub):
    taxels, _, _ = decode(
        [hub.encode_taxels(0x20, 1), hub.encode_taxels(0x20, 2, damage=0x80), hub.encode_taxels(0x20, 3)]
    )
    assert [taxel[7] for taxel in taxels] == [False, True, False]  # is_damaged
