"""Conversions of field values between flat names, construct's nested values and JSON."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from construct import Const, GreedyBytes, Struct

from taxel_protocol.framing import crc32
from taxel_protocol.layout import Field
from taxel_protocol.limits import ADDRESS_MAX, ADDRESS_MIN

SEED = 20


def nest_values(definition: Struct, flat: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Convert values by flat field name to the nested values from which construct builds a message.

    prefix: start of the flat names of this part of the message.
    """
    nested: dict[str, Any] = {}
    for renamed in definition.subcons:
        name = prefix + renamed.name
        if isinstance(renamed.subcon, Struct):
            nested[renamed.name] = nest_values(renamed.subcon, flat, name + "_")
        elif not isinstance(renamed.subcon, Const):
            nested[renamed.name] = flat[name]
    return nested


def find_tail_name(definition: Struct) -> str | None:
    """Return the name of the part without a fixed length at the end of `definition`; None if there is none."""
    last = definition.subcons[-1]
    return str(last.name) if last.subcon is GreedyBytes else None


def to_json_values(fields: Sequence[Field], values: Mapping[str, Any]) -> dict[str, Any]:
    """Convert field values for a JSON file: numbers stay, byte strings become hexadecimal digits.

    A constant field has its constant value.
    """
    converted: dict[str, Any] = {}
    for field in fields:
        value: Any = field.constant if field.constant is not None else values[field.name]
        converted[field.name] = value.hex() if field.is_bytes else value
    return converted


def compute_board_crc(address: int, data: bytes) -> int:
    """Compute the CRC-32 over the board's address and the data, as boards compute it."""
    return crc32(data, crc32(bytes([address])))


def fill_fields(fields: Sequence[Field], value: Callable[[Field], int], has_address: bool) -> dict[str, Any]:
    """Fill all fields of a message. Returns the values by field name.

    value: returns the number for a field. has_address: whether the first field is an I2C address, which is clipped to
    the valid range.
    """
    values: dict[str, Any] = {}
    for field in fields:
        number = value(field)
        values[field.name] = number.to_bytes(field.size, "little") if field.is_bytes else number
    if has_address:
        first = fields[0].name
        values[first] = min(max(values[first], ADDRESS_MIN), ADDRESS_MAX)
    return values
