"""Formats and stream decoder of the original hub."""

import random
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from construct import ConstructError
from hypothesis import given, settings
from hypothesis import strategies as st

from taxel_protocol.original import (
    ACCELERATIONS,
    FINGERTIPS,
    FIRST_GENERATION_TAXELS,
    FITTED,
    FORMATS,
    PUBLISHED,
    READ_SEQUENCE,
    TAXELS,
    TIME_STEP_MAX_MS,
    OriginalFormat,
    OriginalMessage,
    Timestamped,
    define_message,
    encode_message,
    parse_message,
)
from taxel_protocol.original_stream import OriginalDecoder

ORIGINAL = FORMATS["original"]
SPEC = (Path(__file__).resolve().parents[1] / "SPEC.md").read_text()
FRAMED = [name for name, known in FORMATS.items() if not known.record_size]
every_framed = pytest.mark.parametrize("name", FRAMED)


def build_round(
    message_format: OriginalFormat, rng: random.Random, start_ms: int, addresses: Any = None
) -> list[OriginalMessage]:
    """Build a message of each board with random counts, 10 ms apart; positions as in an undamaged stream."""
    messages: list[OriginalMessage] = []
    position = 0
    for i, address in enumerate(addresses or message_format.taxels):
        counts = tuple(rng.randrange(65_536) for _ in range(message_format.taxels[address]))
        is_accelerated = address in message_format.accelerated
        accelerations = tuple(rng.randrange(-32_768, 32_768) for _ in range(ACCELERATIONS * is_accelerated))
        time_ms = start_ms + 10 * i if message_format.has_timestamp else None
        messages.append(OriginalMessage(address, time_ms, counts, accelerations, position))
        position += message_format.lengths[address]
    return messages


def encode(message_format: OriginalFormat, message: OriginalMessage) -> bytes:
    """Encode a decoded message again."""
    return encode_message(
        message_format, message.address, message.counts, message.timestamp_ms or 0, message.accelerations
    )


def get_content(message: OriginalMessage) -> tuple[Any, ...]:
    """Return the fields of a message that are sent, without its position in the stream."""
    return message.address, message.timestamp_ms, message.counts, message.accelerations


def decode(message_format: OriginalFormat, *pieces: bytes) -> list[OriginalMessage]:
    """Decode a complete stream that arrives in pieces."""
    decoder = OriginalDecoder(message_format)
    return [message for piece in pieces for message in decoder.push(piece)] + decoder.finish()


def test_the_tables_have_the_boards_and_taxels_of_the_sources() -> None:
    """Numbers of boards and of their taxels in each table; `lengths` are the bytes of one message of each board.

    The expected numbers follow from the table of the original boards in SPEC.md.
    """
    assert (len(TAXELS), sum(TAXELS.values())) == (22, 1324)
    assert (len(FITTED), sum(TAXELS[address] for address in FITTED)) == (17, 1037)
    assert (len(PUBLISHED), sum(TAXELS[address] for address in PUBLISHED)) == (15, 905)
    assert sum(ORIGINAL.lengths[address] for address in PUBLISHED) == 1930
    assert (len(FIRST_GENERATION_TAXELS), sum(FIRST_GENERATION_TAXELS.values())) == (22, 224)
    assert sum(FORMATS["first_generation"].lengths.values()) == 624
    assert sorted(READ_SEQUENCE) == sorted(TAXELS) == sorted(FIRST_GENERATION_TAXELS)
    assert {TAXELS[address] for address in FINGERTIPS} == {66}


def read_rows(mark: str) -> list[list[str]]:
    """Return the cells of the rows of the table that follows `<!-- mark -->` in SPEC.md."""
    table = SPEC.split(f"<!-- {mark} -->\n\n")[1].split("\n\n")[0]
    return [[cell.strip() for cell in row.strip("|").split("|")] for row in table.splitlines()[2:]]


def test_the_tables_of_the_spec_equal_the_definitions() -> None:
    first = FORMATS["first_generation"]
    for address, *numbers in read_rows("boards: original"):
        board = int(address, 16)
        expected = [known_value[board] for known in (ORIGINAL, first) for known_value in (known.taxels, known.lengths)]
        assert [int(number) for number in numbers] == expected
    assert len(read_rows("boards: original")) == len(TAXELS)
    fields = [(renamed.name, renamed.subcon.sizeof()) for renamed in Timestamped.subcons]
    rows = read_rows("layout: original")
    assert [(row[2], int(row[1])) for row in rows[:4]] == fields
    assert [row[2] for row in rows] == [renamed.name for renamed in define_message(ORIGINAL, 0x1D).subcons]


