"""CDR encoding of ROS 2 messages by the library rosbags: little-endian, XCDR version 1 (OMG DDSI-RTPS 2.x, chapter 10).

A message to encode is a dict of values by field name. A decoded message is an object with one attribute for each field;
its arrays of numbers are NumPy arrays.
"""

import struct
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

import numpy as np

from taxel.optional import optional_import
from taxel.ros.definitions import PRIMITIVES, MessageField, fields, get_definition, list_message_types

with optional_import("rosbags", "an MCAP file (.mcap)"):
    from rosbags.serde import SerdeError
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

_STORE = get_typestore(Stores.EMPTY)
_MALFORMED = (SerdeError, ValueError, IndexError, struct.error)
"""Errors of the library rosbags for malformed data."""


class CdrError(ValueError):
    """Error: bytes do not contain a ROS message of the expected type in CDR encoding."""


def encode(name: str, message: Mapping[str, Any]) -> bytes:
    """Encode a message of type `name` ("package/Name"). Raises KeyError for a missing field."""
    return bytes(_STORE.serialize_cdr(_make_message_builder(name)(message), _make_ros2_name(name)))


def decode(name: str, data: bytes) -> Any:
    """Decode a CDR message of type `name`, such as "taxel_msgs/TaxelScan". Raises CdrError for malformed data."""
    _register(name)
    try:
        return _STORE.deserialize_cdr(data, _make_ros2_name(name))
    except _MALFORMED as error:
        raise CdrError(f"{name}: {error}") from None


def decode_ros1(name: str, data: bytes) -> Any:
    """Decode a message of type `name` in the encoding of ROS 1 (.bag files). Raises CdrError for malformed data."""
    _register(name)
    try:
        return _STORE.deserialize_ros1(data, _make_ros2_name(name))
    except _MALFORMED as error:
        raise CdrError(f"{name}: {error}") from None


def _make_ros2_name(name: str) -> str:
    """Return the ROS 2 name of a message type: "package/msg/Name" for "package/Name"."""
    return name.replace("/", "/msg/")


@cache
def _register(name: str) -> None:
    """Register the ROS message type `name` and all types of its fields with the library rosbags."""
    types: dict[str, Any] = {}
    for part in list_message_types(name):
        if _make_ros2_name(part) not in _STORE.fielddefs:
            types |= get_types_from_msg(get_definition(part), _make_ros2_name(part))
    _STORE.register(types)


@cache
def _make_message_builder(name: str) -> Callable[[Mapping[str, Any]], Any]:
    """Return a function that converts a dict to the message object of type `name` that the library rosbags encodes."""
    _register(name)
    message_class = _STORE.types[_make_ros2_name(name)]
    converters = [(field.name, _make_converter(field)) for field in fields(name)]

    def build(message: Mapping[str, Any]) -> Any:
        """Return the message object with the values of a dict; the fields are converted as rosbags requires."""
        return message_class(*[convert(message[key]) if convert else message[key] for key, convert in converters])

    return build


def _make_converter(field: MessageField) -> Callable[[Any], Any] | None:
    """Return a function that converts the value of a message field for the library rosbags.

    Returns None for a field whose values rosbags accepts as they are.
    """
    if "/" in field.type:
        build = _make_message_builder(field.type)
        return (lambda values: [build(value) for value in values]) if field.is_array else build
    if not field.is_array or field.type not in PRIMITIVES:
        return None
    dtype = np.dtype("<" + PRIMITIVES[field.type])

    def to_array(values: Any) -> Any:
        """Return the values of an array field as a NumPy array in the type of the field."""
        is_bytes = isinstance(values, bytes | bytearray | memoryview)
        return np.frombuffer(values, dtype) if is_bytes else np.ascontiguousarray(values, dtype)

    return to_array
