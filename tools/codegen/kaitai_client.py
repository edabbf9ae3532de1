"""The Kaitai Struct description of the stream, and the table of frame types for its deframing process."""

from pathlib import Path

from c_header import to_snake_case
from client_model import (
    CLIENTS,
    ORIGIN,
    Message,
    list_constants,
    list_enumerations,
    list_messages,
    list_struct_fields,
    list_structs,
)

from taxel_protocol.framing import whiten
from taxel_protocol.layout import Field
from taxel_protocol.limits import BODY_MAX, COMPACT_WIDTH_MASK
from taxel_protocol.names import FrameType

FOLDER = CLIENTS / "kaitai"
PERIOD = 256
"""Bytes after which the whitening sequence repeats."""

WIDTH_MAX = 16
TYPES = {1: "u1", 2: "u2", 4: "u4", 8: "u8"}
ENUMS_OF_FIELDS = {
    "reset_cause": "ResetCause", "last_fault": "BoardFault", "fault": "BoardFault", "command": "Command",
    "level": "LogLevel",
}  # fmt: skip
"""Enumeration of a field that contains a code, by the name of the field."""

HEAD = f"""\
# {ORIGIN}
meta:
  id: taxel_stream
  title: Stream of a taxel hub
  license: MIT
  endian: le
  bit-endian: le
doc: |
  Frames of a stream between hub and host. Input: the bytes of the stream, such as the bytes of all records of a
  capture file (taxel_capture.ksy) in their order. The process taxel_deframe finds the intact frames and removes the
  byte stuffing (taxel_deframe.py); whitening and all fields are described here. Counts of delta frames are coded
  against an earlier frame, which a description cannot express: they remain bytes (`coded`).
doc-ref: protocol/SPEC.md
seq:
  - id: frames
    size-eos: true
    process: taxel_deframe
    type: frame_list
types:
  frame_list:
    seq:
      - id: entries
        type: frame
        repeat: eos
  frame:
    seq:
      - id: is_known
        doc: 0 if this version does not define the type of the frame, or not with this payload
        type: u1
      - id: len_body
        type: u2
      - id: body
        size: len_body
        process: xor({{whitening}})
        type:
          switch-on: is_known
          cases:
            0: unknown_body
            1: body
  unknown_body:
    seq:
      - id: type
        type: u1
      - id: sequence
        type: u2
      - id: len_payload
        type: u2
      - id: payload
        size: len_payload
      - id: crc32
        type: u4
  body:
    seq:
      - id: type
        type: u1
        enum: frame_type
      - id: sequence
        type: u2
      - id: len_payload
        type: u2
      - id: payload
        size: len_payload
        type:
          switch-on: type
          cases:
{{cases}}
      - id: crc32
        type: u4
"""


def _format_field(field: Field) -> list[str]:
    """Format the lines of the description for one field of a struct."""
    lines = [f"      - id: {field.name}"]
    lines.append(f"        size: {field.size}" if field.is_bytes else f"        type: {TYPES[field.size]}")
    enum = ENUMS_OF_FIELDS.get(field.name)
    return [*lines, f"        enum: {to_snake_case(enum)}"] if enum and field.size == 1 else lines


def _format_struct(name: str) -> list[str]:
    """Format the lines of the description for the type of a struct."""
    return [f"  {name}:", "    seq:", *(line for field in list_struct_fields(name) for line in _format_field(field))]


def _format_payload(message: Message) -> list[str]:
    """Format the lines of the description for the payload of a frame type: its structs, and the bytes behind them."""
    lines = [f"  payload_{message.frame_type.name.lower()}:", "    seq:"]
    for part in message.parts:
        name = part.prefix.rstrip("_") or "fields"
        lines += [f"      - id: {name}", f"        type: {part.struct}"]
    # `pos: 8` skips the 8 bytes of the header of a taxel frame.
    tails = {
        FrameType.TAXELS: ["      - id: raw_counts", "        type: u2", "        repeat: expr",
                           "        repeat-expr: header.taxel_count", "      - id: crc32", "        type: u4"],
        FrameType.COMPACT_TAXELS: ["      - id: data", "        size-eos: true", "    instances:",
                                   "      compact:", "        doc: parsed on access",
                                   "        pos: 8", "        size-eos: true",
                                   "        type: compact_snapshot(header.taxel_count)"],
        FrameType.ACKNOWLEDGE: ["      - id: acknowledgements", "        type: acknowledgement", "        repeat: eos"],
    }  # fmt: skip
    if message.frame_type in tails:
        return lines + tails[message.frame_type]
    return [*lines, f"      - id: {message.tail}", "        size-eos: true"] if message.tail else lines


