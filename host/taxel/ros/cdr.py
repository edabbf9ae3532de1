"""Messages as CDR, the bytes of ROS 2: little-endian, XCDR version 1 (OMG DDSI-RTPS 2.x, chapter 10).

A message is a dict by field name; arrays of numbers are NumPy arrays or sequences. Each number lies at a multiple of
its size, counted from after the 4-byte header.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

import numpy as np

from taxel.ros.definitions import PRIMITIVES, MessageField, fields

HEADER = b"\x00\x01\x00\x00"
_LENGTH = struct.Struct("<I")

_Write = Callable[[bytearray, Any], None]


class CdrError(ValueError):
    """Bytes that are not the message they should be."""


def encode(name: str, message: Mapping[str, Any]) -> bytes:
    """A message of type `name` ("package/Name") as bytes. Raises KeyError for a field that is missing."""
    out = bytearray(HEADER)
    _message_writer(name)(out, message)
    return bytes(out)


def _align(out: bytearray, size: int) -> None:
    out.extend(bytes(-(len(out) - len(HEADER)) % size))


@cache
def _message_writer(name: str) -> _Write:
    writers = [(field.name, _field_writer(field)) for field in fields(name)]

    def write(out: bytearray, message: Mapping[str, Any]) -> None:
        for key, writer in writers:
            writer(out, message[key])

    return write


def _field_writer(field: MessageField) -> _Write:
    if field.is_array and field.type in PRIMITIVES:
        return _array_writer(field)
    one = _one_writer(field.type)
    return _sequence_writer(one, field.length) if field.is_array else one


def _one_writer(type_name: str) -> _Write:
    if type_name == "string":
        return _write_string
    if type_name not in PRIMITIVES:
        return _message_writer(type_name)
    packer = struct.Struct("<" + PRIMITIVES[type_name])

    def write(out: bytearray, value: Any) -> None:
        _align(out, packer.size)
        out.extend(packer.pack(value))

    return write


def _write_string(out: bytearray, value: str) -> None:
    data = value.encode() + b"\0"
    _align(out, 4)
    out.extend(_LENGTH.pack(len(data)))
    out.extend(data)


def _write_length(out: bytearray, count: int, fixed: int | None) -> None:
    if fixed is not None:
        if count != fixed:
            raise ValueError(f"expected {fixed} elements, found {count}")
        return
    _align(out, 4)
    out.extend(_LENGTH.pack(count))


def _array_writer(field: MessageField) -> _Write:
    dtype = np.dtype("<" + PRIMITIVES[field.type])

    def write(out: bytearray, values: Any) -> None:
        is_bytes = isinstance(values, bytes | bytearray | memoryview)
        data = bytes(values) if is_bytes else np.asarray(values, dtype).tobytes()
        _write_length(out, len(data) // dtype.itemsize, field.length)
        if data:
            _align(out, dtype.itemsize)
            out.extend(data)

    return write


def _sequence_writer(one: _Write, length: int | None) -> _Write:
    def write(out: bytearray, values: Any) -> None:
        _write_length(out, len(values), length)
        for value in values:
            one(out, value)

    return write


def decode(name: str, data: bytes) -> dict[str, Any]:
    """The message of type `name` in `data`; arrays of numbers are NumPy arrays. Raises CdrError."""
    if data[:2] != HEADER[:2]:
        raise CdrError(f"{name}: expected little-endian CDR, found header {data[:4].hex()}")
    reader = _Reader(data)
    try:
        return reader.message(name)
    except (struct.error, UnicodeDecodeError, ValueError) as error:
        raise CdrError(f"{name}: {error}") from None


class _Reader:
    def __init__(self, data: bytes) -> None:
        self._data = data
        self._at = len(HEADER)

    def message(self, name: str) -> dict[str, Any]:
        return {field.name: self._field(field) for field in fields(name)}

    def _field(self, field: MessageField) -> Any:
        if not field.is_array:
            return self._one(field.type)
        count = self._number("I") if field.length is None else field.length
        if count > len(self._data):
            raise CdrError(f"{field.name}: {count} elements in {len(self._data)} bytes")
        if field.type not in PRIMITIVES:
            return [self._one(field.type) for _ in range(count)]
        dtype = np.dtype("<" + PRIMITIVES[field.type])
        if not count:
            return np.zeros(0, dtype)
        self._skip_to(dtype.itemsize)
        values = np.frombuffer(self._data, dtype, count, self._at)
        self._at += values.nbytes
        return values

    def _one(self, type_name: str) -> Any:
        if type_name == "string":
            size = self._number("I")
            text = self._data[self._at : self._at + size]
            if len(text) != size:
                raise CdrError(f"a text of {size} bytes is cut short")
            self._at += size
            return text.rstrip(b"\0").decode()
        return self._number(PRIMITIVES[type_name]) if type_name in PRIMITIVES else self.message(type_name)

    def _number(self, code: str) -> Any:
        packer = struct.Struct("<" + code)
        self._skip_to(packer.size)
        (value,) = packer.unpack_from(self._data, self._at)
        self._at += packer.size
        return value

    def _skip_to(self, size: int) -> None:
        self._at += -(self._at - len(HEADER)) % size
