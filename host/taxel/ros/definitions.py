"""Message definitions: our own (`taxel_msgs/`, a ROS package), and the standard ones that the skin is published in.

Names are "package/Name". ROS 1 and ROS 2 read the same text but for `Header`, which has a counter in ROS 1, and times.
"""

from __future__ import annotations

import re
from functools import cache
from importlib import resources
from typing import NamedTuple

OWN_PACKAGE = "taxel_msgs"
_RULE = "=" * 80
_FIELD = re.compile(r"^([\w/]+)(\[(\d*)\])?\s+(\w+)\s*(=?)")

PRIMITIVES = {
    "bool": "?", "byte": "B", "char": "B", "int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i",
    "uint32": "I", "int64": "q", "uint64": "Q", "float32": "f", "float64": "d",
}  # fmt: skip
"""Struct codes of the types that a field may have beside `string` and other messages."""

# Field names and types of common_interfaces and geometry2 (docs.ros.org); ROS 1 adds nothing but Header.seq.
_STANDARD = {
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec",
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id",
    "std_msgs/String": "string data",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w",
    "geometry_msgs/Transform": "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation",
    "geometry_msgs/TransformStamped": (
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform"
    ),
    "tf2_msgs/TFMessage": "geometry_msgs/TransformStamped[] transforms",
    "sensor_msgs/JointState": (
        "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort"
    ),
    "sensor_msgs/PointField": (
        "uint8 INT8=1\nuint8 UINT8=2\nuint8 INT16=3\nuint8 UINT16=4\nuint8 INT32=5\nuint8 UINT32=6\nuint8 FLOAT32=7\n"
        "uint8 FLOAT64=8\nstring name\nuint32 offset\nuint8 datatype\nuint32 count"
    ),
    "sensor_msgs/PointCloud2": (
        "std_msgs/Header header\nuint32 height\nuint32 width\nsensor_msgs/PointField[] fields\nbool is_bigendian\n"
        "uint32 point_step\nuint32 row_step\nuint8[] data\nbool is_dense"
    ),
    "diagnostic_msgs/KeyValue": "string key\nstring value",
    "diagnostic_msgs/DiagnosticStatus": (
        "byte OK=0\nbyte WARN=1\nbyte ERROR=2\nbyte STALE=3\n"
        "byte level\nstring name\nstring message\nstring hardware_id\ndiagnostic_msgs/KeyValue[] values"
    ),
    "diagnostic_msgs/DiagnosticArray": "std_msgs/Header header\ndiagnostic_msgs/DiagnosticStatus[] status",
}


class MessageField(NamedTuple):
    """A field of a message: `type` is primitive, "string" or "package/Name"; `length` None: as many as there are."""

    name: str
    type: str
    is_array: bool
    length: int | None


@cache
def definition(name: str) -> str:
    """The text that defines a message. Raises KeyError for one that nobody here publishes."""
    package, _, leaf = name.partition("/")
    if package != OWN_PACKAGE:
        return _STANDARD[name]
    file = resources.files("taxel.ros") / OWN_PACKAGE / "msg" / f"{leaf}.msg"
    if not file.is_file():
        raise KeyError(name)
    return file.read_text().rstrip()


def parse_fields(text: str) -> tuple[MessageField, ...]:
    """The fields of a definition; constants and comments are none."""
    found = []
    for line in text.splitlines():
        match = _FIELD.match(line.strip())
        if match is not None and not match[5]:
            is_array = match[2] is not None
            found.append(MessageField(match[4], match[1], is_array, int(match[3]) if match[3] else None))
    return tuple(found)


@cache
def fields(name: str) -> tuple[MessageField, ...]:
    """The fields of a message."""
    return parse_fields(definition(name))


def _parts(name: str) -> list[str]:
    """A message and all that it is made of, each once, itself first."""
    found = [name]
    for part in found:
        wanted = (field.type for field in fields(part) if "/" in field.type)
        found += [each for each in dict.fromkeys(wanted) if each not in found]
    return found


@cache
def ros2_schema(name: str) -> str:
    """The definition with all that it is made of, as MCAP wants it (schema encoding ros2msg)."""
    first, *others = _parts(name)
    return "\n".join([definition(first), *(f"{_RULE}\nMSG: {part}\n{definition(part)}" for part in others)])


@cache
def ros1_schema(name: str) -> str:
    """The same for ROS 1, as its message generator wants it."""
    first, *others = [part for part in _parts(name) if part != "builtin_interfaces/Time"]
    return "\n".join([_in_ros1(first), *(f"{_RULE}\nMSG: {part}\n{_in_ros1(part)}" for part in others)])


def _in_ros1(name: str) -> str:
    text = definition(name).replace("builtin_interfaces/Time", "time")
    return f"uint32 seq\n{text}" if name == "std_msgs/Header" else text