def _format_compact() -> list[str]:
    """Format the lines of the description for compact snapshots.

    The counts of each width, 1 to 16 bits, have a type of their own.
    """
    lines = ["  compact_snapshot:", "    params:", "      - id: taxel_count", "        type: u1", "    seq:"]
    lines += ["      - id: header", "        type: compact_header"]
    lines += ["      - id: timestamp_us", "        type: u4", "        if: width != 0"]
    lines += ["      - id: key_frame", "        type: u2", "        if: width == 0"]
    lines += ["      - id: timestamp_low", "        size: 3", "        if: width == 0"]
    lines += ["      - id: packed", "        if: width != 0", "        type:", "          switch-on: width"]
    lines += ["          cases:"]
    lines += [f"            {width}: packed_{width}(taxel_count)" for width in range(1, WIDTH_MAX + 1)]
    lines += ["      - id: coded", "        doc: coded counts of a delta frame, or zeros behind the packed counts"]
    # The last 4 bytes are the CRC.
    lines += ["        size: _io.size - _io.pos - 4", "      - id: crc32", "        type: u4", "    instances:"]
    lines += ["      width:", f"        value: header.format & {COMPACT_WIDTH_MASK}"]
    for width in range(1, WIDTH_MAX + 1):
        lines += [f"  packed_{width}:", "    params:", "      - id: taxel_count", "        type: u1", "    seq:"]
        lines += ["      - id: counts", f"        type: b{width}", "        repeat: expr"]
        lines += ["        repeat-expr: taxel_count"]
    return lines


def _format_enumerations() -> list[str]:
    """Format the lines of the description for all enumerations."""
    lines = ["enums:"]
    for name, members in list_enumerations().items():
        lines.append(f"  {to_snake_case(name)}:")
        lines += [f"    {code}: {member.lower()}" for member, code in members.items()]
    return lines


def format_description() -> str:
    """Format the text of taxel_stream.ksy."""
    key = ", ".join(str(byte) for byte in whiten(bytes(min(PERIOD, BODY_MAX))))
    messages = list_messages()
    names = [message.frame_type.name.lower() for message in messages]
    cases = "\n".join(f"            'frame_type::{name}': payload_{name}" for name in names)
    lines = [HEAD.format(whitening=f"[{key}]", cases=cases).rstrip("\n")]
    for message in messages:
        lines += _format_payload(message)
    for name in list_structs():
        lines += _format_struct(name)
    return "\n".join([*lines, *_format_compact(), *_format_enumerations(), ""])


def format_rules() -> str:
    """Format the text of taxel_rules.py: the numbers that the deframing process needs."""
    names = [
        *("ADDRESS_MIN", "ADDRESS_MAX", "BODY_MAX", "PAYLOAD_MAX", "FRAME_HEADER_SIZE", "FRAME_CRC_SIZE"),
        "SNAPSHOT_OVERHEAD",
        *("WHITENING_SEED", "WHITENING_FACTOR", "WHITENING_INCREMENT"),
    ]
    constants = list_constants()
    lines = [f'"""{ORIGIN}"""', "", *(f"{name} = {constants[name]}" for name in names)]
    lines += [f"TYPE_TAXELS = {int(FrameType.TAXELS)}", "", "FRAMES = {"]
    for m in list_messages():
        lines.append(f"    0x{m.frame_type:02X}: ({m.has_address}, {m.minimum}, {m.maximum}),  # {m.frame_type.name}")
    about = "Whether the payload begins with the address of a board, and its shortest and longest size, by frame type."
    return "\n".join([*lines, "}", f'"""{about}"""', ""])


def format_files() -> dict[Path, str]:
    """Return the text of each generated file of the Kaitai description, by path."""
    return {FOLDER / "taxel_stream.ksy": format_description(), FOLDER / "taxel_rules.py": format_rules()}
