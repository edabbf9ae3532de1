"""The vectors, the construct definitions and the reference codec agree on every byte."""

import json
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from construct import Const, GreedyBytes, Int8ul, Struct

from taxel_protocol import ReferenceDecoder, crc32, encode_frame, frames, registers
from taxel_protocol.frames import FRAMES
from taxel_protocol.framing import cobs_decode, cobs_encode, decode_body, whiten
from taxel_protocol.layout import flatten, list_fields, pack, unpack
from taxel_protocol.names import FrameType
from taxel_protocol.wire import WireFrame

ROOT = Path(__file__).resolve().parents[2]
GENERATORS = ("c_header.py", "vectors.py")
INNER = {
    "acknowledgement": frames.Acknowledgement,
    "start_arguments": frames.StartArguments,
    "set_rate_arguments": frames.SetRateArguments,
    "enter_bootloader_arguments": frames.EnterBootloaderArguments,
    "transfer_arguments": frames.TransferArguments,
    "set_scan_settings_arguments": frames.SetScanSettingsArguments,
    "get_board_info_arguments": frames.GetBoardInfoArguments,
    "get_time_reply": frames.GetTimeReply,
    "fault_record": registers.FaultRecord,
}
REGISTERS = {
    "identity": registers.Identity,
    "status": registers.Status,
    "settings_register": registers.SettingsRegister,
    "command_register": registers.CommandRegister,
    "enter_bootloader_register": registers.EnterBootloaderRegister,
    "fault_register": registers.FaultRegister,
    "compact_packed": registers.CompactPacked,
    "compact_delta": registers.CompactDelta,
    "compact_acknowledge": registers.CompactAcknowledge,
}


def load_vectors(name: str, key: str) -> list[Any]:
    """Return the vectors of the list `key` of a vector file as parameters of a test."""
    content = json.loads((ROOT / "protocol" / "vectors" / f"{name}.json").read_text())
    return [pytest.param(vector, id=vector["name"]) for vector in content[key]]


every_frame = pytest.mark.parametrize("vector", load_vectors("frames", "frames"))
every_register = pytest.mark.parametrize("vector", load_vectors("registers", "registers"))
every_stream = pytest.mark.parametrize("vector", load_vectors("damaged", "streams"))


def from_json_values(fields: Mapping[str, Any]) -> dict[str, Any]:
    """Convert the fields of a vector to values of construct: hexadecimal text to bytes."""
    return {name: bytes.fromhex(value) if isinstance(value, str) else value for name, value in fields.items()}


def to_json_values(values: Mapping[str, Any]) -> dict[str, Any]:
    """Convert values of construct to the fields of a vector: bytes to hexadecimal text."""
    return {name: value.hex() if isinstance(value, bytes) else value for name, value in values.items()}


