"""The parsers in Python and C against construct: arbitrary bytes, fields, frames, damage and pieces.

For a longer run, set TAXEL_PROPERTY_EXAMPLES=20000 and pass --hypothesis-seed=7. Without the variable the examples are
the same in every run.
"""

import importlib
import os
import sys
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from construct import Array, Bytes, BytesInteger, Const, FormatField, GreedyBytes, Int16ul, Renamed, Struct
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from taxel_protocol import ReferenceDecoder, encode_frame, frames, registers
from taxel_protocol.frames import FRAMES
from taxel_protocol.layout import flatten, list_fields, pack, unpack
from taxel_protocol.limits import ADDRESS_MAX, ADDRESS_MIN, TAXELS_MAX, WHO_AM_I
from taxel_protocol.names import FrameType
from taxel_protocol.wire import WireFrame

FOLDER = Path(__file__).resolve().parents[2] / "tools" / "fuzz"
EXAMPLES_SETTING = os.environ.get("TAXEL_PROPERTY_EXAMPLES")
EXAMPLES = int(EXAMPLES_SETTING or "60")
bounded = settings(
    max_examples=EXAMPLES,
    deadline=None,
    derandomize=EXAMPLES_SETTING is None,
    database=None,
    suppress_health_check=list(HealthCheck),
)

LAYOUTS = {
    **{spec.payload: f"payload of {kind.name}" for kind, spec in FRAMES.items() if kind != FrameType.TAXELS},
    **{
        getattr(module, name): name
        for module, names in (
            (
                registers,
                ("Identity", "Status", "ScanSettings", "SettingsRegister", "CommandRegister", "SnapshotHeader"),
            ),
            (
                frames,
                (
                    "TaxelHeader",
                    "SetRateArguments",
                    "EnterBootloaderArguments",
                    "TransferArguments",
                    "SetScanSettingsArguments",
                    "GetBoardInfoArguments",
                    "GetTimeReply",
                ),
            ),
        )
        for name in names
    },
}
every_layout = pytest.mark.parametrize("definition", [pytest.param(d, id=name) for d, name in LAYOUTS.items()])


@pytest.fixture(scope="session")
def oracle() -> Iterator[ModuleType]:
    """Module tools/fuzz/construct_oracle.py, a stream decoder made of construct definitions."""
    sys.path.insert(0, str(FOLDER))
    yield importlib.import_module("construct_oracle")
    while str(FOLDER) in sys.path:
        sys.path.remove(str(FOLDER))


def set_constants(definition: Struct, data: bytes) -> bytes:
    """Return the bytes with every constant field set to its value: construct rejects other values."""
    out = bytearray(data)
    for field in list_fields(definition):
        if field.constant is not None:
            out[field.offset : field.offset + field.size] = field.constant.to_bytes(field.size, "little")
    return bytes(out)


def remove_io(value: Any) -> Any:
    """Remove the entries `_io` that construct adds to parsed fields."""
    return {k: remove_io(v) for k, v in value.items() if k != "_io"} if isinstance(value, dict) else value


@every_layout
@bounded
@given(data=st.data())
def test_construct_and_layout_unpack_any_bytes_to_the_same_fields(definition: Struct, data: st.DataObject) -> None:
    size = sum(field.size for field in list_fields(definition))
    has_tail = any(part.subcon is GreedyBytes for part in definition.subcons)
    tail = data.draw(st.binary(max_size=40)) if has_tail else b""
    wire = set_constants(definition, data.draw(st.binary(min_size=size, max_size=size))) + tail
    parsed = remove_io(definition.parse(wire))
    fields, remainder = unpack(definition, wire)
    flat = flatten(parsed)
    assert remainder == tail
    assert {name: flat[name] for name in fields} == fields
    assert definition.build(parsed) == pack(definition, fields, remainder) == wire