def test_a_message_has_the_layout_of_the_original_hub() -> None:
    counts = [0x0102 + i for i in range(27)]
    data = encode_message(ORIGINAL, 0x1D, counts, 0x11223344)
    # start byte, length 62, address, timestamp (big-endian), first count (little-endian); the end byte is 0x0A
    assert data[:9].hex(" ") == "01 3e 1d 11 22 33 44 02 01"
    assert (data[-1], len(data)) == (0x0A, 62)
    # The format `first_generation_test` has big-endian counts.
    assert encode_message(FORMATS["first_generation_test"], 0x18, counts[:6])[7:9] == b"\x01\x02"
    # Length of a message: 3 bytes of header, 4 bytes of time if the format has a time, 2 bytes for each count and each
    # of three accelerations, and the end byte.
    assert len(encode_message(FORMATS["first_generation_untimed"], 0x01, counts[:14])) == 32
    assert len(encode_message(FORMATS["original_accelerations"], 0x1C, [0] * 66, 0, [1, -2, 3])) == 146


@every_framed
def test_parsing_an_encoded_message_returns_its_content(name: str) -> None:
    known = FORMATS[name]
    for message in build_round(known, random.Random(1), 5):
        assert get_content(parse_message(known, message.address, encode(known, message))) == get_content(message)


def test_a_wrong_number_of_counts_and_an_unknown_address_are_rejected() -> None:
    with pytest.raises(ConstructError):
        encode_message(ORIGINAL, 0x1D, [0] * 26)
    with pytest.raises(KeyError):
        encode_message(ORIGINAL, 0x1E, [0] * 27)
    with pytest.raises(ValueError, match="board 0x20: expected"):
        OriginalFormat("too long", {0x20: 124})  # the length byte cannot state the size of so many counts


@every_framed
def test_an_undamaged_stream_is_decoded_with_the_last_byte_of_each_message(name: str) -> None:
    known = FORMATS[name]
    decoder = OriginalDecoder(known)
    for message in build_round(known, random.Random(2), 1000):
        wire = encode(known, message)
        assert decoder.push(wire[:-1]) == []
        (decoded,) = decoder.push(wire[-1:])
        assert get_content(decoded) == get_content(message)
        assert decoded.position == message.position
    assert (decoder.discarded_bytes, decoder.ambiguous_candidates, decoder.pending_bytes) == (0, 0, 0)


def test_a_stream_without_frames_is_divided_into_records_of_50_bytes() -> None:
    decoder = OriginalDecoder(FORMATS["fingertip_records"])
    data = bytes(range(120))
    first, second = decoder.push(data)  # 25 counts of 2 bytes each; the last 20 bytes are no complete record
    assert (first.address, first.timestamp_ms, len(first.counts)) == (0x08, None, 25)
    assert (first.counts[0], second.counts[0], second.position) == (0x0100, 50 + 51 * 256, 50)
    assert decoder.finish() == []
    assert (decoder.messages, decoder.discarded_bytes) == (2, 20)


def test_a_message_whose_end_was_lost_does_not_hide_the_next_message() -> None:
    """The damaged message of 250 bytes has lost 3 bytes, so its length reaches to the third byte of the next message.

    This third byte is the address 0x0A, which equals the end byte: both messages look complete, but they overlap.
    """
    rng = random.Random(3)
    damaged, undamaged = build_round(ORIGINAL, rng, 7000, [0x15, 0x0A])
    wire = encode(ORIGINAL, damaged)
    stream = wire[:100] + wire[103:] + encode(ORIGINAL, undamaged)
    assert stream[249] == 0x0A
    decoder = OriginalDecoder(ORIGINAL)
    assert [get_content(message) for message in decoder.push(stream)] == [get_content(undamaged)]
    assert (decoder.ambiguous_candidates, decoder.discarded_bytes) == (1, 247)  # the 250 - 3 bytes that arrived


