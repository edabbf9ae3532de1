"""ROS bags with topics of any type: rosbag2 (MCAP or sqlite3) and ROS 1 bags. Needs the package rosbags.

A field of a message is named by the topic and the path in the message: ``/tactile:taxels.values``. Nested messages and
lists of messages are arrays: a message with two lists of 28 values gives an array [message, 2, 28]. ``/tactile:@time``
is the time at which the message was recorded, and ``...header.stamp`` the time stamp of its header, both nanoseconds.
"""

from __future__ import annotations

import sqlite3
from contextlib import closing
from dataclasses import fields as message_fields
from dataclasses import is_dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from taxel.hand.errors import format_value
from taxel.optional import optional_import
from taxel.recording.grasp_checks import Location
from taxel.recording.importers.fields import NUMBERS, Field, Source, make_field

RECORD_TIME: Final = "@time"
"""Name of the field with the time at which a message was recorded, nanoseconds."""

_NANOSECONDS: Final = 10**9
_DATABASE: Final = ".db3"


def open_file(path: Path) -> Source:
    """Read all messages of a bag. Raises DatasetError for a damaged bag, and MissingPackageError without rosbags."""
    with optional_import("rosbags", "a ROS bag"):
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    location = Location(str(path))
    for database in [path] if path.suffix == _DATABASE else sorted(path.glob(f"*{_DATABASE}")):
        _check_database(database, location)
    values: dict[str, list[Any]] = {}
    count = 0
    try:
        # Bags of ROS 2 before Iron contain no message definitions; the standard types are then those of Humble.
        with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
            for connection, time_ns, data in reader.messages():
                count += 1
                values.setdefault(f"{connection.topic}:{RECORD_TIME}", []).append(np.int64(time_ns))
                message = reader.deserialize(data, connection.msgtype)
                for name, value in _flatten(message).items():
                    values.setdefault(f"{connection.topic}:{name}", []).append(value)
    except Exception as error:  # the library raises several types for a damaged bag
        found = f"an error after {count} messages ({format_value(str(error).partition(chr(10))[0])})"
        location.fail("a complete ROS bag with message definitions", found, "run ros2 bag reindex, or record it again")
    if not count:
        location.fail("messages", "none", "check which topics were recorded")
    return Source(path, "ROS bag", {name: _make_field(name, entries, location) for name, entries in values.items()})


def _check_database(path: Path, location: Location) -> None:
    """Raise DatasetError for a damaged SQLite database: with a damaged index, queries omit or exchange messages."""
    try:
        with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True)) as connection:
            (result,) = connection.execute("PRAGMA integrity_check(1)").fetchone()
    except (sqlite3.Error, UnicodeError) as error:
        result = str(error)
    if result != "ok":
        location.key(path.name).fail(
            "a complete ROS bag with an undamaged SQLite database",
            format_value(str(result).partition(chr(10))[0]),
            "record the bag again",
        )


def _flatten(message: Any, prefix: str = "") -> dict[str, Any]:
    """Return the numbers, times and strings of a message by their path, such as "header.stamp".

    Time stamps become nanoseconds. prefix: path of the message in its parent message, with a full stop at its end.
    """
    result: dict[str, Any] = {}
    for entry in message_fields(message):
        value, name = getattr(message, entry.name), prefix + entry.name
        if entry.name.startswith("__"):
            continue
        if hasattr(value, "sec") and hasattr(value, "nanosec"):
            result[name] = np.int64(value.sec * _NANOSECONDS + value.nanosec)
        elif is_dataclass(value):
            result |= _flatten(value, f"{name}.")
        elif isinstance(value, list) and value and is_dataclass(value[0]):
            result |= _stack([_flatten(item, f"{name}.") for item in value])
        elif isinstance(value, str):
            result[name] = value
        else:
            array = np.asarray(value)
            if array.dtype.kind in NUMBERS:
                result[name] = array
    return result


def _stack(items: list[dict[str, Any]]) -> dict[str, Any]:
    """Join the values of a list of messages along a new first axis; return arrays by path.

    items: values of each message by path. Strings, and values whose shape differs between messages, are left out.
    """
    result = {}
    for name in items[0]:
        entries: list[Any] = [item.get(name) for item in items]
        is_numeric = not any(entry is None or isinstance(entry, str) for entry in entries)
        if is_numeric and len({np.shape(entry) for entry in entries}) == 1:
            result[name] = np.stack([np.asarray(entry) for entry in entries])
    return result


def _make_field(name: str, entries: list[Any], location: Location) -> Field:
    """Return a field with one entry for each message of a topic.

    If the shapes of the entries differ, the field can be listed, but reading it raises DatasetError.
    """
    if isinstance(entries[0], str):
        return make_field(name, np.array(entries, dtype=str))
    shapes = {np.shape(entry) for entry in entries}
    if len(shapes) == 1:
        return make_field(name, np.stack([np.asarray(entry) for entry in entries]))

    def load() -> NDArray[Any]:
        """Raise DatasetError: the entries cannot be joined to one array."""
        found = ", ".join(str(shape) for shape in sorted(shapes)[:3])
        return location.key(name.lstrip("/")).fail(
            "one shape in every message", f"shapes {found}", "choose another field"
        )

    return Field(name, (len(entries),), "ragged", load)