def field_values(definition: Struct) -> st.SearchStrategy[dict[str, Any]]:
    """Return a strategy for the fields of a struct: any values of its parts of fixed size, and of its tail."""
    parts = {}
    for renamed in definition.subcons:
        assert isinstance(renamed, Renamed)
        inner: Any = renamed.subcon
        if isinstance(inner, Const):
            continue
        if isinstance(inner, Struct):
            parts[renamed.name] = field_values(inner)
        elif isinstance(inner, (FormatField, BytesInteger)):
            parts[renamed.name] = st.integers(0, 256 ** inner.sizeof() - 1)
        elif isinstance(inner, Bytes):
            parts[renamed.name] = st.binary(min_size=inner.sizeof(), max_size=inner.sizeof())
        else:
            assert inner is GreedyBytes, f"{renamed.name}: this test does not support its construct"
            parts[renamed.name] = st.binary(max_size=64)
    return st.fixed_dictionaries(parts)


@st.composite
def taxel_fields(draw: st.DrawFn) -> dict[str, Any]:
    """Draw the fields of a TAXELS payload."""
    counts = draw(st.lists(st.integers(0, 65535), min_size=1, max_size=8) | st.just([7] * TAXELS_MAX))
    header = draw(field_values(frames.TaxelHeader)) | {"taxel_count": len(counts)}
    snapshot = {"header": draw(field_values(registers.SnapshotHeader)), "raw_counts": counts}
    return {"header": header, "snapshot": snapshot | {"crc32": draw(st.integers(0, 2**32 - 1))}}


@st.composite
def contents(draw: st.DrawFn) -> dict[str, Any]:
    """Draw the fields of any frame that the protocol allows."""
    kind = draw(st.sampled_from(list(FRAMES)))
    payload = draw(taxel_fields() if kind == FrameType.TAXELS else field_values(FRAMES[kind].payload))
    tail = next((part.name for part in FRAMES[kind].payload.subcons if part.subcon is GreedyBytes), None)
    if tail is not None:
        fixed = len(FRAMES[kind].payload.build(payload | {tail: b""}))
        payload[tail] = payload[tail].ljust(FRAMES[kind].minimum - fixed, b"\0")[: FRAMES[kind].maximum - fixed]
    if FRAMES[kind].has_address:
        inner = payload.get("header", payload)
        inner["address"] = ADDRESS_MIN + inner["address"] % (ADDRESS_MAX - ADDRESS_MIN + 1)
    return {"type": int(kind), "sequence": draw(st.integers(0, 65535)), "payload": payload}


def test_taxel_fields_match_the_definition_of_a_taxel_frame() -> None:
    """The payload is that of board 0x20 with 1 taxel: 20 bytes, all zero after the address and the number of taxels."""
    content = FRAMES[FrameType.TAXELS].payload.parse(bytes([0x20, 1]) + bytes(18))
    assert list(remove_io(content)) == ["header", "snapshot"]
    assert list(remove_io(content.snapshot)) == ["header", "raw_counts", "crc32"]
    assert isinstance(registers.snapshot(1).subcons[1].subcon, type(Array(1, Int16ul)))


@bounded
@given(content=contents())
def test_every_decoder_decodes_a_frame_built_by_construct(
    codec: Any, oracle: ModuleType, content: dict[str, Any]
) -> None:
    wire = WireFrame.build(content)
    payload = FRAMES[FrameType(content["type"])].payload.build(content["payload"])
    frame = (content["type"], content["sequence"], payload)
    assert encode_frame(*frame) == codec.encode(*frame) == wire
    assert oracle.parse_stream(wire) == ReferenceDecoder().push(wire) == codec.decode([wire]) == [frame]
    assert codec.decode_batch([wire]) == codec.as_batch([frame])


@st.composite
def wires(draw: st.DrawFn) -> bytes:
    """Draw consecutive frames, with or without delimiters between them."""
    parts = [WireFrame.build(content) for content in draw(st.lists(contents(), max_size=5))]
    return b"".join(part[draw(st.integers(0, 1)) : len(part) - draw(st.integers(0, 1))] for part in parts)


DAMAGES = ("flip", "insert", "delete", "duplicate", "truncate", "burst")


