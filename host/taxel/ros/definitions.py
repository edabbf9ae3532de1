"""Definitions of ROS messages: those of the project (`taxel_msgs`), of the original ROS stack, and of ROS itself.

A message name is "package/Name". ROS 1 and ROS 2 use the same definition text with two differences: `Header` has a
counter `seq` in ROS 1, and the type of a time is `time` in ROS 1 and `builtin_interfaces/Time` in ROS 2.
"""

import re
from functools import cache
from importlib import resources
from typing import NamedTuple

OWN_PACKAGE = "taxel_msgs"
PACKAGES = (OWN_PACKAGE, "bici_ros_sensor_reader")
"""ROS packages whose definitions are files of this package: the project's own, and that of the original ROS stack."""

SEPARATOR = "=" * 80
"""Line between two definitions in one schema text (MCAP registry, schema encoding ros2msg)."""
_FIELD = re.compile(r"^([\w/]+)(\[(\d*)\])?\s+(\w+)\s*(=?)")

PRIMITIVES = {
    "bool": "?", "byte": "B", "char": "B", "int8": "b", "uint8": "B", "int16": "h", "uint16": "H", "int32": "i",
    "uint32": "I", "int64": "q", "uint64": "Q", "float32": "f", "float64": "d",
}  # fmt: skip
"""Struct codes of the primitive types of fields. Other types of fields are `string` and messages."""

# Field names and types of common_interfaces and geometry2 (docs.ros.org).
_STANDARD = {
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec",
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id",
    "std_msgs/String": "string data",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w",
    "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Pose": "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation",
    "geometry_msgs/PoseStamped": "std_msgs/Header header\ngeometry_msgs/Pose pose",
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
    """One field of a ROS message.

    type: a primitive type, "string" or "package/Name". length: of an array of fixed length; None: variable length.
    """

    name: str
    type: str
    is_array: bool
    length: int | None


@cache
def get_definition(name: str) -> str:
    """Return the definition text of a ROS message type. Raises KeyError for a type that the project does not use."""
    package, _, leaf = name.partition("/")
    if package not in PACKAGES:
        return _STANDARD[name]
    file = resources.files("taxel.ros") / package / "msg" / f"{leaf}.msg"
    if not file.is_file():
        raise KeyError(name)
    return file.read_text().rstrip()


def parse_fields(text: str) -> tuple[MessageField, ...]:
    """Parse the fields of the text of a ROS message definition; constants and comments are omitted."""
    parsed = []
    for line in text.splitlines():
        match = _FIELD.match(line.strip())
        if match is not None and not match[5]:  # match[5]: the "=" of a constant
            is_array = match[2] is not None
            parsed.append(MessageField(match[4], match[1], is_array, int(match[3]) if match[3] else None))
    return tuple(parsed)


@cache
def fields(name: str) -> tuple[MessageField, ...]:
    """Return the fields of the ROS message type `name` ("package/Name")."""
    return parse_fields(get_definition(name))


@cache
def list_message_types(name: str) -> tuple[str, ...]:
    """List a ROS message type and all types that its fields use, directly or indirectly; each once, `name` first."""
    names = [name]
    for part in names:  # the list grows in the loop, so that the types of the added types are listed, too
        used = (field.type for field in fields(part) if "/" in field.type)
        names += [each for each in dict.fromkeys(used) if each not in names]
    return tuple(names)


@cache
def make_ros2_schema(name: str) -> str:
    """Return the definitions of a ROS message and of all messages that it uses, in the MCAP schema encoding ros2msg."""
    first, *used = list_message_types(name)
    return "\n".join([get_definition(first), *(f"{SEPARATOR}\nMSG: {part}\n{get_definition(part)}" for part in used)])


@cache
def make_ros1_schema(name: str) -> str:
    """Return the definitions of a ROS message and of all messages that it uses, for the class generator of ROS 1."""
    first, *used = [part for part in list_message_types(name) if part != "builtin_interfaces/Time"]
    appended = (f"{SEPARATOR}\nMSG: {part}\n{_make_ros1_definition(part)}" for part in used)
    return "\n".join([_make_ros1_definition(first), *appended])


def _make_ros1_definition(name: str) -> str:
    """Return the definition of a message for ROS 1, whose header has an additional field seq."""
    text = get_definition(name).replace("builtin_interfaces/Time", "time")
    return f"uint32 seq\n{text}" if name == "std_msgs/Header" else text
