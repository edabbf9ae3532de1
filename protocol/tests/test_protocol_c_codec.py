"""The C codec encodes and decodes the vectors."""

import json
import random
from pathlib import Path
from typing import Any

import pytest

from taxel_protocol import ReferenceDecoder
from taxel_protocol.limits import PAYLOAD_MAX
from taxel_protocol.names import FrameType

ROOT = Path(__file__).resolve().parents[2]


def load_vectors(name: str, key: str) -> list[Any]:
    """Return the vectors of the list `key` of a vector file as parameters of a test."""
    content = json.loads((ROOT / "protocol" / "vectors" / f"{name}.json").read_text())
    return [pytest.param(vector, id=vector["name"]) for vector in content[key]]


every_frame = pytest.mark.parametrize("vector", load_vectors("frames", "frames"))
every_stream = pytest.mark.parametrize("vector", load_vectors("damaged", "streams"))


def build_sent_frame(vector: dict[str, Any]) -> tuple[int, int, bytes]:
    """Return the frame (type, sequence, payload) of a vector."""
    return vector["type"], vector["sequence"], bytes.fromhex(vector["payload"])


@every_frame
def test_c_encodes_the_vector(codec: Any, vector: dict[str, Any]) -> None:
    assert codec.encode(*build_sent_frame(vector)).hex() == vector["wire"]


@every_frame
def test_c_decodes_the_vector(codec: Any, vector: dict[str, Any]) -> None:
    assert codec.decode([bytes.fromhex(vector["wire"])]) == [build_sent_frame(vector)]
    assert codec.discarded_bytes == 0


@every_frame
def test_c_batch_decoder_decodes_the_vector_and_checks_the_boards_own_crc(codec: Any, vector: dict[str, Any]) -> None:
    batch = codec.decode_batch([bytes.fromhex(vector["wire"])])
    assert batch == codec.as_batch([build_sent_frame(vector)])
    assert [taxels.board_crc_ok for taxels in batch.taxels] == [vector.get("board_crc_ok", False)] * len(batch.taxels)


@every_stream
@pytest.mark.parametrize("piece", [1, 7, 509, 1 << 20])
def test_c_decodes_a_damaged_stream_in_pieces_of_any_size(codec: Any, vector: dict[str, Any], piece: int) -> None:
    """In a vector, `expected` contains the indices of the sent frames that a decoder must find."""
    stream = bytes.fromhex(vector["stream"])
    pieces = [stream[i : i + piece] for i in range(0, len(stream), piece)]
    expected = [build_sent_frame(vector["sent"][i]) for i in vector["expected"]]
    assert codec.decode(pieces, vector["directions"]) == expected
    assert codec.decode_batch(pieces, vector["directions"]) == codec.as_batch(expected)


def test_c_and_reference_decoder_discard_the_same_number_of_bytes(codec: Any) -> None:
    rng = random.Random(7)
    for _ in range(40):
        # Random bytes, in which the delimiter 0 is half as frequent as any other byte.
        stream = bytes(rng.choices(range(256), weights=[1] + [2] * 255, k=rng.randrange(2500)))
        reference = ReferenceDecoder()
        frames = reference.push(stream) + reference.finish()
        assert codec.decode([stream]) == frames
        assert codec.discarded_bytes == reference.discarded_bytes


def test_c_decodes_a_frame_of_the_largest_size_at_any_position_of_its_chunk_buffer(codec: Any) -> None:
    """Bytes without a delimiter fill the buffer; the frame behind them must stay in it until its end arrives.

    Payload: board 0x20 with 240 taxels, the largest number.
    """
    frame = (int(FrameType.TAXELS), 7, bytes([0x20, 240]) + bytes(1 + i % 255 for i in range(PAYLOAD_MAX - 2)))
    wire = codec.encode(*frame)
    for preceding_bytes in range(2 * len(wire)):
        stream = b"\xff" * preceding_bytes + wire.lstrip(b"\0")
        pieces = [stream[i : i + 64] for i in range(0, len(stream), 64)]
        assert codec.decode(pieces) == [frame], preceding_bytes


def test_encoding_into_a_buffer_that_is_too_small_returns_0(codec: Any) -> None:
    assert codec.native.taxel_batch_encode(FrameType.HOST_HANDSHAKE, 0, bytes(3), 3, bytes(8), 8) == 0


def test_frames_without_delimiters_never_exceed_the_row_capacity(codec: Any) -> None:
    """A step is one call of `taxel_batch_decode` with empty arrays; `decode_batch` then asserts the capacity.

    The only delimiter is the last byte, and the codec searches the bytes when this delimiter arrives. All 115 frames
    therefore become rows in one step. A step begins only with a capacity of at least 128 rows, because the codec can
    find up to 127 of the shortest frames in one search. The arrays are larger than the stated capacity, so that a write
    past the capacity is detected and harmless.
    """
    frame = (int(FrameType.REPLY), 0x0101, b"\1\2\3")
    stream = codec.encode(*frame)[1:-1] * 115 + b"\0"
    for rows in range(300, 127, -4):  # down to 128, the smallest capacity
        assert len(codec.decode_batch([stream], rows=rows).messages) == 115


def test_all_taxel_frames_without_delimiters_are_decoded_at_any_row_capacity(codec: Any) -> None:
    """The stream contains more frames than rows fit into the arrays, so it is decoded in several steps.

    A step is one call of `taxel_batch_decode` with empty arrays; `decode_batch` asserts the capacity after it.
    """
    frame_count = 400
    frame = (int(FrameType.TAXELS), 0x0101, b"\x20\1" + b"\1" * 18)
    stream = codec.encode(*frame)[1:-1] * frame_count + b"\0"
    for rows in range(300, 127, -4):  # down to 128, the smallest capacity with which a step begins
        assert len(codec.decode_batch([stream], rows=rows).taxels) == frame_count