@st.composite
def damaged_streams(draw: st.DrawFn) -> bytes:
    """Draw consecutive frames with up to four kinds of damage."""
    stream = draw(wires())
    for kind in draw(st.lists(st.sampled_from(DAMAGES), max_size=4)):
        at = draw(st.integers(0, max(len(stream) - 1, 0)))
        size = draw(st.integers(1, 40))
        noise = draw(st.binary(min_size=size, max_size=size))
        part = stream[at : at + size]
        stream = {
            "flip": stream[:at] + bytes(byte ^ (noise[0] or 1) for byte in part[:1]) + stream[at + 1 :],
            "insert": stream[:at] + noise[:1] + stream[at:],
            "delete": stream[:at] + stream[at + 1 :],
            "duplicate": stream[:at] + part + stream[at:],
            "truncate": stream[:at],
            "burst": stream[:at] + noise[: len(part)] + stream[at + size :],
        }[kind]
    return stream


def split_at(stream: bytes, cuts: list[int]) -> list[bytes]:
    """Split a stream at these positions, each taken modulo its length."""
    positions = sorted({0, len(stream), *(c % (len(stream) + 1) for c in cuts)})
    return [stream[a:b] for a, b in pairwise(positions)]


def is_rejected_by_construct_only(frame: tuple[int, int, bytes]) -> bool:
    """Return whether only construct rejects a frame: it also checks the constant WHO_AM_I of BOARD_INFO."""
    return frame[0] == FrameType.BOARD_INFO and frame[2][0] != WHO_AM_I


def check_agreement(
    codec: Any, oracle: ModuleType, stream: bytes, cuts: list[int], directions: int
) -> list[tuple[int, int, bytes]]:
    """Check that every decoder gives the same frames for a stream split at `cuts`, and return the frames.

    directions: accepted frame types, 1: to the host, 2: to the hub, 3: both; the reference decoder accepts both.
    """
    pieces = split_at(stream, cuts)
    frames: list[tuple[int, int, bytes]] = codec.decode(pieces, directions)
    discarded = codec.discarded_bytes
    reference = ReferenceDecoder()
    expected = [frame for piece in pieces for frame in reference.push(piece)] + reference.finish()
    if directions == 3:
        assert discarded == reference.discarded_bytes
        assert frames == expected
    assert codec.decode([stream], directions) == frames
    assert codec.discarded_bytes == discarded
    assert codec.decode_batch(pieces, directions) == codec.as_batch(frames)
    assert oracle.parse_stream(stream, directions) == [f for f in frames if not is_rejected_by_construct_only(f)]
    return frames


cut_positions = st.lists(st.integers(0, 1 << 20), max_size=6)


@bounded
@given(stream=damaged_streams(), cuts=cut_positions, directions=st.sampled_from([1, 2, 3, 3]))
def test_all_decoders_agree_on_a_damaged_stream(
    codec: Any, oracle: ModuleType, stream: bytes, cuts: list[int], directions: int
) -> None:
    check_agreement(codec, oracle, stream, cuts, directions)


@bounded
@given(stream=st.binary(max_size=700), cuts=cut_positions)
def test_all_decoders_agree_on_any_bytes(codec: Any, oracle: ModuleType, stream: bytes, cuts: list[int]) -> None:
    check_agreement(codec, oracle, stream, cuts, 3)


@settings(bounded, max_examples=max(EXAMPLES // 5, 1))
@given(stream=wires(), cuts=cut_positions, length=st.integers(1000, 2600), filling=st.binary(min_size=1, max_size=9))
def test_all_decoders_agree_on_a_long_stream_without_delimiters(
    codec: Any, oracle: ModuleType, stream: bytes, cuts: list[int], length: int, filling: bytes
) -> None:
    """The stream has more bytes without a zero than a receiver's buffer, with frames in the middle."""
    random_bytes = bytes(byte or 0xFF for byte in filling) * (length // len(filling) + 1)
    wire = bytes(byte for byte in stream if byte)
    # 3: frames of both directions are accepted.
    check_agreement(codec, oracle, random_bytes[: length // 2] + wire + random_bytes[: length // 2], cuts, 3)
