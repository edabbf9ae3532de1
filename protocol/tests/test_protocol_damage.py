"""After damage of one or two bytes of a stream, every frame that was not hit is decoded, and no other frame.

A frame is hit when a byte of its stuffed body is changed or lost, or when a byte is inserted between two of its bytes.
Delimiters belong to no frame. A frame that was hit may still be decoded, because damage can leave it unchanged.

By default the test repeats the same examples. For a longer run, set TAXEL_DAMAGE_EXAMPLES=20000.
"""

import os
from dataclasses import dataclass
from itertools import chain, combinations, pairwise
from typing import Any

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from taxel_protocol import ReferenceDecoder, encode_frame
from taxel_protocol.frames import FRAMES
from taxel_protocol.limits import ADDRESS_MAX, ADDRESS_MIN, SNAPSHOT_OVERHEAD, TAXELS_MAX
from taxel_protocol.names import FrameType

Frame = tuple[int, int, bytes]
EXAMPLES = int(os.environ.get("TAXEL_DAMAGE_EXAMPLES", "400"))
thorough = settings(max_examples=EXAMPLES, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
some = settings(thorough, max_examples=max(EXAMPLES // 4, 1))


@dataclass(frozen=True)
class Damage:
    """Damage of one byte. `offset` is taken modulo the length of the stream, so that it remains valid when examples
    shrink."""

    kind: str
    offset: int
    value: int

    def position(self, length: int) -> int:
        """Return the position of the damage in a stream of `length` bytes."""
        return self.offset % max(length, 1)


damages = st.lists(
    st.builds(Damage, st.sampled_from(["flip", "drop", "insert"]), st.integers(0, 1 << 20), st.integers(0, 255)),
    min_size=1,
    max_size=2,
)


@st.composite
def payloads(draw: st.DrawFn, frame_type: FrameType, quoted: list[bytes]) -> bytes:
    """Draw a payload that the type allows: arbitrary bytes, or the wire bytes of other frames, truncated to fit."""
    spec = FRAMES[frame_type]
    if frame_type == FrameType.TAXELS:
        count = draw(st.sampled_from([1, 2, 63, 113, 114, 115, 120, TAXELS_MAX]))
        length = 8 + SNAPSHOT_OVERHEAD + 2 * count
    else:
        count = 0
        length = draw(st.integers(spec.minimum, spec.maximum))
    filling = draw(st.sampled_from(["quoted", "random", "constant"] if quoted else ["random", "constant"]))
    if filling == "quoted":
        start = draw(st.integers(0, min(12, length)))
        data = bytearray(bytes(start) + b"".join(quoted) * (length // len(b"".join(quoted)) + 1))[:length]
    elif filling == "constant":
        data = bytearray([draw(st.integers(0, 255))] * length)
    else:
        data = bytearray(draw(st.randoms(use_true_random=False)).randbytes(length))
    if spec.has_address:
        data[0] = draw(st.integers(ADDRESS_MIN, ADDRESS_MAX))
    if count:
        data[1] = count
    return bytes(data)


@st.composite
def frame_lists(draw: st.DrawFn) -> list[Frame]:
    """Draw one to six frames of any type, which may contain the bytes of earlier ones."""
    frames: list[Frame] = []
    quoted: list[bytes] = []
    for _ in range(draw(st.integers(1, 6))):
        frame_type = draw(st.sampled_from(list(FRAMES)))
        frame = (int(frame_type), draw(st.integers(0, 0xFFFF)), draw(payloads(frame_type, quoted)))
        frames.append(frame)
        quoted.append(encode_frame(*frame))
    return frames


def encode_damaged(frames: list[Frame], damages: list[Damage]) -> tuple[bytes, set[int]]:
    """Encode frames and damage the stream; return it and the indices of the frames that were hit."""
    stream: list[tuple[int, int]] = []  # (byte, index of the frame that it belongs to, -1 for a delimiter)
    for index, frame in enumerate(frames):
        wire = encode_frame(*frame)
        stream += [(byte, index if 0 < i < len(wire) - 1 else -1) for i, byte in enumerate(wire)]
    hit = set()
    for damage in damages:
        at = damage.position(len(stream) + (damage.kind == "insert"))
        if damage.kind == "insert":
            if 0 < at < len(stream) and stream[at - 1][1] == stream[at][1] >= 0:
                hit.add(stream[at][1])
            owner = stream[at][1] if 0 < at < len(stream) and stream[at - 1][1] == stream[at][1] else -1
            stream.insert(at, (damage.value, owner))
        elif stream:
            hit.add(stream[at][1])
            stream[at : at + 1] = (
                [] if damage.kind == "drop" else [(stream[at][0] ^ (damage.value or 1), stream[at][1])]
            )
    return bytes(byte for byte, _ in stream), hit - {-1}


def list_allowed_outputs(frames: list[Frame], hit: set[int]) -> list[list[Frame]]:
    """List the allowed results: all frames that were not hit, in order, with any subset of the frames that were hit."""
    subsets = chain.from_iterable(combinations(sorted(hit), n) for n in range(len(hit) + 1))
    return [[frame for i, frame in enumerate(frames) if i not in hit or i in kept] for kept in map(set, subsets)]


def split_at(stream: bytes, cuts: list[int]) -> list[bytes]:
    """Split a stream at these positions, each taken modulo its length."""
    positions = sorted({0, len(stream), *(c % (len(stream) + 1) for c in cuts)})
    return [stream[a:b] for a, b in pairwise(positions)]


def decode_in_python(pieces: list[bytes]) -> list[Frame]:
    """Decode a stream that arrives in pieces with the reference decoder."""
    decoder = ReferenceDecoder()
    return [frame for piece in pieces for frame in decoder.push(piece)] + decoder.finish()


@thorough
@given(frames=frame_lists(), damage=damages, cuts=st.lists(st.integers(0, 1 << 20), max_size=6))
def test_exactly_the_undamaged_frames_are_decoded(
    codec: Any, frames: list[Frame], damage: list[Damage], cuts: list[int]
) -> None:
    """Every frame that was not hit is decoded; a frame that was hit may be, because damage can leave it unchanged."""
    stream, hit = encode_damaged(frames, damage)
    decoded = decode_in_python([stream])
    assert decoded in list_allowed_outputs(frames, hit)
    assert codec.decode(split_at(stream, cuts)) == decoded
    assert codec.decode_batch(split_at(stream, cuts)) == codec.as_batch(decoded)


@some
@given(frames=frame_lists(), cuts=st.lists(st.integers(0, 1 << 20), max_size=6), garbage=st.binary(max_size=1500))
def test_frames_between_random_bytes_are_decoded(
    codec: Any, frames: list[Frame], cuts: list[int], garbage: bytes
) -> None:
    """The frames follow one another without their delimiters (zero bytes), so only their headers show where they end.

    cuts: positions at which the stream is divided into chunks.
    """
    stream = garbage + b"".join(encode_frame(*frame)[1:-1] for frame in frames) + garbage
    decoded = decode_in_python(split_at(stream, cuts))
    assert decoded == frames
    assert codec.decode(split_at(stream, cuts)) == decoded
    assert codec.decode_batch(split_at(stream, cuts)) == codec.as_batch(decoded)


@some
@given(stream=st.binary(max_size=3000), cuts=st.lists(st.integers(0, 1 << 20), max_size=6))
def test_both_decoders_agree_on_arbitrary_bytes(codec: Any, stream: bytes, cuts: list[int]) -> None:
    assert codec.decode(split_at(stream, cuts)) == decode_in_python([stream])