def nest_values(definition: Struct, flat: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Return the nested values from which construct builds, from values by flat name and the tail."""
    values: dict[str, Any] = {}
    for renamed in definition.subcons:
        name = prefix + renamed.name
        if isinstance(renamed.subcon, Struct):
            values[renamed.name] = nest_values(renamed.subcon, flat, f"{name}_")
        elif renamed.subcon is GreedyBytes:
            values[renamed.name] = flat["tail"]
        elif not isinstance(renamed.subcon, Const):
            values[renamed.name] = flat[name]
    return values


def encode_counts(counts: list[int]) -> bytes:
    """Encode raw counts as in a taxel frame, two bytes each, low byte first."""
    return b"".join(count.to_bytes(2, "little") for count in counts)


def get_flat_values(vector: Mapping[str, Any]) -> dict[str, Any]:
    """Return the values of a vector by flat name, with its tail and its counts."""
    flat = from_json_values(vector["fields"]) | {"tail": bytes.fromhex(vector["tail"])}
    return flat | {"snapshot_raw_counts": vector.get("counts")}


def build_packed_payload(vector: Mapping[str, Any]) -> bytes:
    """Pack the payload of a vector with `layout` instead of construct."""
    definition = FRAMES[FrameType(vector["type"])].payload
    flat = get_flat_values(vector)
    if vector["type"] == FrameType.TAXELS:
        return pack(definition, flat, encode_counts(vector["counts"]) + flat["snapshot_crc32"].to_bytes(4, "little"))
    return pack(definition, flat, flat["tail"])


@every_frame
def test_construct_builds_the_vector(vector: dict[str, Any]) -> None:
    definition = FRAMES[FrameType(vector["type"])].payload
    payload = nest_values(definition, get_flat_values(vector))
    content = {"type": vector["type"], "sequence": vector["sequence"], "payload": payload}
    assert WireFrame.build(content).hex() == vector["wire"]


@every_frame
def test_the_reference_codec_encodes_the_vector(vector: dict[str, Any]) -> None:
    payload = build_packed_payload(vector)
    assert payload.hex() == vector["payload"]
    assert encode_frame(vector["type"], vector["sequence"], payload).hex() == vector["wire"]


@every_frame
def test_construct_parses_the_fields_of_the_vector(vector: dict[str, Any]) -> None:
    content = WireFrame.parse(bytes.fromhex(vector["wire"]))
    definition = FRAMES[FrameType(vector["type"])].payload
    assert (content.type, content.sequence) == (vector["type"], vector["sequence"])
    payload = {k: v for k, v in content.payload.items() if k != "_io"}
    expected = nest_values(definition, get_flat_values(vector))
    assert definition.build(payload) == definition.build(expected)
    # `nest_values` omits constants such as `who_am_i`: construct writes them by itself.
    common = {name: value for name, value in flatten(expected).items() if name in vector["fields"]}
    assert to_json_values(common) == {name: v for name, v in vector["fields"].items() if not name.endswith("who_am_i")}


@every_frame
def test_the_reference_codec_decodes_the_fields_of_the_vector(vector: dict[str, Any]) -> None:
    body = bytes.fromhex(vector["body"])
    decoder = ReferenceDecoder()
    assert whiten(cobs_decode(bytes.fromhex(vector["wire"])[1:-1])) == body
    assert decode_body(body) == (vector["type"], vector["sequence"], body[5:-4])
    assert decoder.push(bytes.fromhex(vector["wire"])) == [decode_body(body)]
    assert decoder.discarded_bytes == 0
    fields, tail = unpack(FRAMES[FrameType(vector["type"])].payload, body[5:-4])
    if vector["type"] == FrameType.TAXELS:
        fields["snapshot_crc32"] = int.from_bytes(tail[-4:], "little")
        assert tail[:-4] == encode_counts(vector["counts"])
    else:
        assert tail.hex() == vector["tail"]
    assert to_json_values(fields) == vector["fields"]


@every_frame
def test_a_struct_in_a_tail_packs_to_the_tails_bytes(vector: dict[str, Any]) -> None:
    """The entry `inner` of a vector contains the fields of the struct that its tail consists of."""
    if "inner" not in vector:
        return
    inner = vector["inner"]
    definition = INNER[inner["struct"]]
    data = pack(definition, from_json_values(inner["fields"]), bytes.fromhex(inner["tail"]))
    assert data.hex() == vector["tail"]
    assert (
        definition.build(
            nest_values(definition, from_json_values(inner["fields"]) | {"tail": bytes.fromhex(inner["tail"])})
        )
        == data
    )


def test_no_field_after_a_part_without_a_fixed_size_is_listed() -> None:
    inner = Struct("first" / Int8ul, "tail" / GreedyBytes)
    definition = Struct("head" / Int8ul, "inner" / inner, "last" / Int8ul)
    assert [field.name for field in list_fields(definition)] == ["head", "inner_first"]


@every_register
def test_a_register_vector_packs_and_unpacks(vector: dict[str, Any]) -> None:
    data = bytes.fromhex(vector["bytes"])
    prefix = bytes([vector["address"]]) if "address" in vector else b""
    if vector["struct"] == "snapshot_header":
        definition = registers.snapshot(len(vector["counts"]))
        content = {"header": vector["fields"], "raw_counts": vector["counts"], "crc32": vector["crc32"]}
        assert definition.build(content) == data
        assert crc32(prefix + data[:-4]) == vector["crc32"]
        return
    definition = REGISTERS[vector["struct"]]
    fields, tail = unpack(definition, data)
    assert definition.build(nest_values(definition, from_json_values(vector["fields"]))) == data
    assert pack(definition, from_json_values(vector["fields"])) == data
    assert (to_json_values(fields), tail) == (vector["fields"], b"")
    if "crc32" in fields:
        assert crc32(prefix + data[:-4]) == fields["crc32"]


def test_the_vectors_contain_every_frame_type_in_its_shortest_and_longest_length() -> None:
    for frame_type, spec in FRAMES.items():
        sizes = [
            len(p.values[0]["payload"]) // 2
            for p in load_vectors("frames", "frames")
            if p.values[0]["type"] == frame_type
        ]
        assert (min(sizes), max(sizes)) == (spec.minimum, spec.maximum), frame_type.name


@every_stream
def test_the_reference_decoder_decodes_the_intact_frames_of_a_damaged_stream(vector: dict[str, Any]) -> None:
    decoder = ReferenceDecoder()
    frames = decoder.push(bytes.fromhex(vector["stream"])) + decoder.finish()
    # directions: bit 0 accepts frames to the host, bit 1 frames to the hub, whose types have bit 7.
    accepted = [frame for frame in frames if vector["directions"] & (2 if frame[0] & 0x80 else 1)]
    sent = [(f["type"], f["sequence"], bytes.fromhex(f["payload"])) for f in vector["sent"]]
    assert accepted == [sent[i] for i in vector["expected"]]
    of_other_direction = len(frames) - len(accepted)
    assert decoder.unknown_frames + of_other_direction == vector["unknown"]


@pytest.mark.parametrize("length", [0, 1, 253, 254, 255, 256, 507, 508, 509, 762, 763])
@pytest.mark.parametrize("zero_at", [None, 0, 1, 253, 254, 255, -1])
def test_decoding_reverses_stuffing(length: int, zero_at: int | None) -> None:
    """A COBS block contains at most 254 bytes: the lengths and the places of a zero are near its multiples."""
    data = bytearray(b"\x2a" * length)
    if zero_at is not None and -length <= zero_at < length:
        data[zero_at] = 0
    stuffed = cobs_encode(bytes(data))
    assert 0 not in stuffed
    assert cobs_decode(stuffed) == data
    assert len(stuffed) <= length + length // 254 + 1


@pytest.mark.parametrize("generator", GENERATORS)
def test_generated_files_are_not_stale(generator: str) -> None:
    script = ROOT / "tools" / "codegen" / generator
    result = subprocess.run([sys.executable, str(script), "--check"], capture_output=True, text=True, timeout=60)
    assert result.returncode == 0, result.stderr
