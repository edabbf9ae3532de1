"""Write protocol/vectors/*.json, and the field tables of the C test that reads them, from the construct definitions.

    python tools/codegen/vectors.py            write them
    python tools/codegen/vectors.py --check    exit status 1 if a file on disk is stale

Everything is made of fixed numbers and a seeded generator: the same definitions give the same files.
"""

import json
import random
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from construct import Const, GreedyBytes, Struct
from taxel_protocol import frames, limits, registers
from taxel_protocol.frames import FRAMES
from taxel_protocol.framing import crc32, encode_body, whiten
from taxel_protocol.layout import Field, fields_of
from taxel_protocol.names import BoardCommand, Command, FrameType
from taxel_protocol.wire import Body, WireFrame

ROOT = Path(__file__).resolve().parents[2]
VECTORS = ROOT / "protocol" / "vectors"
FIELDS_HEADER = ROOT / "firmware" / "tests" / "generated_fields.h"
SEED = 20

TO_HOST, TO_HUB, BOTH_WAYS = 1, 2, 3
"""Which directions a decoder believes, as the C decoder's `directions`."""

INNER: dict[str, Struct] = {
    "set_rate_arguments": frames.SetRateArguments,
    "transfer_arguments": frames.TransferArguments,
    "set_scan_settings_arguments": frames.SetScanSettingsArguments,
    "get_board_info_arguments": frames.GetBoardInfoArguments,
    "get_time_reply": frames.GetTimeReply,
}
"""Structs that stand in the tail of a command or a reply, by their name in C."""

REGISTERS: dict[str, Struct] = {
    "identity": registers.Identity,
    "status": registers.Status,
    "settings_register": registers.SettingsRegister,
    "command_register": registers.CommandRegister,
    "snapshot_header": registers.SnapshotHeader,
}

PAYLOAD_PARTS: dict[FrameType, tuple[tuple[str, str, Struct], ...]] = {
    FrameType.HUB_HELLO: (("hub_hello", "", frames.HubHello),),
    FrameType.TAXELS: (
        ("taxel_header", "header_", frames.TaxelHeader),
        ("snapshot_header", "snapshot_header_", registers.SnapshotHeader),
    ),
    FrameType.HUB_STATUS: (("hub_status", "", frames.HubStatus),),
    FrameType.BOARD_STATUS: (("board_status", "", frames.BoardStatus),),
    FrameType.BOARD_INFO: (("board_info", "", frames.BoardInfo),),
    FrameType.BOARD_FAULT: (("board_fault_report", "", frames.BoardFaultReport),),
    FrameType.TIME_SYNC: (("time_sync", "", frames.TimeSync),),
    FrameType.LOG: (("log_header", "", frames.Log),),
    FrameType.REPLY: (("reply_header", "", frames.Reply),),
    FrameType.HOST_HELLO: (("host_hello", "", frames.HostHello),),
    FrameType.COMMAND: (("command_header", "", frames.CommandPayload),),
}
"""Structs at the front of each payload: name in C, prefix of their fields' flat names, definition."""


