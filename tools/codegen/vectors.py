"""Write protocol/vectors/*.json, and the field tables of the C test, from the construct definitions.

python tools/codegen/vectors.py            write them
python tools/codegen/vectors.py --check    exit status 1 if a file on disk is stale

This module writes frames.json and registers.json, and then runs the programs of GENERATORS. All values are constants
or come from a seeded generator: the same definitions give the same files.
"""

import json
import random
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from construct import Struct
from field_values import SEED, compute_board_crc, fill_fields, find_tail_name, nest_values, to_json_values
from generated_files import write_or_check
from register_vectors import build_register_vectors

from taxel_protocol import frames, limits, registers
from taxel_protocol.frames import FRAMES
from taxel_protocol.framing import whiten
from taxel_protocol.layout import Field, list_fields
from taxel_protocol.limits import BOOTLOADER_KEY
from taxel_protocol.names import Command, FaultCode, FrameType, StartFlag
from taxel_protocol.wire import Body, WireFrame

HERE = Path(__file__).resolve().parent
VECTORS = HERE.parents[1] / "protocol" / "vectors"

GENERATORS = (
    *("damaged_streams.py", "field_tables.py", "compact_vectors.py"),
    *("original_header.py", "original_vectors.py"),
)
"""Programs that run after this one."""

