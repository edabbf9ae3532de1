"""Fixed layouts derived from the construct definitions: for the C header and for fast packing in Python."""

import struct
from collections.abc import Generator, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

from construct import Bytes, Const, FormatField, Renamed, Struct

_FORMATS = {"<B": "B", "<H": "H", "<L": "I", "<Q": "Q"}


@dataclass(frozen=True)
class Field:
    """One field of a fixed layout: `code` is its `struct` code, `size` its length in bytes, `offset` its first byte."""

    name: str
    code: str
    offset: int
    size: int
    constant: int | None = None

    @property
    def is_bytes(self) -> bool:
        """Whether the field is a byte string rather than a number."""
        return self.code.endswith("s")


@cache
def list_fields(definition: Struct) -> tuple[Field, ...]:
    """List the fields of fixed size at the front of a struct definition, in order.

    Nested structs are flattened to names `outer_inner`. The list ends before the first part without a fixed size (a
    tail).
    """
    fields: list[Field] = []
    offset = 0
    for name, code, size, constant in _walk(definition, ""):
        fields.append(Field(name, code, offset, size, constant))
        offset += size
    return tuple(fields)


def _walk(definition: Struct, prefix: str) -> Generator[tuple[str, str, int, int | None], None, bool]:
    """Yield (flat name, struct code, size in bytes, constant) of the fields at the front of a struct definition.

    The fields of nested structs are included. The walk ends before the first field without a fixed size, such as a tail
    or an array: the offsets of later fields are unknown. Returns whether all fields have a fixed size. prefix: start of
    the flat names. constant: value of a field that always has the same value, else None.
    """
    for renamed in definition.subcons:
        assert isinstance(renamed, Renamed)
        inner: Any = renamed.subcon
        name = prefix + renamed.name
        constant = None
        if isinstance(inner, Const):
            constant = int(inner.value)
            inner = inner.subcon
        if isinstance(inner, Struct):
            if not (yield from _walk(inner, name + "_")):
                return False
        elif isinstance(inner, FormatField):
            yield name, _FORMATS[inner.fmtstr], inner.length, constant
        elif isinstance(inner, Bytes):
            yield name, f"{inner.length}s", int(inner.length), None
        else:
            return False
    return True


@cache
def get_packer(definition: Struct) -> struct.Struct:
    """Return the `struct.Struct` of the fields of `list_fields`."""
    return struct.Struct("<" + "".join(field.code for field in list_fields(definition)))


@cache
def _list_field_names(definition: Struct) -> tuple[str, ...]:
    """Return the flat names of the fields of `list_fields`."""
    return tuple(field.name for field in list_fields(definition))


def pack(definition: Struct, values: Mapping[str, Any], tail: bytes = b"") -> bytes:
    """Pack the values of the fields of `list_fields`, by flat name, to bytes and append `tail`.

    Raises struct.error for a value out of range.
    """
    fields = list_fields(definition)
    flat = [values[f.name] if f.constant is None else f.constant for f in fields]
    return get_packer(definition).pack(*flat) + tail


def unpack(definition: Struct, data: bytes) -> tuple[dict[str, Any], bytes]:
    """Unpack `data` to (values of the fields of `list_fields` by flat name, remaining bytes).

    Raises struct.error if `data` is shorter than these fields.
    """
    packer = get_packer(definition)
    return dict(zip(_list_field_names(definition), packer.unpack_from(data), strict=True)), data[packer.size :]


def flatten(values: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Flatten nested field values to flat names, such as `{"header": {"address": 1}}` to `{"header_address": 1}`."""
    flat: dict[str, Any] = {}
    for name, value in values.items():
        if isinstance(value, Mapping):
            flat |= flatten(value, f"{prefix}{name}_")
        else:
            flat[prefix + name] = value
    return flat