def nest(definition: Struct, flat: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """The nested values that construct builds from, out of flat names."""
    nested: dict[str, Any] = {}
    for renamed in definition.subcons:
        name = prefix + renamed.name
        if isinstance(renamed.subcon, Struct):
            nested[renamed.name] = nest(renamed.subcon, flat, name + "_")
        elif not isinstance(renamed.subcon, Const):
            nested[renamed.name] = flat[name]
    return nested


def tail_name(definition: Struct) -> str | None:
    """Name of the part without a fixed length at the end of `definition`, if it has one."""
    last = definition.subcons[-1]
    return str(last.name) if last.subcon is GreedyBytes else None


def plain(fields: Sequence[Field], values: Mapping[str, Any]) -> dict[str, Any]:
    """Field values as JSON has them: numbers, and byte strings in hexadecimal."""
    shown: dict[str, Any] = {}
    for field in fields:
        value = field.constant if field.constant is not None else values[field.name]
        shown[field.name] = value.hex() if field.is_bytes else value
    return shown


def board_crc(address: int, data: bytes) -> int:
    """CRC-32 with the board's address before the data, as boards compute it."""
    return crc32(data, crc32(bytes([address])))


@dataclass(frozen=True)
class Sample:
    """One frame as fields and as bytes; `vector` is what the file holds."""

    vector: dict[str, Any]

    @property
    def wire(self) -> bytes:
        """Bytes on the wire, delimiters included."""
        return bytes.fromhex(self.vector["wire"])

    @property
    def stuffed(self) -> bytes:
        """The same without delimiters."""
        return self.wire[1:-1]

    @property
    def sent(self) -> dict[str, Any]:
        """What a decoder has to give out."""
        return {key: self.vector[key] for key in ("type", "sequence", "payload")}


def sample(
    name: str,
    frame_type: FrameType,
    sequence: int,
    values: Mapping[str, Any],
    tail: bytes = b"",
    inner: dict[str, Any] | None = None,
) -> Sample:
    """A frame of any type but TAXELS, built by construct."""
    definition = FRAMES[frame_type].payload
    flat = dict(values)
    if tail_name(definition):
        flat[str(tail_name(definition))] = tail
    vector: dict[str, Any] = {"name": name, "type": int(frame_type), "type_name": frame_type.name, "sequence": sequence}
    vector["fields"] = plain(fields_of(definition), flat)
    vector["tail"] = tail.hex()
    if inner:
        vector["inner"] = inner
    return Sample(vector | _bytes_of(frame_type, sequence, nest(definition, flat)))


def _bytes_of(frame_type: FrameType, sequence: int, payload: Mapping[str, Any]) -> dict[str, str]:
    content = {"type": int(frame_type), "sequence": sequence, "payload": payload}
    body = Body.build({"content": {"value": content}})
    return {"payload": body[5:-4].hex(), "body": body.hex(), "wire": WireFrame.build(content).hex()}


def taxels(
    name: str,
    sequence: int,
    counts: Sequence[int],
    address: int = 0x20,
    cycle: int = 0,
    times_us: tuple[int, int] = (0, 0),
    board_sequence: int = 0,
    crc_error: int = 0,
) -> Sample:
    """A taxel frame; `times_us` are the hub's and the board's; `crc_error` is XORed into the board's CRC."""
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
    without_crc = definition.build(nest(definition, flat, "snapshot_"))[:-4]
    flat["snapshot_crc32"] = board_crc(address, without_crc) ^ crc_error
    payload = FRAMES[FrameType.TAXELS].payload
    fields = plain(fields_of(payload), flat) | {"snapshot_crc32": flat["snapshot_crc32"]}
    vector = {"name": name, "type": int(FrameType.TAXELS), "type_name": "TAXELS", "sequence": sequence, "fields": fields}
    vector |= {"counts": list(counts), "board_crc_ok": not crc_error, "tail": ""}
    return Sample(vector | _bytes_of(FrameType.TAXELS, sequence, nest(payload, flat)))


def _filled(fields: Sequence[Field], value: Callable[[Field], int], has_address: bool) -> dict[str, Any]:
    values: dict[str, Any] = {}
    for field in fields:
        number = value(field)
        values[field.name] = number.to_bytes(field.size, "little") if field.is_bytes else number
    if has_address:
        values["address"] = min(max(values["address"], limits.ADDRESS_MIN), limits.ADDRESS_MAX)
    return values


def every_type(rng: random.Random) -> list[Sample]:
    """Each type but TAXELS: all zeros, all ones, arbitrary numbers; with the shortest and the longest tail if it has one."""
    samples = []
    fillings: tuple[tuple[str, Callable[[Field], int], int], ...] = (
        ("zeros", lambda field: 0, 0),
        ("ones", lambda field: (1 << (8 * field.size)) - 1, 0xFFFF),
        ("arbitrary", lambda field: rng.getrandbits(8 * field.size), 0x1234),
    )
    for frame_type, spec in FRAMES.items():
        if frame_type == FrameType.TAXELS:
            continue
        fields = fields_of(spec.payload)
        longest = spec.maximum - spec.minimum
        for filling, value, sequence in fillings:
            name = f"{frame_type.name.lower()}_{filling}"
            values = _filled(fields, value, spec.has_address)
            samples.append(sample(name, frame_type, sequence, values))
            if longest:
                tail = bytes(value(Field("", "B", 0, 1)) for _ in range(longest))
                samples.append(sample(f"{name}_longest", frame_type, sequence, values, tail))
    return samples


def _inner(name: str, values: Mapping[str, Any], tail: bytes = b"") -> tuple[bytes, dict[str, Any]]:
    definition = INNER[name]
    flat = dict(values)
    if tail_name(definition):
        flat[str(tail_name(definition))] = tail
    data = definition.build(nest(definition, flat))
    return data, {"struct": name, "fields": plain(fields_of(definition), flat), "tail": tail.hex()}


def every_command() -> list[Sample]:
    """One frame of each command, and the reply that carries a struct."""
    settings = {"sub_conversions": 100, "sense_clock_divider": 40, "modulator_clock_divider": 1}
    settings |= {"idac_code": 96, "settle_cycles": 240}
    on_all_boards = {"address": 0} | {f"settings_{name}": value for name, value in settings.items()}
    arguments: dict[Command, tuple[bytes, dict[str, Any] | None]] = {command: (b"", None) for command in Command}
    arguments[Command.SET_RATE] = _inner("set_rate_arguments", {"period_us": 52_632})
    arguments[Command.I2C_TRANSFER] = _inner("transfer_arguments", {"address": 0x21, "read_length": 28}, b"\x40")
    arguments[Command.SET_SCAN_SETTINGS] = _inner("set_scan_settings_arguments", on_all_boards)
    arguments[Command.GET_BOARD_INFO] = _inner("get_board_info_arguments", {"address": 0x30})
    samples = []
    for tag, (command, (tail, inner)) in enumerate(arguments.items()):
        values = {"tag": tag, "command": int(command)}
        samples.append(sample(f"command_{command.name.lower()}", FrameType.COMMAND, tag, values, tail, inner))
    tail, inner = _inner("get_time_reply", {"hub_time_us": 4_295_000_000})
    values = {"tag": 9, "command": int(Command.GET_TIME), "status": 0}
    return [*samples, sample("reply_get_time", FrameType.REPLY, 77, values, tail, inner)]


def _zeros_of(frame: Sample) -> list[int]:
    body = whiten(bytes.fromhex(frame.vector["body"]))
    return [i for i, byte in enumerate(body) if byte == 0]


def _with_zeros_at(name: str, taxel_count: int, zeros: list[int]) -> Sample:
    """A taxel frame whose whitened body has zeros at exactly these places, and so a run of known length between two."""
    key = whiten(bytes(limits.BODY_MAX))
    sequence = sum((key[i] if i in zeros else 0x77) << (8 * (i - 1)) for i in (1, 2))
    start = limits.FRAME_HEADER_SIZE + frames.TaxelHeader.sizeof() + registers.SnapshotHeader.sizeof()
    data = [key[i] ^ (0 if i in zeros else 0x41) for i in range(start, start + 2 * taxel_count)]
    counts = [data[i] | data[i + 1] << 8 for i in range(0, len(data), 2)]
    for attempt in range(10_000):
        times = (0x51525354 + attempt, 0x61626364)
        frame = taxels(name, sequence, counts, 0x31, 0x4142, times, board_sequence=0x3132)
        if _zeros_of(frame) == zeros:
            return frame
    raise AssertionError(f"{name}: no such frame was found")


def stuffing_edges() -> list[Sample]:
    """Frames at the corners of byte stuffing, where a run without zeros is 253, 254, 255 or 508 bytes long."""
    key = whiten(bytes(limits.BODY_MAX))
    samples = [
        _with_zeros_at("run_253_then_zero", 120, [2, 256]),
        _with_zeros_at("run_254_then_zero", 120, [2, 257]),
        _with_zeros_at("run_255_then_zero", 120, [2, 258]),
        _with_zeros_at("run_254_from_start_then_zero", 120, [254]),
        _with_zeros_at("run_253_at_end", 114, [1]),
        _with_zeros_at("run_254_at_end", 115, [2]),
        _with_zeros_at("run_255_at_end", 115, [1]),
        _with_zeros_at("body_253_without_zero", 113, []),
        _with_zeros_at("body_255_without_zero", 114, []),
        _with_zeros_at("body_507_without_zero", 240, []),
        _with_zeros_at("two_runs_of_254_to_the_end", 240 - 16, [1 + i for i in (0, 1)]),
        _with_zeros_at("two_zeros_in_a_row", 20, [40, 41]),
    ]
    start = limits.FRAME_HEADER_SIZE + FRAMES[FrameType.REPLY].minimum
    values = {"tag": key[5], "command": key[6], "status": key[7]}
    samples.append(sample("payload_whitens_to_zeros", FrameType.REPLY, 3, values, key[start : start + 128]))
    last = b"the last byte whitens to zero"
    last += key[start + len(last) : start + len(last) + 1]
    samples.append(sample("payload_ends_in_zero", FrameType.REPLY, 4, values, last))
    for sequence in range(65_536):
        frame = sample("body_ends_in_zero", FrameType.COMMAND, sequence, {"tag": 1, "command": 1})
        if frame.wire[-2] == 1:
            return [*samples, frame]
    raise AssertionError("no sequence number gives a CRC that ends in zero")


def taxel_frames(rng: random.Random) -> list[Sample]:
    """Taxel frames from 1 to 240 taxels; 63 is the average board of the default hand."""
    arbitrary = [rng.getrandbits(16) for _ in range(limits.TAXELS_MAX)]
    last = {"address": limits.ADDRESS_MAX, "cycle": 0xFFFF, "times_us": (0xFFFFFFFF, 0xFFFFFFFF)}
    return [
        taxels("taxels_shortest", 0, [0], limits.ADDRESS_MIN),
        taxels("taxels_longest_zeros", 1, [0] * limits.TAXELS_MAX, limits.ADDRESS_MIN),
        taxels("taxels_longest_ones", 0xFFFF, [0xFFFF] * limits.TAXELS_MAX, board_sequence=0xFFFF, **last),  # type: ignore[arg-type]
        taxels("taxels_longest_arbitrary", 0x8000, arbitrary, 0x2A, 999, (123_456_789, 98_765_432), 4321),
        taxels("taxels_63", 258, arbitrary[:63], 0x30, 7, (1_000_000, 2_000_000), 55),
        taxels("taxels_idle_counts", 259, [4000 - i % 7 for i in range(63)], 0x21, 8, (1_052_632, 52_000), 56),
        taxels("taxels_bad_board_crc", 260, arbitrary[:5], 0x22, 8, (1_053_000, 52_000), 57, crc_error=1),
    ]


def all_frames() -> list[Sample]:
    """What frames.json holds."""
    rng = random.Random(SEED)
    return [*every_type(rng), *every_command(), *taxel_frames(rng), *stuffing_edges()]


def register_vector(name: str, struct: str, start: int, values: Mapping[str, Any]) -> dict[str, Any]:
    """A register block without a CRC over the address."""
    definition = REGISTERS[struct]
    data = definition.build(nest(definition, values))
    shown = plain(fields_of(definition), values)
    return {"name": name, "struct": struct, "register": start, "fields": shown, "bytes": data.hex()}


def _identity(name: str, values: dict[str, Any]) -> dict[str, Any]:
    without_crc = registers.Identity.build(nest(registers.Identity, values | {"crc32": 0}))[:-4]
    return register_vector(name, "identity", limits.REGISTER_IDENTITY, values | {"crc32": crc32(without_crc)})


def _settings(name: str, address: int, numbers: Sequence[int]) -> dict[str, Any]:
    fields = [field.name for field in fields_of(registers.SettingsRegister)][:-1]
    values = dict(zip(fields, numbers, strict=True))
    without_crc = registers.SettingsRegister.build(nest(registers.SettingsRegister, values | {"crc32": 0}))[:-4]
    values["crc32"] = board_crc(address, without_crc)
    vector = register_vector(name, "settings_register", limits.REGISTER_SETTINGS, values)
    return vector | {"address": address}


def _snapshot(name: str, address: int, header: tuple[int, int], counts: Sequence[int]) -> dict[str, Any]:
    flat: dict[str, Any] = {"header_sequence": header[0], "header_timestamp_us": header[1]}
    flat |= {"raw_counts": list(counts), "crc32": 0}
    definition = registers.snapshot(len(counts))
    flat["crc32"] = board_crc(address, definition.build(nest(definition, flat))[:-4])
    return {
        "name": name,
        "struct": "snapshot_header",
        "register": limits.REGISTER_SNAPSHOT,
        "address": address,
        "fields": {"sequence": header[0], "timestamp_us": header[1]},
        "counts": list(counts),
        "crc32": flat["crc32"],
        "bytes": definition.build(nest(definition, flat)).hex(),
    }


def all_registers() -> list[dict[str, Any]]:
    """What registers.json holds."""
    rng = random.Random(SEED)
    board: dict[str, Any] = {"map_version": 1, "firmware_major": 1, "firmware_minor": 2, "firmware_patch": 3}
    board |= {"kind": 2, "address": 0x20, "reserved": 0, "unique_id": rng.randbytes(8), "rows": 9, "columns": 7}
    board |= {"taxel_count": 63, "snapshot_size": 136, "crossing_map": b"\xff" * 7 + b"\x7f" + bytes(24)}
    status_fields = fields_of(registers.Status)
    vectors = [
        _identity("identity", board),
        _identity("identity_zeros", _filled(fields_of(registers.Identity), lambda field: 0, False)),
        register_vector("status_zeros", "status", 0x40, _filled(status_fields, lambda field: 0, False)),
        register_vector("status", "status", 0x40, _filled(status_fields, lambda f: rng.getrandbits(8 * f.size), False)),
        _settings("settings", 0x20, (100, 40, 1, 96, 240)),
        _settings("settings_of_another_board", 0x21, (100, 40, 1, 96, 240)),
        _settings("settings_largest", 0x77, (0xFFFF, 0xFFFF, 0xFF, 0xFF, 0xFFFF)),
    ]
    for command in BoardCommand:
        values = {"command": int(command), "complement": 0xFF ^ command}
        vectors.append(register_vector(f"command_{command.name.lower()}", "command_register", 0x70, values))
    counts = [rng.getrandbits(16) for _ in range(limits.TAXELS_MAX)]
    return [
        *vectors,
        _snapshot("snapshot_shortest", 0x08, (0, 0), [0]),
        _snapshot("snapshot", 0x20, (1234, 56_789_012), counts[:63]),
        _snapshot("snapshot_of_another_board", 0x21, (1234, 56_789_012), counts[:63]),
        _snapshot("snapshot_longest", 0x77, (0xFFFF, 0xFFFFFFFF), counts),
    ]


def raw_frame(frame_type: int, payload: bytes, length: int | None = None) -> bytes:
    """Wire bytes of a frame that need not be allowed, its CRC right; `length` is what its header claims."""
    body = bytes([frame_type, 1, 0]) + (len(payload) if length is None else length).to_bytes(2, "little") + payload
    return encode_body(body + crc32(body).to_bytes(4, "little"))


def _flip(data: bytes, position: int, mask: int = 0x01) -> bytes:
    return data[:position] + bytes([data[position] ^ mask]) + data[position + 1 :]


class Streams:
    """Collects damaged streams. A, B and C are three frames that most streams are made of."""

    def __init__(self, known: Mapping[str, Sample]) -> None:
        self.known = known
        self.rng = random.Random(SEED)
        self.vectors: list[dict[str, Any]] = []
        self.a, self.b, self.c = (known[name] for name in ("taxels_63", "time_sync_arbitrary", "hub_status_arbitrary"))

    def add(self, name: str, sent: list[Sample], stream: bytes, expected: list[int], directions: int = TO_HOST) -> None:
        """`expected` are indices into `sent`, in the order in which the frames must come out."""
        vector = {"name": name, "directions": directions, "sent": [frame.sent for frame in sent]}
        self.vectors.append(vector | {"stream": stream.hex(), "expected": expected})

    def garbage(self, size: int) -> bytes:
        """Bytes without a zero."""
        return bytes(self.rng.randrange(1, 256) for _ in range(size))

    def delimiters(self) -> None:
        """Delimiters lost, and bytes between frames."""
        a, b, c = self.a, self.b, self.c
        abc = [a, b, c]
        every = [0, 1, 2]
        self.add("intact", abc, a.wire + b.wire + c.wire, every)
        self.add("one_delimiter_between_frames", abc, a.wire[:-1] + b.wire[:-1] + c.wire, every)
        self.add("no_first_delimiter", abc, a.wire[1:] + b.wire + c.wire, every)
        self.add("no_last_delimiter", abc, a.wire + b.wire + c.wire[:-1], every)
        self.add("two_frames_glued", abc, a.wire[:-1] + b.stuffed + c.wire, every)
        self.add("three_frames_glued", abc, b"\0" + a.stuffed + b.stuffed + c.stuffed + b"\0", every)
        self.add("no_delimiter_at_all", abc, a.stuffed + b.stuffed + c.stuffed, every)
        self.add("many_delimiters", abc, bytes(9).join([a.wire, b.wire, c.wire]), every)
        self.add("garbage_before", abc, self.garbage(40) + a.wire + b.wire + c.wire, every)
        self.add("garbage_glued_before", abc, self.garbage(40) + a.stuffed + b.wire + c.wire, every)
        self.add("garbage_glued_between", abc, a.wire[:-1] + self.garbage(17) + b.stuffed + c.wire, every)
        self.add("garbage_with_zeros", abc, self.rng.randbytes(600) + a.wire + b.wire + self.rng.randbytes(99) + c.wire, every)
        self.add("long_garbage_glued_before", abc, self.garbage(5000) + a.stuffed + b.wire + c.wire, every)
        self.add("long_garbage_then_delimiter", abc, self.garbage(3000) + a.wire + b.wire + c.wire, every)
        for name in ("run_254_at_end", "run_253_at_end", "body_507_without_zero"):
            edge = self.known[name]
            self.add(f"{name}_glued", [edge, b, edge], edge.stuffed + b.stuffed + edge.stuffed, every)
        shortest = self.known["reply_zeros"]
        self.add("300_shortest_frames_glued", [shortest] * 300, shortest.stuffed * 300, list(range(300)))
        longest = self.known["taxels_longest_arbitrary"]
        self.add("8_longest_frames_glued", [longest] * 8, longest.stuffed * 8, list(range(8)))

    def damage(self) -> None:
        """Bytes of a frame changed, lost or added: its neighbours come out, it does not."""
        a, b, c = self.a, self.b, self.c
        abc = [a, b, c]
        middle = len(a.wire) // 2
        cases = {
            "bit_flipped": _flip(a.wire, middle),
            "first_code_byte_flipped": _flip(a.wire, 1),
            "crc_flipped": _flip(a.wire, len(a.wire) - 2),
            "type_flipped": _flip(a.wire, 2, 0x80),
            "byte_became_zero": a.wire[:middle] + b"\0" + a.wire[middle + 1 :],
            "byte_lost": a.wire[:middle] + a.wire[middle + 1 :],
            "byte_added": a.wire[:middle] + b"\x55" + a.wire[middle:],
            "zero_added": a.wire[:middle] + b"\0" + a.wire[middle:],
            "two_bytes_swapped": a.wire[:middle] + a.wire[middle + 1 : middle - 1 : -1] + a.wire[middle + 2 :],
            "truncated": a.wire[:middle],
            "head_lost": a.wire[middle:],
        }
        for name, damaged in cases.items():
            self.add(name, abc, c.wire + damaged + b.wire + c.wire, [2, 1, 2])
        self.add("truncated_and_glued", abc, a.wire[:middle] + b.stuffed + c.wire, [1, 2])
        self.add("last_byte_lost_and_glued", abc, a.wire[:-2] + b.stuffed + c.wire, [1, 2])
        self.add("first_byte_lost_and_glued", abc, a.wire[2:-1] + b.stuffed + c.wire, [1, 2])
        reaching = b"\0" + b"\xff" + a.stuffed[1:] + b.stuffed + c.stuffed + b"\0"
        self.add("code_byte_reaches_over_the_next_frame", abc, reaching, [1, 2])

    def quotations(self) -> None:
        """A frame quoted in another frame's payload is not a frame, not even when its host is damaged."""
        quoted = self.b
        for carrier, head in ((FrameType.LOG, "log"), (FrameType.REPLY, "reply")):
            values = self.known[f"{head}_arbitrary"].vector["fields"]
            for form, data in (("wire", quoted.wire), ("stuffed", quoted.stuffed), ("body", quoted.wire + quoted.wire)):
                if len(data) > FRAMES[carrier].maximum - FRAMES[carrier].minimum:
                    continue
                host = sample("", carrier, 9, values, data)
                start = host.wire.rindex(host.wire[-(len(data) + 5) :])
                name = f"{head}_quotes_{form if form != 'body' else 'two_frames'}"
                self.add(name, [host, quoted], host.wire + quoted.wire, [0, 1])
                self.add(f"{name}_crc_flipped", [host, quoted], _flip(host.wire, len(host.wire) - 2) + quoted.wire, [1])
                self.add(f"{name}_head_lost", [host, quoted], host.wire[start:] + quoted.wire, [1])
                self.add(f"{name}_code_flipped", [host, quoted], _flip(host.wire, 1) + quoted.wire, [1])

    def refusals(self) -> None:
        """Frames with a right CRC that this version does not allow."""
        b, c = self.b, self.c
        time_sync = bytes.fromhex(b.vector["payload"])
        small = bytes.fromhex(self.known["taxels_shortest"].vector["payload"])
        cases = {
            "type_0x00": raw_frame(0x00, time_sync),
            "type_0xFF": raw_frame(0xFF, time_sync),
            "type_unknown": raw_frame(0x0F, time_sync),
            "fixed_payload_too_long": raw_frame(FrameType.TIME_SYNC, time_sync + b"\1"),
            "fixed_payload_too_short": raw_frame(FrameType.TIME_SYNC, time_sync[:-1]),
            "length_claims_more": raw_frame(FrameType.LOG, bytes(20), 21),
            "length_claims_less": raw_frame(FrameType.LOG, bytes(20), 19),
            "log_too_long": raw_frame(FrameType.LOG, bytes(72)),
            "reply_too_short": raw_frame(FrameType.REPLY, b"\1\2"),
            "address_too_low": raw_frame(FrameType.TIME_SYNC, b"\x07" + time_sync[1:]),
            "address_too_high": raw_frame(FrameType.TAXELS, b"\x78" + small[1:]),
            "taxel_count_too_high": raw_frame(FrameType.TAXELS, small[:1] + b"\2" + small[2:]),
            "taxel_count_zero": raw_frame(FrameType.TAXELS, small[:1] + b"\0" + small[2:-2]),
        }
        for reserved in range(FrameType.COMPACT_FIRST, FrameType.COMPACT_LAST + 1):
            cases[f"reserved_type_0x{reserved:02X}"] = raw_frame(reserved, time_sync)
        for name, refused in cases.items():
            self.add(name, [b, c], b.wire + refused + c.wire, [0, 1], BOTH_WAYS)

    def ways(self) -> None:
        """A decoder believes only what travels its way."""
        b, hello = self.b, self.known["host_hello_arbitrary"]
        stream = b.wire + hello.wire + b.wire
        self.add("host_hears_itself", [b, hello], stream, [0, 0], TO_HOST)
        self.add("hub_hears_itself", [b, hello], stream, [1], TO_HUB)
        self.add("both_ways", [b, hello], stream, [0, 1, 0], BOTH_WAYS)


def all_streams() -> list[dict[str, Any]]:
    """What damaged.json holds."""
    streams = Streams({frame.vector["name"]: frame for frame in all_frames()})
    streams.delimiters()
    streams.damage()
    streams.quotations()
    streams.refusals()
    streams.ways()
    return streams.vectors


def json_text(key: str, about: str, vectors: Sequence[Mapping[str, Any]]) -> str:
    """One vector a line, so that a difference shows which one changed."""
    head = json.dumps({"about": about, "protocol_version": limits.PROTOCOL_VERSION, "made_by": "tools/codegen/vectors.py"})
    lines = ",\n".join(json.dumps(vector) for vector in vectors)
    return f'{head[:-1]}, "{key}": [\n{lines}\n]}}\n'


def _layout_lines(name: str, definition: Struct) -> list[str]:
    rows = []
    for field in fields_of(definition):
        rows.append(
            f'    {{"{field.name}", offsetof(struct taxel_{name}, {field.name}), {field.size}, {int(field.is_bytes)}}},'
        )
    return [
        f"static const struct field {name}_fields[] = {{",
        *rows,
        "};",
        f"static void {name}_pack(const void *value, uint8_t *bytes)",
        "{",
        f"    taxel_{name}_pack(value, bytes);",
        "}",
        f"static void {name}_unpack(void *value, const uint8_t *bytes)",
        "{",
        f"    taxel_{name}_unpack(value, bytes);",
        "}",
        "",
    ]


FIELDS_HEAD = """\
/* Generated from protocol/taxel_protocol by tools/codegen/vectors.py (make generate). Do not edit. */
#ifndef TAXEL_GENERATED_FIELDS_H
#define TAXEL_GENERATED_FIELDS_H

#include <stddef.h>
#include <stdint.h>

#include "generated/taxel_protocol.h"

/* Where a field that a vector names lies in its C struct. */
struct field {
    const char *name;
    size_t offset;
    size_t size;
    int is_bytes;
};

struct layout {
    const char *name;
    const struct field *fields;
    size_t field_count;
    size_t size; /* packed */
    void (*pack)(const void *value, uint8_t *bytes);
    void (*unpack)(void *value, const uint8_t *bytes);
};

/* The structs at the front of a frame type's payload, in order; `prefix` begins the names of their fields in a vector. */
struct payload_part {
    uint8_t type;
    const char *layout;
    const char *prefix;
};
"""


def fields_header() -> str:
    """The field tables for the C test."""
    definitions = {name: definition for parts in PAYLOAD_PARTS.values() for name, _, definition in parts}
    definitions |= INNER | REGISTERS
    lines = [FIELDS_HEAD]
    for name, definition in definitions.items():
        lines += _layout_lines(name, definition)
    lines.append("static const struct layout layouts[] = {")
    for name in definitions:
        count = f"sizeof {name}_fields / sizeof {name}_fields[0]"
        lines.append(f'    {{"{name}", {name}_fields, {count}, TAXEL_{name.upper()}_SIZE, {name}_pack, {name}_unpack}},')
    lines += ["};", "", "static const struct payload_part payload_parts[] = {"]
    for frame_type, parts in PAYLOAD_PARTS.items():
        lines += [f'    {{TAXEL_FRAME_TYPE_{frame_type.name}, "{name}", "{prefix}"}},' for name, prefix, _ in parts]
    return "\n".join([*lines, "};", "", "#endif", ""])


def all_files() -> dict[Path, str]:
    """Text of every generated file."""
    vectors = [frame.vector for frame in all_frames()]
    return {
        VECTORS / "frames.json": json_text("frames", "UART frames: fields and bytes", vectors),
        VECTORS / "registers.json": json_text("registers", "I2C registers: fields and bytes", all_registers()),
        VECTORS / "damaged.json": json_text("streams", "damaged streams and the frames that come out", all_streams()),
        FIELDS_HEADER: fields_header(),
    }


def main() -> int:
    """Write or check the files."""
    for path, text in all_files().items():
        if "--check" not in sys.argv[1:]:
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
        elif not path.exists() or path.read_text() != text:
            print(f"{path.name} is stale: run `make generate`", file=sys.stderr)
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
