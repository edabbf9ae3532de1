"""Write firmware/generated/taxel_protocol.h from the construct definitions.

python tools/codegen/c_header.py            write it
python tools/codegen/c_header.py --check    exit status 1 if the file on disk is stale
"""

import sys
from enum import IntEnum
from pathlib import Path

from construct import Struct
from generated_files import write_or_check

from taxel_protocol import compact_tables, frames, limits, names, registers
from taxel_protocol.layout import Field, list_fields

HEADER = Path(__file__).resolve().parents[2] / "firmware" / "generated" / "taxel_protocol.h"

STRUCTS: dict[str, Struct] = {
    "identity": registers.Identity,
    "status": registers.Status,
    "scan_settings": registers.ScanSettings,
    "settings_register": registers.SettingsRegister,
    "command_register": registers.CommandRegister,
    "enter_bootloader_register": registers.EnterBootloaderRegister,
    "fault_record": registers.FaultRecord,
    "fault_register": registers.FaultRegister,
    "snapshot_header": registers.SnapshotHeader,
    "compact_header": registers.CompactHeader,
    "compact_packed": registers.CompactPacked,
    "compact_delta": registers.CompactDelta,
    "compact_acknowledge": registers.CompactAcknowledge,
    "host_handshake": frames.HostHandshake,
    "hub_handshake": frames.HubHandshake,
    "taxel_header": frames.TaxelHeader,
    "hub_status": frames.HubStatus,
    "board_status": frames.BoardStatus,
    "board_info": frames.BoardInfo,
    "board_fault_report": frames.BoardFaultReport,
    "time_sync": frames.TimeSync,
    "log_header": frames.Log,
    "reply_header": frames.Reply,
    "command_header": frames.CommandPayload,
    "acknowledgement": frames.Acknowledgement,
    "start_arguments": frames.StartArguments,
    "set_rate_arguments": frames.SetRateArguments,
    "enter_bootloader_arguments": frames.EnterBootloaderArguments,
    "transfer_arguments": frames.TransferArguments,
    "set_scan_settings_arguments": frames.SetScanSettingsArguments,
    "get_board_info_arguments": frames.GetBoardInfoArguments,
    "get_time_reply": frames.GetTimeReply,
}
ENUMS: tuple[type[IntEnum], ...] = (
    names.FrameType,
    names.Command,
    names.StartFlag,
    names.ReplyStatus,
    names.BoardState,
    names.BoardFault,
    names.ResetCause,
    names.LogLevel,
    names.LogCode,
    names.BoardCommand,
    names.BoardErrorFlag,
    names.FrontEnd,
    names.FaultCode,
)
C_TYPES = {"B": "uint8_t", "H": "uint16_t", "I": "uint32_t", "Q": "uint64_t"}


def to_snake_case(name: str) -> str:
    """Convert a name such as FrameType to frame_type."""
    return "".join(("_" + c.lower()) if c.isupper() and i else c.lower() for i, c in enumerate(name))


def format_constants() -> list[str]:
    """Format the C lines that define the limits of the protocol and the tables of the compact coding."""
    lines = []
    for name, value in (vars(limits) | vars(compact_tables)).items():
        if name.isupper() and isinstance(value, tuple):
            lines += [f"#define TAXEL_{name} \\", *_format_table(value)]
        elif name.isupper():
            lines.append(f"#define TAXEL_{name} {value}u")
    return lines


def _format_table(values: tuple[int, ...]) -> list[str]:
    """Format the C lines of an initializer for an array of numbers, 16 numbers per line, inside a macro."""
    rows = [", ".join(str(value) for value in values[i : i + 16]) for i in range(0, len(values), 16)]
    return ["    {" + ", \\\n     ".join(rows) + "}"]


def format_enumeration(enum: type[IntEnum]) -> list[str]:
    """Format the C lines that define an enumeration of the protocol."""
    prefix = f"TAXEL_{to_snake_case(enum.__name__).upper()}"
    body = [f"    {prefix}_{member.name} = 0x{member.value:02X}," for member in enum]
    return [f"enum taxel_{to_snake_case(enum.__name__)} {{", *body, "};", ""]


def _format_member(field: Field) -> str:
    """Format the C declaration of a message field as a struct member: an integer or an array of bytes."""
    if field.is_bytes:
        return f"    uint8_t {field.name}[{field.size}];"
    return f"    {C_TYPES[field.code]} {field.name};"


def _format_pack_line(field: Field) -> str:
    """Format the C line that copies a field from the struct `value` to its offset in the message bytes."""
    if field.is_bytes:
        return f"    memcpy(bytes + {field.offset}, value->{field.name}, {field.size});"
    return f"    taxel_put_u{8 * field.size}(bytes + {field.offset}, value->{field.name});"


