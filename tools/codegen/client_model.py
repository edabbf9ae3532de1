"""Parts of the protocol that the generators of the clients in other languages share.

Everything is derived from the construct definitions, so that a change of a definition needs no change of a generator.
"""

from dataclasses import dataclass
from pathlib import Path

from c_header import ENUMS, STRUCTS
from construct import Struct
from field_tables import PAYLOAD_PARTS
from field_values import find_tail_name

from taxel_protocol import compact_tables, limits
from taxel_protocol.frames import FRAMES
from taxel_protocol.layout import Field, list_fields
from taxel_protocol.names import FrameType

CLIENTS = Path(__file__).resolve().parents[2] / "protocol" / "clients"
ORIGIN = "Generated from protocol/taxel_protocol by tools/codegen/clients.py (make generate). Do not edit."

TAXEL_FRAMES = (FrameType.TAXELS, FrameType.COMPACT_TAXELS)
"""Frame types whose counts a client decodes by hand-written code."""

FLAG_ENUMS = ("StartFlag", "BoardErrorFlag")
"""Enumerations whose members are bits that may be combined."""


@dataclass(frozen=True)
class Part:
    """A struct at the front of a payload. prefix: start of the flat names of its fields in the payload's definition."""

    struct: str
    prefix: str


@dataclass(frozen=True)
class Message:
    """A frame type: the structs at the front of its payload, and the name of the bytes that follow them, if any."""

    frame_type: FrameType
    parts: tuple[Part, ...]
    tail: str | None
    minimum: int
    maximum: int
    has_address: bool


def list_messages() -> list[Message]:
    """List every frame type of the protocol.

    Raises ValueError for a frame type whose structs are not listed in field_tables.PAYLOAD_PARTS.
    """
    messages = []
    for frame_type, spec in FRAMES.items():
        if frame_type not in PAYLOAD_PARTS:
            raise ValueError(f"{frame_type.name}: add its structs to PAYLOAD_PARTS of tools/codegen/field_tables.py")
        parts = tuple(Part(name, prefix) for name, prefix, _ in PAYLOAD_PARTS[frame_type])
        tail = find_tail_name(spec.payload)
        messages.append(Message(frame_type, parts, tail, spec.minimum, spec.maximum, spec.has_address))
    return messages


def list_structs() -> dict[str, Struct]:
    """Return every struct of the protocol by its name in snake case, as in the C header."""
    return dict(STRUCTS)


def list_struct_fields(name: str) -> tuple[Field, ...]:
    """List the fields of fixed size of a struct. name: in snake case."""
    return list_fields(STRUCTS[name])


def get_struct_size(name: str) -> int:
    """Return the number of bytes of a struct's fixed fields. name: in snake case."""
    return sum(field.size for field in list_struct_fields(name))


def list_constants() -> dict[str, int]:
    """Return the numbers of the protocol by name in upper case."""
    values = vars(limits) | vars(compact_tables)
    return {name: value for name, value in values.items() if name.isupper() and isinstance(value, int)}


def list_tables() -> dict[str, tuple[int, ...]]:
    """Return the tables of the compact coding by name in upper case."""
    return {name: value for name, value in vars(compact_tables).items() if name.isupper() and isinstance(value, tuple)}


def list_enumerations() -> dict[str, dict[str, int]]:
    """Return the codes of each enumeration, by names of enumeration and member."""
    return {enum.__name__: {member.name: int(member) for member in enum} for enum in ENUMS}


def to_camel_case(name: str) -> str:
    """Convert a name such as hub_status to HubStatus."""
    return "".join(part.capitalize() for part in name.split("_"))


def format_rows(values: tuple[int, ...], indent: str, per_row: int = 13) -> list[str]:
    """Format the numbers of a table as lines, each number followed by a comma."""
    return [indent + " ".join(f"{value}," for value in values[i : i + per_row]) for i in range(0, len(values), per_row)]


__all__ = [
    *("CLIENTS", "FLAG_ENUMS", "ORIGIN", "TAXEL_FRAMES", "Field", "Message", "Part"),
    *("format_rows", "get_struct_size", "list_constants", "list_enumerations", "list_messages", "list_struct_fields"),
    *("list_structs", "list_tables", "to_camel_case", "to_snake_case"),
]
