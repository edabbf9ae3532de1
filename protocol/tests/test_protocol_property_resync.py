"""One damaged byte loses only the frame that it hits: exhaustive over positions and kinds of damage."""

from collections.abc import Iterator
from typing import Any

import pytest

from taxel_protocol import ReferenceDecoder, crc32, encode_frame
from taxel_protocol.limits import TAXELS_MAX
from taxel_protocol.names import FrameType

Frame = tuple[int, int, bytes]

REFERENCE_EVERY = 97
"""One of this many streams is also decoded by the slow Python decoder."""


def build_taxel_frame(sequence: int, count: int, fill: int) -> Frame:
    """Build a taxel frame of board 0x20 with `count` equal counts, whose low byte is `fill`."""
    snapshot = sequence.to_bytes(2, "little") + bytes(4) + bytes([fill, 0x0F]) * count
    crc = crc32(snapshot, crc32(b"\x20")).to_bytes(4, "little")
    return int(FrameType.TAXELS), sequence, bytes([0x20, count]) + bytes(6) + snapshot + crc


SHORT: list[Frame] = [
    (int(FrameType.HOST_HANDSHAKE), 0, b"\7\1\1"),
    (int(FrameType.COMMAND), 1, b"\1\2"),
    (int(FrameType.TIME_SYNC), 2, bytes([0x31]) + bytes(range(12))),
    (int(FrameType.REPLY), 3, b"\5\1\0"),
]
"""Frames with short blocks: a large share of the wire bytes are code bytes."""

LONG: list[Frame] = [
    (int(FrameType.LOG), 0xFFFE, b"\1\0\0\0\0\0\0text"),
    build_taxel_frame(0xFFFF, 3, 0xA0),
    build_taxel_frame(0, 125, 0x11),
    (int(FrameType.BOARD_FAULT), 1, bytes([0x21]) + bytes(9)),
    build_taxel_frame(2, 1, 0xFF),
]
"""Frames of which one has a full block of 254 bytes."""

STREAMS = {"short frames": SHORT, "long frames": LONG}
every_stream = pytest.mark.parametrize("sent", [pytest.param(frames, id=name) for name, frames in STREAMS.items()])


def encode_wire(sent: list[Frame], delimiters: str) -> tuple[bytes, list[range]]:
    """Encode frames; return the stream and the range of each frame's own bytes.

    delimiters: `both` zero bytes of each frame, or `none`.
    """
    stream, ranges = b"", []
    for frame in sent:
        body = encode_frame(*frame)[1:-1]
        stream += b"" if delimiters == "none" else b"\0"
        ranges.append(range(len(stream), len(stream) + len(body)))
        stream += body + (b"" if delimiters == "none" else b"\0")
    return stream, ranges


def check_decoded(codec: Any, stream: bytes, expected: list[Frame], number: int, description: str) -> None:
    """Check that a stream is decoded to the expected frames.

    number: running number of the stream, which selects those for the slow decoder. description: damage, for a failure.
    """
    assert codec.decode([stream]) == expected, description
    assert codec.decode_batch([stream]) == codec.as_batch(expected), description
    if number % REFERENCE_EVERY == 0:
        reference = ReferenceDecoder()
        assert reference.push(stream) + reference.finish() == expected, description


def iterate_other_values(byte: int, is_complete: bool) -> Iterator[int]:
    """Yield other values of a byte: all of them, or every flipped bit, the neighbours and the extremes."""
    if is_complete:
        yield from (value for value in range(256) if value != byte)
        return
    yield from {*(byte ^ (1 << bit) for bit in range(8)), 0, 0xFF, (byte + 1) % 256, (byte - 1) % 256} - {byte}


@every_stream
@pytest.mark.parametrize("delimiters", ["both", "none"])
def test_a_changed_byte_loses_only_its_own_frame(codec: Any, sent: list[Frame], delimiters: str) -> None:
    """Short frames with delimiters are tested with all 255 other values of each byte, the others with a selection."""
    stream, ranges = encode_wire(sent, delimiters)
    for position, byte in enumerate(stream):
        expected = [frame for frame, frame_range in zip(sent, ranges, strict=True) if position not in frame_range]
        assert len(expected) >= len(sent) - 1
        for number, value in enumerate(
            iterate_other_values(byte, sent is SHORT and delimiters == "both"), start=position
        ):
            damaged = stream[:position] + bytes([value]) + stream[position + 1 :]
            check_decoded(codec, damaged, expected, number, f"byte {position} became {value:#04x}")


@every_stream
@pytest.mark.parametrize("delimiters", ["both", "none"])
def test_a_lost_byte_loses_only_its_own_frame(codec: Any, sent: list[Frame], delimiters: str) -> None:
    stream, ranges = encode_wire(sent, delimiters)
    for position in range(len(stream)):
        expected = [frame for frame, frame_range in zip(sent, ranges, strict=True) if position not in frame_range]
        check_decoded(codec, stream[:position] + stream[position + 1 :], expected, position, f"byte {position} lost")


@every_stream
@pytest.mark.parametrize("delimiters", ["both", "none"])
def test_an_added_byte_loses_only_the_frame_that_it_splits(codec: Any, sent: list[Frame], delimiters: str) -> None:
    stream, ranges = encode_wire(sent, delimiters)
    for position in range(len(stream) + 1):
        neighbours = {*stream[max(position - 1, 0) : position + 1]}
        for value in {0, 1, 2, 0x7F, 0xFE, 0xFF} | neighbours:
            damaged = stream[:position] + bytes([value]) + stream[position:]
            split = [i for i, frame_range in enumerate(ranges) if frame_range.start < position < frame_range.stop]
            # If the added byte equals its neighbour, the result can be the same as with a byte beside the frame. The
            # frame then stays intact.
            lost = {i for i in split if stream[ranges[i].start : ranges[i].stop] not in damaged}
            assert len(split) <= 1
            expected = [frame for i, frame in enumerate(sent) if i not in lost]
            check_decoded(codec, damaged, expected, position, f"{value:#04x} added before byte {position}")


def test_the_longest_frame_is_decoded_after_any_number_of_bytes_without_a_delimiter(codec: Any) -> None:
    longest = build_taxel_frame(7, TAXELS_MAX, 0x33)
    body = encode_frame(*longest)[1:-1]
    for number in range(3 * len(body)):
        check_decoded(codec, b"\2" * number + body + b"\0", [longest], number, f"{number} bytes before it")