def test_data_that_imitates_a_message_does_not_hide_the_message_around_it() -> None:
    """The counts of a message contain a complete second message, whose timestamp does not fit the stream.

    The time of the outer message is plausible in both cases: 5 s is less than 60 s after the start of the hub, and
    200 s is 10 ms after the message before.
    """
    counts = [2000] * 121
    inner = encode_message(ORIGINAL, 0x1D, [2000] * 27, 0xDEADBEEF)
    assert len(inner) % 2 == 0
    counts[20 : 20 + len(inner) // 2] = [inner[i] | inner[i + 1] << 8 for i in range(0, len(inner), 2)]
    for time_ms in (5000, 200_000):
        wire = encode_message(ORIGINAL, 0x15, counts, time_ms)
        follow = encode_message(ORIGINAL, 0x16, [1] * 118, time_ms + 10)
        before = encode_message(ORIGINAL, 0x1D, [1] * 27, time_ms - 10)
        decoder = OriginalDecoder(ORIGINAL)
        decoded = decoder.push(before + wire + follow)
        assert [message.address for message in decoded] == [0x1D, 0x15, 0x16]
        assert decoder.ambiguous_candidates == 1


def test_without_timestamps_a_message_followed_by_a_header_is_kept() -> None:
    """The counts of a message contain a complete second message; only the outer one is followed by a header.

    The decoder therefore outputs nothing until the bytes behind the outer message have arrived.
    """
    untimed = FORMATS["first_generation_untimed"]
    inner = encode_message(untimed, 0x18, [2000] * 6)
    counts = [2000] * 20
    counts[3 : 3 + len(inner) // 2] = [inner[i] | inner[i + 1] << 8 for i in range(0, len(inner), 2)]
    wire = encode_message(untimed, 0x15, counts)
    follow = encode_message(untimed, 0x16, [1] * 25)
    decoder = OriginalDecoder(untimed)
    assert decoder.push(wire) == []
    assert decoder.push(follow[:2]) == []
    assert [message.address for message in decoder.push(follow[2:])] == [0x15, 0x16]


def test_times_are_plausible_after_a_restart_and_not_after_a_long_pause() -> None:
    times = [5_000_000, 5_000_010, 5_000_005, 5_000_010 + TIME_STEP_MAX_MS, 9_000_000, 12, 0xFFFFFFFF, 3]
    stream = b"".join(encode_message(ORIGINAL, 0x1D, [5] * 27, time_ms) for time_ms in times)
    plausible = [message.is_time_plausible for message in decode(ORIGINAL, stream)]
    # False: the first time, a time after a long pause, and a time that no restart explains. 12 and 3 follow a restart.
    assert plausible == [False, True, True, True, False, True, False, True]


def damage_stream(stream: bytes, rng: random.Random, count: int) -> tuple[bytes, list[int | None]]:
    """Change, remove or add bytes of a stream at `count` places.

    Returns the damaged stream and the original position of each of its bytes, None for a changed or added byte.
    """
    data: list[tuple[int, int | None]] = [(byte, i) for i, byte in enumerate(stream)]
    for _ in range(count):
        at = rng.randrange(len(data) + 1)
        noise = (rng.choice((rng.randrange(256), 0x01, 0x0A)), None)
        data[at : at + rng.choice((0, 1))] = [noise] * rng.choice((0, 1))
    return bytes(byte for byte, _ in data), [place for _, place in data]


def list_undamaged(
    message_format: OriginalFormat, sent: list[OriginalMessage], places: list[int | None]
) -> list[tuple[Any, ...]]:
    """List the contents of the messages whose bytes all arrived without another byte between them."""
    index = {place: i for i, place in enumerate(places) if place is not None}
    undamaged = []
    for message in sent:
        length = message_format.lengths[message.address]
        first = index.get(message.position)
        if first is not None and places[first : first + length] == list(
            range(message.position, message.position + length)
        ):
            undamaged.append(get_content(message))
    return undamaged


def split_at(stream: bytes, cuts: list[int]) -> list[bytes]:
    """Split a stream at these positions, each taken modulo its length."""
    places = sorted({0, len(stream), *(cut % (len(stream) + 1) for cut in cuts)})
    return [stream[a:b] for a, b in pairwise(places)]


@every_framed
@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32), damages=st.integers(0, 12), cuts=st.lists(st.integers(0, 5000), max_size=8))
def test_every_undamaged_message_is_decoded_from_a_damaged_stream(
    name: str, seed: int, damages: int, cuts: list[int]
) -> None:
    known, rng = FORMATS[name], random.Random(seed)
    sent = build_round(known, rng, rng.randrange(2**31), rng.sample(sorted(known.taxels), 6))
    stream, places = damage_stream(b"".join(encode(known, message) for message in sent), rng, damages)
    decoded = [get_content(message) for message in decode(known, *split_at(stream, cuts))]
    for message in list_undamaged(known, sent, places):
        assert message in decoded


@pytest.mark.parametrize("name", FORMATS)
@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32), cuts=st.lists(st.integers(0, 5000), max_size=20))
def test_the_same_messages_are_decoded_from_pieces_of_any_size(name: str, seed: int, cuts: list[int]) -> None:
    known, rng = FORMATS[name], random.Random(seed)
    sent = build_round(known, rng, 77, rng.choices(sorted(known.taxels), k=4))
    stream, _ = damage_stream(b"".join(encode(known, message) for message in sent), rng, rng.randrange(60))
    whole, pieces, bytewise = (OriginalDecoder(known) for _ in range(3))
    expected = whole.push(stream)
    assert [message for piece in split_at(stream, cuts) for message in pieces.push(piece)] == expected
    assert [message for i in range(len(stream)) for message in bytewise.push(stream[i : i + 1])] == expected
    for _ in range(2):  # before and after `finish`, the end of the stream
        counters = {
            (d.position, d.messages, d.discarded_bytes, d.rejected_candidates, d.ambiguous_candidates, d.pending_bytes)
            for d in (whole, pieces, bytewise)
        }
        assert len(counters) == 1
        assert whole.finish() == pieces.finish() == bytewise.finish()
    total = sum(known.lengths[message.address] for message in decode(known, stream))
    assert whole.discarded_bytes + total == len(stream)
