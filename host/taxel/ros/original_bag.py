"""Reader of ROS 1 bags (.bag) with the topics of the original ROS stack, as a link of recorded frames."""

import os
from collections.abc import Iterator

from taxel.input_files import check_regular_file
from taxel.link import CaptureError
from taxel.optional import optional_import
from taxel.ros.cdr import CdrError, decode_ros1
from taxel.ros.definitions import fields, parse_fields
from taxel.ros.original_topics import (
    COMPLETE_HAND,
    ORIGINAL_HAND,
    ORIGINAL_TYPE,
    THUMB_ADDRESSES,
    OriginalFrames,
    OriginalMessageError,
    make_original_topic,
)
from taxel.stream import TaxelFrame
from taxel.stream.encoder import FramesLink

with optional_import("rosbags", "a ROS bag (.bag)"):
    from rosbags.interfaces import Connection
    from rosbags.rosbag1 import Reader

_ROOT = ORIGINAL_TYPE.partition("/")[2]


def open_original_bag(path: str | os.PathLike[str]) -> FramesLink:
    """Open a ROS 1 bag with topics of type TactileData, of any package, as a link.

    The header of the link names the hand: `original_complete` if the bag has messages of the thumb's boards, else
    `original`. Raises `CaptureError` for a file that cannot be read or has no such topic; a damaged message raises the
    error when it is reached.
    """
    name = os.fspath(path)
    reader = _open_reader(name)
    try:
        connections = [each for each in reader.connections if _is_original(name, each)]
        if not connections:
            raise CaptureError(name, "has no topic of the original ROS stack (sensor_8_readings ..., type TactileData)")
    except BaseException:
        reader.close()
        raise
    thumb_topics = {make_original_topic(address).strip("/") for address in THUMB_ADDRESSES}
    has_thumb = any(each.topic.strip("/") in thumb_topics and each.msgcount for each in connections)
    link = FramesLink(name, _read_frames(name, reader, connections))
    link.header = {"hand": COMPLETE_HAND if has_thumb else ORIGINAL_HAND}
    return link


def _open_reader(name: str) -> Reader:
    """Open a ROS 1 bag and read its index. Raises `CaptureError` for a file that cannot be read.

    The library rosbags documents only ReaderError, but for a damaged bag it also raises errors of struct, of the
    decompressors and of its assertions. Every error of the library is therefore treated as a damaged bag.
    """
    try:
        check_regular_file(name)
        reader = Reader(name)
        reader.open()
    except FileNotFoundError:
        raise CaptureError(name, "cannot be read (No such file or directory)") from None
    except Exception as error:
        if "not indexed" in str(error):
            raise CaptureError(
                name, "has no index, because its recording was interrupted; run: rosbag reindex"
            ) from None
        reason = error.strerror if isinstance(error, OSError) and error.strerror else "is no complete ROS 1 bag"
        raise CaptureError(name, f"cannot be read ({reason})") from None
    return reader


def _is_original(name: str, connection: Connection) -> bool:
    """Whether a connection of a bag has the type TactileData. Raises `CaptureError` for a type with other fields."""
    if connection.msgtype.rpartition("/")[2] != _ROOT:
        return False
    if parse_fields(connection.msgdef.data) != fields(ORIGINAL_TYPE):
        raise CaptureError(
            name,
            f"topic {connection.topic} has another definition of {_ROOT}; expected the fields float32[] data, "
            "uint32 timestamp, uint8 sensor_num",
        )
    return True


def _read_frames(name: str, reader: Reader, connections: list[Connection]) -> Iterator[TaxelFrame]:
    """Yield the taxel frames of a bag in order of recording, and close the bag at the end.

    name: name of the file, for error messages. Raises `CaptureError` at the first damaged message.
    """
    frames = OriginalFrames()
    count = 0
    try:
        for time_ns, data in _read_messages(name, reader, connections):
            count += 1
            yield frames.convert(decode_ros1(ORIGINAL_TYPE, data), time_ns)
    except OriginalMessageError as error:
        raise CaptureError(name, f"message {count}: {error}") from None
    except CdrError:
        raise _make_damage_error(name, count) from None
    finally:
        reader.close()


def _read_messages(name: str, reader: Reader, connections: list[Connection]) -> Iterator[tuple[int, bytes]]:
    """Yield (time of recording in nanoseconds, encoded message) for each message of the given connections.

    Raises `CaptureError` at the first damaged place.
    """
    count = 0
    try:
        for _, time_ns, data in reader.messages(connections):
            count += 1
            yield time_ns, data
    except Exception:  # of the library, as in `_open_reader`: errors of the caller do not reach this generator
        raise _make_damage_error(name, count) from None


def _make_damage_error(name: str, count: int) -> CaptureError:
    """Return the error of a bag that is damaged after `count` messages."""
    return CaptureError(name, f"is damaged after {count} messages; everything before was read")
