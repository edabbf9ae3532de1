"""Write firmware/tests/generated_fields.h: the positions of a vector's fields in the C structs, for the C test.

python tools/codegen/field_tables.py            write it
python tools/codegen/field_tables.py --check    exit status 1 if the file on disk is stale
"""

import sys
from pathlib import Path

from construct import Struct

from taxel_protocol import frames, registers
from taxel_protocol.layout import list_fields
from taxel_protocol.names import FrameType

HEADER = Path(__file__).resolve().parents[2] / "firmware" / "tests" / "generated_fields.h"

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

REGISTERS: dict[str, Struct] = {
    "identity": registers.Identity,
    "status": registers.Status,
    "settings_register": registers.SettingsRegister,
    "command_register": registers.CommandRegister,
    "enter_bootloader_register": registers.EnterBootloaderRegister,
    "fault_register": registers.FaultRegister,
    "snapshot_header": registers.SnapshotHeader,
    "compact_packed": registers.CompactPacked,
    "compact_delta": registers.CompactDelta,
    "compact_acknowledge": registers.CompactAcknowledge,
}

PAYLOAD_PARTS: dict[FrameType, tuple[tuple[str, str, Struct], ...]] = {
    FrameType.HUB_HANDSHAKE: (("hub_handshake", "", frames.HubHandshake),),
    FrameType.TAXELS: (
        ("taxel_header", "header_", frames.TaxelHeader),
        ("snapshot_header", "snapshot_header_", registers.SnapshotHeader),
    ),
    FrameType.COMPACT_TAXELS: (
        ("taxel_header", "header_", frames.TaxelHeader),
        ("compact_header", "snapshot_", registers.CompactHeader),
    ),
    FrameType.HUB_STATUS: (("hub_status", "", frames.HubStatus),),
    FrameType.BOARD_STATUS: (("board_status", "", frames.BoardStatus),),
    FrameType.BOARD_INFO: (("board_info", "", frames.BoardInfo),),
    FrameType.BOARD_FAULT: (("board_fault_report", "", frames.BoardFaultReport),),
    FrameType.TIME_SYNC: (("time_sync", "", frames.TimeSync),),
    FrameType.LOG: (("log_header", "", frames.Log),),
    FrameType.REPLY: (("reply_header", "", frames.Reply),),
    FrameType.HOST_HANDSHAKE: (("host_handshake", "", frames.HostHandshake),),
    FrameType.COMMAND: (("command_header", "", frames.CommandPayload),),
    FrameType.ACKNOWLEDGE: (),
}
"""Structs at the front of each payload: C name, prefix of their fields' flat names, definition."""


def _format_layout(name: str, definition: Struct) -> list[str]:
    """Format the C lines of a struct's field table, and of its pack and unpack functions with generic types."""
    rows = []
    for field in list_fields(definition):
        member = f"offsetof(struct taxel_{name}, {field.name})"
        rows.append(f'    {{"{field.name}", {member}, {field.size}, {int(field.is_bytes)}}},')
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
/* Generated from protocol/taxel_protocol by tools/codegen/field_tables.py (make generate). Do not edit. */
#ifndef TAXEL_GENERATED_FIELDS_H
#define TAXEL_GENERATED_FIELDS_H

#include <stddef.h>
#include <stdint.h>

#include "generated/taxel_protocol.h"

/* Position of a vector's field in its C struct. */
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

/* The structs at the front of a type's payload, in order; `prefix`: prefix of their fields' names in a vector. */
struct payload_part {
    uint8_t type;
    const char *layout;
    const char *prefix;
};
"""


def format_fields_header() -> str:
    """Format the C header with the field tables of all messages, for the C test."""
    definitions = {name: definition for parts in PAYLOAD_PARTS.values() for name, _, definition in parts}
    definitions |= INNER | REGISTERS
    lines = [FIELDS_HEAD]
    for name, definition in definitions.items():
        lines += _format_layout(name, definition)
    lines.append("static const struct layout layouts[] = {")
    for name in definitions:
        count = f"sizeof {name}_fields / sizeof {name}_fields[0]"
        size = f"TAXEL_{name.upper()}_SIZE"
        lines.append(f'    {{"{name}", {name}_fields, {count}, {size}, {name}_pack, {name}_unpack}},')
    lines += ["};", "", "static const struct payload_part payload_parts[] = {"]
    for frame_type, parts in PAYLOAD_PARTS.items():
        lines += [f'    {{TAXEL_FRAME_TYPE_{frame_type.name}, "{name}", "{prefix}"}},' for name, prefix, _ in parts]
    return "\n".join([*lines, "};", "", "#endif", ""])


def main() -> int:
    """Write the C header with the field tables of all messages, or check that it is up to date (`--check`).

    Returns the exit status: 1 if the checked file is missing or stale.
    """
    text = format_fields_header()
    if "--check" in sys.argv[1:]:
        if not HEADER.exists() or HEADER.read_text() != text:
            print(f"{HEADER.name} is stale: run `make generate`", file=sys.stderr)
            return 1
        return 0
    HEADER.parent.mkdir(parents=True, exist_ok=True)
    HEADER.write_text(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
