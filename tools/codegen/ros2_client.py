"""ROS 2 message definitions of the hub's frames, one per frame type, with the meanings of SPEC.md as comments."""

import re
from pathlib import Path

from client_model import (
    CLIENTS,
    ORIGIN,
    TAXEL_FRAMES,
    Message,
    Part,
    list_enumerations,
    list_messages,
    list_struct_fields,
    list_structs,
    to_camel_case,
)

from taxel_protocol import frames, registers
from taxel_protocol.layout import Field
from taxel_protocol.names import FrameType

PACKAGE = "taxel_hub_msgs"
FOLDER = CLIENTS / "ros2" / PACKAGE
SPEC = CLIENTS.parent / "SPEC.md"
TYPES = {1: "uint8", 2: "uint16", 4: "uint32", 8: "uint64"}
ENUMS_OF_FIELDS = {
    ("hub_handshake", "reset_cause"): "ResetCause",
    ("board_status", "state"): "BoardState",
    ("board_status", "last_fault"): "BoardFault",
    ("board_fault_report", "fault"): "BoardFault",
    ("log_header", "level"): "LogLevel",
    ("log_header", "code"): "LogCode",
    ("reply_header", "command"): "Command",
    ("reply_header", "status"): "ReplyStatus",
    ("command_header", "command"): "Command",
}
"""Enumeration whose codes a field contains; its members become constants of the message."""

COMMON = (
    ("std_msgs/Header header", "stamp: time at which the host received the frame; frame_id: name of the hub or board"),
    ("uint16 sequence", "frames that the sender transmitted before this frame, modulo 65536"),
    ("uint16 lost_before", "frames that were lost between the previously received frame and this frame"),
)
"""Fields at the front of every message."""

TAXEL_FRAME = (
    ("uint8 address", "address of the board"),
    ("uint16 cycle", "the hub's poll cycle, modulo 65536; frames of one cycle show the skin at one time"),
    ("uint32 hub_time_us", "clock of the hub when the read of the board began, microseconds modulo 2^32"),
    ("uint16 board_sequence", "scans of the board before this scan, modulo 65536"),
    ("uint32 board_time_us", "clock of the board when the scan began, microseconds modulo 2^32"),
    ("uint16 missing_before", "frames of this board that are missing since its previous frame"),
    ("bool board_crc_ok", "false: the CRC of the board is wrong; the counts of a compact frame are then not available"),
    ("bool key_frame_missing", "true: the key frame of a delta frame is missing, and the counts are not available"),
    ("uint16[] raw_counts", "in the board's taxel order (TX by TX, RX by RX); contact lowers a count"),
)
"""Fields of a TAXELS or a decoded COMPACT_TAXELS frame."""

BOARD_LOSSES = (
    ("uint8 address", "address of the board"),
    ("uint64 received", "complete frames"),
    ("uint64 missing", "frames that are missing between two received frames, by the poll cycle"),
    ("uint64 damaged", "frames whose board CRC was wrong"),
    ("uint64 undecoded", "delta frames without their key frame"),
)

LOSSES = (
    COMMON[0],
    ("uint64 frames", "complete frames of any type"),
    ("uint64 lost", "frames lost on the wire: gaps of the frames' sequence"),
    ("uint64 restarts", "restarts of the hub"),
    ("uint64 unknown", "whole frames that this version does not define"),
    ("uint64 discarded_bytes", "bytes that were part of no frame"),
    (f"{PACKAGE}/BoardLosses[] boards", "counters of each board"),
)


def read_meanings() -> dict[tuple[str, str], str]:
    """Read the description of each field from the layout tables of SPEC.md, without links and code marks.

    Returns the descriptions by (struct in snake case, field). Tables of structs that the clients do not use are
    skipped.
    """
    names = {id(definition): name for name, definition in list_structs().items()}
    meanings: dict[tuple[str, str], str] = {}
    for match in re.finditer(r"<!-- layout: (\w+)\.(\w+) -->\n\n((?:\|.*\n)+)", SPEC.read_text()):
        module = {"frames": frames, "registers": registers}.get(match[1])
        struct = names.get(id(getattr(module, match[2], None)))
        if struct is None:
            continue
        for row in match[3].splitlines()[2:]:
            parts = [part.strip() for part in row.strip("|").split("|")]
            meaning = re.sub(r"\[([^]]*)\]\([^)]*\)|`", r"\1", parts[3])
            meanings[struct, parts[2].strip("`")] = re.sub(r", see the [^;]*", "", meaning)
    return meanings