INNER: dict[str, Struct] = {
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
"""Structs in the tail of a command or a reply, by their C name."""


@dataclass(frozen=True)
class Sample:
    """One frame as fields and as bytes; `vector` is its entry in the file."""

    vector: dict[str, Any]

    @property
    def wire(self) -> bytes:
        """Bytes on the wire, delimiters included."""
        return bytes.fromhex(self.vector["wire"])


def build_sample(
    name: str,
    frame_type: FrameType,
    sequence: int,
    values: Mapping[str, Any],
    tail: bytes = b"",
    inner: dict[str, Any] | None = None,
) -> Sample:
    """Build a test frame of any type except TAXELS.

    values: by field name. tail: bytes of variable length at the end of the payload. inner: entry of the file for the
    struct that these bytes contain, if they contain one.
    """
    definition = FRAMES[frame_type].payload
    flat = dict(values)
    if find_tail_name(definition):
        flat[str(find_tail_name(definition))] = tail
    vector: dict[str, Any] = {
        "name": name,
        "type": int(frame_type),
        "type_name": frame_type.name,
        "sequence": sequence,
    }
    vector["fields"] = to_json_values(list_fields(definition), flat)
    vector["tail"] = tail.hex()
    if inner:
        vector["inner"] = inner
    return Sample(vector | _encode_frame(frame_type, sequence, nest_values(definition, flat)))


def _encode_frame(frame_type: FrameType, sequence: int, payload: Mapping[str, Any]) -> dict[str, str]:
    """Return the payload, the body (with header and CRC, before whitening) and the wire bytes, all in hexadecimal
    digits.
    """
    content = {"type": int(frame_type), "sequence": sequence, "payload": payload}
    body = Body.build({"content": {"value": content}})
    return {"payload": body[5:-4].hex(), "body": body.hex(), "wire": WireFrame.build(content).hex()}


def build_taxel_frame(
    name: str,
    sequence: int,
    counts: Sequence[int],
    address: int = 0x20,
    cycle: int = 0,
    times_us: tuple[int, int] = (0, 0),
    board_sequence: int = 0,
    crc_error: int = 0,
) -> Sample:
    """Build a test frame with raw counts.

    times_us: hub time and board time. crc_error: number that is XORed into the board's CRC; 0 leaves it correct.
    """
    flat: dict[str, Any] = {
        "header_address": address,
        "header_taxel_count": len(counts),
        "header_cycle": cycle,
        "header_hub_time_us": times_us[0],
        "snapshot_header_sequence": board_sequence,
        "snapshot_header_timestamp_us": times_us[1],
        "snapshot_raw_counts": list(counts),
        "snapshot_crc32": 0,
    }
    definition = registers.snapshot(len(counts))
    without_crc = definition.build(nest_values(definition, flat, "snapshot_"))[:-4]
    flat["snapshot_crc32"] = compute_board_crc(address, without_crc) ^ crc_error
    payload = FRAMES[FrameType.TAXELS].payload
    fields = to_json_values(list_fields(payload), flat) | {"snapshot_crc32": flat["snapshot_crc32"]}
    vector = {
        "name": name,
        "type": int(FrameType.TAXELS),
        "type_name": "TAXELS",
        "sequence": sequence,
        "fields": fields,
    }
    vector |= {"counts": list(counts), "board_crc_ok": not crc_error, "tail": ""}
    return Sample(vector | _encode_frame(FrameType.TAXELS, sequence, nest_values(payload, flat)))


VERSION_1 = tuple(kind for kind in FRAMES if kind not in (FrameType.COMPACT_TAXELS, FrameType.ACKNOWLEDGE))
VERSION_2 = (FrameType.COMPACT_TAXELS, FrameType.ACKNOWLEDGE)
"""Each version has its own random generator, so that the vectors of a released version do not change."""


def build_every_type(rng: random.Random, types: Sequence[FrameType]) -> list[Sample]:
    """Build test frames of all `types` except TAXELS.

    Each type occurs with fields of zeros, ones and random numbers, and with the shortest and the longest tail.
    """
    samples = []
    fillings: tuple[tuple[str, Callable[[Field], int], int], ...] = (
        ("zeros", lambda field: 0, 0),
        ("ones", lambda field: (1 << (8 * field.size)) - 1, 0xFFFF),
        ("arbitrary", lambda field: rng.getrandbits(8 * field.size), 0x1234),
    )
    for frame_type in types:
        if frame_type == FrameType.TAXELS:
            continue
        spec = FRAMES[frame_type]
        fields = list_fields(spec.payload)
        fixed = sum(field.size for field in fields)
        shortest, longest = spec.minimum - fixed, spec.maximum - fixed
        for filling, value, sequence in fillings:
            name = f"{frame_type.name.lower()}_{filling}"
            values = fill_fields(fields, value, spec.has_address)
            tail = bytes(value(Field("", "B", 0, 1)) for _ in range(longest))
            samples.append(build_sample(name, frame_type, sequence, values, tail[:shortest]))
            if longest > shortest:
                samples.append(build_sample(f"{name}_longest", frame_type, sequence, values, tail))
    return samples


def _build_inner_struct(name: str, values: Mapping[str, Any], tail: bytes = b"") -> tuple[bytes, dict[str, Any]]:
    """Build a struct that is the tail of a command or a reply.

    Returns its bytes, and its entry in the file: name, fields and its own tail.
    """
    definition = INNER[name]
    flat = dict(values)
    if find_tail_name(definition):
        flat[str(find_tail_name(definition))] = tail
    data = definition.build(nest_values(definition, flat))
    return data, {"struct": name, "fields": to_json_values(list_fields(definition), flat), "tail": tail.hex()}


def build_every_command() -> list[Sample]:
    """Build a test frame of each command, and of the replies and acknowledgements that carry a struct."""
    settings = {"sub_conversions": 100, "sense_clock_divider": 40, "modulator_clock_divider": 1}
    settings |= {"idac_code": 96, "settle_cycles": 240}
    on_all_boards = {"address": 0, "front_end": 0} | {f"settings_{name}": value for name, value in settings.items()}
    arguments: dict[Command, tuple[bytes, dict[str, Any] | None]] = dict.fromkeys(Command, (b"", None))
    arguments[Command.SET_RATE] = _build_inner_struct("set_rate_arguments", {"period_us": 52_632})
    arguments[Command.ENTER_BOOTLOADER] = _build_inner_struct("enter_bootloader_arguments", {"key": BOOTLOADER_KEY})
    arguments[Command.I2C_TRANSFER] = _build_inner_struct(
        "transfer_arguments", {"address": 0x21, "read_length": 28}, b"\x40"
    )
    arguments[Command.SET_SCAN_SETTINGS] = _build_inner_struct("set_scan_settings_arguments", on_all_boards)
    arguments[Command.GET_BOARD_INFO] = _build_inner_struct("get_board_info_arguments", {"address": 0x30})
    samples = []
    for tag, (command, (tail, inner)) in enumerate(arguments.items()):
        values = {"tag": tag, "command": int(command)}
        samples.append(build_sample(f"command_{command.name.lower()}", FrameType.COMMAND, tag, values, tail, inner))
    values = {"tag": 9, "command": int(Command.GET_TIME), "status": 0}
    tail, inner = _build_inner_struct("start_arguments", {"flags": int(StartFlag.COMPACT)})
    started = {"tag": 10, "command": int(Command.START)}
    samples.append(build_sample("command_start_compact", FrameType.COMMAND, 78, started, tail, inner))
    tail, inner = _build_inner_struct("acknowledgement", {"address": 0x20, "key_frame": 0xBEEF})
    samples.append(build_sample("acknowledge_one", FrameType.ACKNOWLEDGE, 79, {}, tail, inner))
    tail, inner = _build_inner_struct("get_time_reply", {"hub_time_us": 4_295_000_000})
    samples.append(build_sample("reply_get_time", FrameType.REPLY, 77, values, tail, inner))
    record = {"code": int(FaultCode.EXCEPTION), "exception": 3, "count": 1}
    record |= {"program_counter": 0x1A2C, "link_register": 0x1B47}
    tail, inner = _build_inner_struct("fault_record", record)
    values = {"tag": 12, "command": int(Command.GET_FAULT), "status": 0}
    return [*samples, build_sample("reply_get_fault", FrameType.REPLY, 80, values, tail, inner)]


def _find_zeros(frame: Sample) -> list[int]:
    """Return the positions of the zero bytes in a frame's whitened body, which byte stuffing has to replace."""
    body = whiten(bytes.fromhex(frame.vector["body"]))
    return [i for i, byte in enumerate(body) if byte == 0]


def _build_frame_with_zeros(name: str, taxel_count: int, zeros: list[int]) -> Sample:
    """Build a taxel frame whose whitened body has zero bytes at exactly the given positions.

    Byte stuffing replaces zeros, so the positions determine the lengths of the runs without a zero, which are edge
    cases of byte stuffing. Whitening is an XOR with a fixed sequence (`key`), so that a body byte equal to the key
    whitens to zero. The hub time changes the CRC; it is varied until the CRC has zeros only at the given positions.
    """
    key = whiten(bytes(limits.BODY_MAX))
    # Bytes 1 and 2 of a body are the sequence number. 0x77 and 0x41 are arbitrary; the result is checked below.
    sequence = sum((key[i] if i in zeros else 0x77) << (8 * (i - 1)) for i in (1, 2))
    start = limits.FRAME_HEADER_SIZE + frames.TaxelHeader.sizeof() + registers.SnapshotHeader.sizeof()
    data = [key[i] ^ (0 if i in zeros else 0x41) for i in range(start, start + 2 * taxel_count)]
    counts = [data[i] | data[i + 1] << 8 for i in range(0, len(data), 2)]
    for attempt in range(10_000):
        times = (0x51525354 + attempt, 0x61626364)
        frame = build_taxel_frame(name, sequence, counts, 0x31, 0x4142, times, board_sequence=0x3132)
        if _find_zeros(frame) == zeros:
            return frame
    raise AssertionError(f"{name}: no frame has zeros at these positions")


def build_stuffing_edges() -> list[Sample]:
    """Build the frames at the edge cases of byte stuffing, which codes runs without a zero in blocks of at most 254
    bytes: runs of 253 to 255 bytes, and longer ones.
    """
    key = whiten(bytes(limits.BODY_MAX))
    samples = [
        _build_frame_with_zeros("run_253_then_zero", 120, [2, 256]),
        _build_frame_with_zeros("run_254_then_zero", 120, [2, 257]),
        _build_frame_with_zeros("run_255_then_zero", 120, [2, 258]),
        _build_frame_with_zeros("run_254_from_start_then_zero", 120, [254]),
        _build_frame_with_zeros("run_253_at_end", 114, [1]),
        _build_frame_with_zeros("run_254_at_end", 115, [2]),
        _build_frame_with_zeros("run_255_at_end", 115, [1]),
        _build_frame_with_zeros("body_253_without_zero", 113, []),
        _build_frame_with_zeros("body_255_without_zero", 114, []),
        _build_frame_with_zeros("body_507_without_zero", 240, []),
        _build_frame_with_zeros("run_472_at_end", 224, [1, 2]),
        _build_frame_with_zeros("two_zeros_in_a_row", 20, [40, 41]),
    ]
    start = limits.FRAME_HEADER_SIZE + FRAMES[FrameType.REPLY].minimum
    values = {"tag": key[5], "command": key[6], "status": key[7]}
    samples.append(build_sample("payload_whitens_to_zeros", FrameType.REPLY, 3, values, key[start : start + 128]))
    last = b"the last byte whitens to zero"
    last += key[start + len(last) : start + len(last) + 1]
    samples.append(build_sample("payload_ends_in_zero", FrameType.REPLY, 4, values, last))
    for sequence in range(65_536):
        frame = build_sample("body_ends_in_zero", FrameType.COMMAND, sequence, {"tag": 1, "command": 1})
        if frame.wire[-2] == 1:  # byte stuffing codes a zero at the end of the body as a last byte of 1
            return [*samples, frame]
    raise AssertionError("no sequence number gives a CRC that ends in zero")


def build_taxel_frames(rng: random.Random) -> list[Sample]:
    """Build taxel frames with 1 to 240 taxels; 63 is the mean of the default hand's boards."""
    arbitrary = [rng.getrandbits(16) for _ in range(limits.TAXELS_MAX)]
    last = {"address": limits.ADDRESS_MAX, "cycle": 0xFFFF, "times_us": (0xFFFFFFFF, 0xFFFFFFFF)}
    return [
        build_taxel_frame("taxels_shortest", 0, [0], limits.ADDRESS_MIN),
        build_taxel_frame("taxels_longest_zeros", 1, [0] * limits.TAXELS_MAX, limits.ADDRESS_MIN),
        build_taxel_frame("taxels_longest_ones", 0xFFFF, [0xFFFF] * limits.TAXELS_MAX, board_sequence=0xFFFF, **last),  # type: ignore[arg-type]
        build_taxel_frame("taxels_longest_arbitrary", 0x8000, arbitrary, 0x2A, 999, (123_456_789, 98_765_432), 4321),
        build_taxel_frame("taxels_63", 258, arbitrary[:63], 0x30, 7, (1_000_000, 2_000_000), 55),
        build_taxel_frame(
            "taxels_idle_counts", 259, [4000 - i % 7 for i in range(63)], 0x21, 8, (1_052_632, 52_000), 56
        ),
        build_taxel_frame("taxels_bad_board_crc", 260, arbitrary[:5], 0x22, 8, (1_053_000, 52_000), 57, crc_error=1),
    ]


def build_quotations(quoted: Sample) -> list[Sample]:
    """Build frames whose payload contains the wire bytes of the frame `quoted`: once, twice, and without delimiters."""
    once, twice, stuffed = quoted.wire, quoted.wire * 2, quoted.wire[1:-1]
    log = {"level": 2, "code": 0x102, "hub_time_us": 123_456}
    reply = {"tag": 7, "command": int(Command.I2C_TRANSFER), "status": 0}
    samples = []
    for variant, data in (("wire", once), ("two_wires", twice), ("stuffed", stuffed)):
        samples.append(build_sample(f"log_quotes_{variant}", FrameType.LOG, 9, log, data))
        samples.append(build_sample(f"reply_quotes_{variant}", FrameType.REPLY, 10, reply, data))
    return samples


def build_all_frames() -> list[Sample]:
    """Build all test frames of frames.json, in the order of the file."""
    rng = random.Random(SEED)
    samples = [
        *build_every_type(rng, VERSION_1),
        *build_every_command(),
        *build_taxel_frames(rng),
        *build_stuffing_edges(),
    ]
    samples += build_quotations(next(s for s in samples if s.vector["name"] == "time_sync_arbitrary"))
    return [*samples, *build_every_type(random.Random(SEED + 1), VERSION_2)]


def format_json(key: str, about: str, vectors: Sequence[Mapping[str, Any]]) -> str:
    """Return the text of a vector file, with one vector per line so that a diff shows which vector changed."""
    head = json.dumps(
        {"about": about, "protocol_version": limits.PROTOCOL_VERSION, "made_by": "tools/codegen/vectors.py"}
    )
    lines = ",\n".join(json.dumps(vector) for vector in vectors)
    return f'{head[:-1]}, "{key}": [\n{lines}\n]}}\n'


def main() -> int:
    """Write all files of test vectors, or with --check compare them; the exit status is not 0 if a file is stale."""
    frames = [frame.vector for frame in build_all_frames()]
    status = write_or_check(
        {
            VECTORS / "frames.json": format_json("frames", "UART frames: fields and bytes", frames),
            VECTORS / "registers.json": format_json(
                "registers", "I2C registers: fields and bytes", build_register_vectors()
            ),
        }
    )
    runs = [subprocess.run([sys.executable, str(HERE / name), *sys.argv[1:]]).returncode for name in GENERATORS]
    return max(status, *runs)


if __name__ == "__main__":
    sys.exit(main())