def _format_unpack_line(field: Field) -> str:
    """Format the C line that copies a field from its offset in the message bytes to the struct `value`."""
    if field.is_bytes:
        return f"    memcpy(value->{field.name}, bytes + {field.offset}, {field.size});"
    return f"    value->{field.name} = taxel_get_u{8 * field.size}(bytes + {field.offset});"


def format_structure(name: str, definition: Struct) -> list[str]:
    """Format the C lines of a message: struct, size, offsets, and functions that pack and unpack the bytes."""
    fields = list_fields(definition)
    size = sum(field.size for field in fields)
    upper = name.upper()
    offsets = [f"#define TAXEL_{upper}_OFFSET_{field.name.upper()} {field.offset}u" for field in fields]
    return [
        f"#define TAXEL_{upper}_SIZE {size}u",
        *offsets,
        f"struct taxel_{name} {{",
        *[_format_member(field) for field in fields],
        "};",
        f"static inline void taxel_{name}_pack(const struct taxel_{name} *value, uint8_t *bytes)",
        "{",
        *[_format_pack_line(field) for field in fields],
        "}",
        f"static inline void taxel_{name}_unpack(struct taxel_{name} *value, const uint8_t *bytes)",
        "{",
        *[_format_unpack_line(field) for field in fields],
        "}",
        "",
    ]


def format_frame_rules() -> list[str]:
    """Format the C lines with the rules that a decoder checks before the CRC of a frame.

    For each frame type: whether it has a board address, and its shortest and longest payload.
    """
    rows = []
    for frame_type, spec in frames.FRAMES.items():
        rows.append(
            f"    X(TAXEL_FRAME_TYPE_{frame_type.name}, {int(spec.has_address)}, {spec.minimum}u, {spec.maximum}u)"
        )
    return [
        "/* X(type, payload begins with an address, shortest payload, longest payload) */",
        "#define TAXEL_FRAME_RULES(X) \\",
        " \\\n".join(rows),
        "",
    ]


ACCESSORS = """\
static inline void taxel_put_u8(uint8_t *bytes, uint8_t value)
{
    bytes[0] = value;
}
static inline void taxel_put_u16(uint8_t *bytes, uint16_t value)
{
    bytes[0] = (uint8_t)(value & 0xFFu);
    bytes[1] = (uint8_t)(value >> 8);
}
static inline void taxel_put_u32(uint8_t *bytes, uint32_t value)
{
    taxel_put_u16(bytes, (uint16_t)(value & 0xFFFFu));
    taxel_put_u16(bytes + 2, (uint16_t)(value >> 16));
}
static inline void taxel_put_u64(uint8_t *bytes, uint64_t value)
{
    taxel_put_u32(bytes, (uint32_t)(value & 0xFFFFFFFFu));
    taxel_put_u32(bytes + 4, (uint32_t)(value >> 32));
}
static inline uint8_t taxel_get_u8(const uint8_t *bytes)
{
    return bytes[0];
}
static inline uint16_t taxel_get_u16(const uint8_t *bytes)
{
    return (uint16_t)(bytes[0] | (uint16_t)(bytes[1] << 8));
}
static inline uint32_t taxel_get_u32(const uint8_t *bytes)
{
    return (uint32_t)taxel_get_u16(bytes) | ((uint32_t)taxel_get_u16(bytes + 2) << 16);
}
static inline uint64_t taxel_get_u64(const uint8_t *bytes)
{
    return (uint64_t)taxel_get_u32(bytes) | ((uint64_t)taxel_get_u32(bytes + 4) << 32);
}

/* Bytes of the compact snapshot whose first byte on the bus is `length`. */
static inline uint16_t taxel_compact_size(uint8_t length)
{
    const unsigned steps = length - TAXEL_COMPACT_LENGTH_FINE;
    return (uint16_t)(length < TAXEL_COMPACT_LENGTH_FINE ? length : steps * TAXEL_COMPACT_LENGTH_STEP);
}
"""


def format_text() -> str:
    """Format the text of the C header of the protocol."""
    lines = [
        "/* Generated from protocol/taxel_protocol by tools/codegen/c_header.py (make generate). Do not edit. */",
        "#ifndef TAXEL_PROTOCOL_H",
        "#define TAXEL_PROTOCOL_H",
        "",
        "#include <stdint.h>",
        "#include <string.h>",
        "",
        *format_constants(),
        "",
    ]
    for enum in ENUMS:
        lines += format_enumeration(enum)
    lines.append(ACCESSORS)
    for name, definition in STRUCTS.items():
        lines += format_structure(name, definition)
    lines += format_frame_rules()
    lines += ["#endif", ""]
    return "\n".join(lines)


def main() -> int:
    """Write the C header of the protocol, or check that it is up to date."""
    return write_or_check({HEADER: format_text()})


if __name__ == "__main__":
    sys.exit(main())