def _format_line(declaration: str, meaning: str) -> str:
    """Return the line of a message definition that declares a field, with the field's meaning as a comment."""
    return f"{declaration:<32} # {meaning}" if meaning else declaration


def _format_constants(part: Part, field: Field) -> list[str]:
    """Return the lines that declare the codes of a field as constants; [] for a field without an enumeration."""
    enum = ENUMS_OF_FIELDS.get((part.struct, field.name))
    members = list_enumerations()[enum] if enum else {}
    prefix = field.name.removeprefix("last_").upper()
    return [f"{TYPES[field.size]} {prefix}_{member}={code}" for member, code in members.items()]


def _format_part(part: Part, meanings: dict[tuple[str, str], str]) -> list[str]:
    """Return the lines that declare the fields of one struct of a payload, with their meanings as comments.

    meanings: result of `read_meanings`. A field of a nested struct, such as `settings_...`, has the meaning of the
    field in the nested struct.
    """
    lines = []
    for field in list_struct_fields(part.struct):
        kind = f"uint8[{field.size}]" if field.is_bytes else TYPES[field.size]
        outer, _, inner = field.name.partition("_")
        meaning = meanings.get((part.struct, field.name)) or meanings.get((outer, inner))
        if meaning is None and outer == "settings":
            meaning = meanings.get(("scan_settings", inner))
        lines.append(_format_line(f"{kind} {field.name}", meaning or ""))
    return lines


def _format_message(message: Message, meanings: dict[tuple[str, str], str]) -> str:
    """Return the ROS 2 message definition (.msg file) of a frame type."""
    lines = [f"# Frame {message.frame_type.name} (protocol/SPEC.md).", f"# {ORIGIN}", ""]
    constants = [
        line
        for part in message.parts
        for field in list_struct_fields(part.struct)
        for line in _format_constants(part, field)
    ]
    lines += [*constants, ""] if constants else []
    lines += [_format_line(*field) for field in COMMON]
    for part in message.parts:
        lines += _format_part(part, meanings)
    if message.frame_type == FrameType.ACKNOWLEDGE:
        lines.append(f"{PACKAGE}/Acknowledgement[] acknowledgements")
    elif message.tail:
        kind = "string" if message.tail == "text" else "uint8[]"
        lines.append(_format_line(f"{kind} {message.tail}", "the bytes behind the fields"))
    return "\n".join([*lines, ""])


def _format_plain(title: str, fields: tuple[tuple[str, str], ...]) -> str:
    """Return a ROS 2 message definition with the given (declaration, meaning) fields.

    For messages that are not the direct copy of a frame: decoded taxel frames and loss counters.
    """
    return "\n".join([f"# {title}", f"# {ORIGIN}", "", *(_format_line(*field) for field in fields), ""])


def format_messages() -> dict[str, str]:
    """Return all ROS 2 message definitions (.msg files) by message name."""
    meanings = read_meanings()
    texts = {
        to_camel_case(m.frame_type.name.lower()): _format_message(m, meanings)
        for m in list_messages()
        if m.frame_type not in TAXEL_FRAMES
    }
    texts["TaxelFrame"] = _format_plain("Frame TAXELS or COMPACT_TAXELS with its decoded counts.", COMMON + TAXEL_FRAME)
    texts["BoardLosses"] = _format_plain("Loss counters of one board.", BOARD_LOSSES)
    texts["StreamLosses"] = _format_plain("Loss counters of a stream.", LOSSES)
    acknowledgement = _format_part(Part("acknowledgement", ""), meanings)
    texts["Acknowledgement"] = "\n".join(["# Acknowledgement for one board.", f"# {ORIGIN}", "", *acknowledgement, ""])
    return texts


def _format_cmake(names: list[str]) -> str:
    """Return the text of CMakeLists.txt for the messages with these names."""
    listed = "\n".join(f'  "msg/{name}.msg"' for name in names)
    return f"""\
# {ORIGIN}
cmake_minimum_required(VERSION 3.8)
project({PACKAGE})
find_package(ament_cmake REQUIRED)
find_package(rosidl_default_generators REQUIRED)
find_package(std_msgs REQUIRED)
rosidl_generate_interfaces(${{PROJECT_NAME}}
{listed}
  DEPENDENCIES std_msgs
)
ament_export_dependencies(rosidl_default_runtime)
ament_package()
"""


def format_files() -> dict[Path, str]:
    """Return the text of each generated file of the ROS 2 package, by path."""
    texts = format_messages()
    files = {FOLDER / "msg" / f"{name}.msg": text for name, text in texts.items()}
    return files | {FOLDER / "CMakeLists.txt": _format_cmake(sorted(texts))}
