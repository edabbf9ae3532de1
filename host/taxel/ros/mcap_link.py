"""Reader of MCAP recordings, as a link whose bytes come from the file instead of a port."""

import os
from collections.abc import Iterator, Mapping
from typing import Any

from taxel.input_files import TextError, open_regular_file, parse_json
from taxel.link import CaptureError, Chunk, Link
from taxel.link.recording_header import check_recording_header
from taxel.optional import optional_import
from taxel.ros.cdr import CdrError, decode, decode_ros1
from taxel.ros.definitions import SEPARATOR, fields, parse_fields
from taxel.ros.mcap_file import BYTES_TYPE, METADATA
from taxel.ros.mcap_records import DAMAGE, read_records
from taxel.ros.original_topics import ORIGINAL_HAND, ORIGINAL_TYPE, OriginalFrames, OriginalMessageError
from taxel.stream import TaxelFrame
from taxel.stream.encoder import FramesLink

with optional_import("mcap", "an MCAP file (.mcap)"):
    from mcap.records import Channel, Message, Metadata, Schema

SCAN_TYPE = "taxel_msgs/TaxelScan"
READ_TYPES = (BYTES_TYPE, SCAN_TYPE, ORIGINAL_TYPE)
"""Message types of a skin."""

METADATA_MAX = 1 << 22
"""Largest size of one entry of the header, bytes; the text of a hand has at most 1 MiB."""

_DECODERS = {"cdr": decode, "ros1": decode_ros1}  # by message encoding of a channel
_ORIGINAL_NAME = ORIGINAL_TYPE.partition("/")[2]


class McapReader:
    """Reader of an MCAP file with the hub's bytes or the scans of a skin, from front to back, in constant memory.

    header: header of the recording; {} if the file has none. has_bytes: whether the file contains the hub's bytes;
    False for a bag with scans only. has_original_messages: whether the messages are those of the original ROS stack.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        """Open an MCAP file and read up to its first message of a skin.

        Raises CaptureError if the file cannot be read or has no topic of a skin.
        """
        self.name = os.fspath(path)
        try:
            self._file = open_regular_file(path)
        except OSError as error:
            raise CaptureError(self.name, f"cannot be read ({error.strerror})") from error
        self.header: dict[str, Any] = {}
        self._channels: dict[int, tuple[str, str]] = {}  # type and message encoding
        self._schemas: dict[int, str] = {}
        self._records = self._read_records()
        self._first: tuple[str, str, Message] | None = None
        self._damage: CaptureError | None = None
        try:
            self._read_first_message()
        except BaseException:
            self._file.close()
            raise
        # A recording without messages is treated as one with bytes of the hub: it has no frames to encode.
        self.has_bytes = self._first is None or self._first[0] == BYTES_TYPE
        self.has_original_messages = self._first is not None and self._first[0] == ORIGINAL_TYPE

    def _read_first_message(self) -> None:
        """Read the MCAP file up to the first message of a skin.

        An error of a file that is damaged after the header of the recording is raised later, by `messages`.
        """
        try:
            self._first = next(self._records, None)
        except CaptureError as error:
            if not self.header:
                raise
            self._damage = error
            return
        if self._first is None and not self.header:
            raise CaptureError(self.name, "has no topic of a skin (taxel_msgs/msg/HubBytes, TaxelScan or TactileData)")

    def messages(self) -> Iterator[tuple[str, Any, int]]:
        """Yield (type, message, log time in nanoseconds) of each message of a skin in the MCAP file.

        Raises `CaptureError` at the position where the file is truncated or damaged, after all messages before it.
        """
        if self._damage is not None:
            raise self._damage
        if self._first is not None:
            yield self._decode_message(*self._first)
            self._first = None
        for record in self._records:
            yield self._decode_message(*record)

    def _decode_message(self, type_name: str, encoding: str, message: Message) -> tuple[str, Any, int]:
        """Decode a message to (type, message, log time in nanoseconds).

        Raises `CaptureError` if its data are malformed.
        """
        try:
            return type_name, _DECODERS[encoding](type_name, message.data), message.log_time
        except CdrError as error:
            raise CaptureError(self.name, f"has a message that cannot be decoded ({error})") from None

    def _read_records(self) -> Iterator[tuple[str, str, Message]]:
        """Yield (type, message encoding, message) of all messages of a skin, up to the end of the data section.

        Raises `CaptureError` at a damaged record.
        """
        try:
            for record in read_records(self._file):
                yield from self._process(record)
        except DAMAGE:
            position = f"near byte {self._file.tell()}"
            raise CaptureError(
                self.name, f"is truncated or damaged {position}; everything before it was read"
            ) from None

    def _process(self, record: Any) -> Iterator[tuple[str, str, Message]]:
        """Process one MCAP record.

        A schema, a channel or the header of the recording is stored. A message of a skin is yielded as (type, message
        encoding, message). All other records are ignored.
        """
        if isinstance(record, Message):
            channel = self._channels.get(record.channel_id)
            if channel is not None:
                yield *channel, record
        elif isinstance(record, Schema):
            self._schemas[record.id] = self._check_schema(record)
        elif isinstance(record, Channel):
            name = self._schemas.get(record.schema_id, "")
            is_cdr = record.message_encoding == "cdr"
            if name in READ_TYPES and (is_cdr or (name == ORIGINAL_TYPE and record.message_encoding == "ros1")):
                self._channels[record.id] = (name, record.message_encoding)
        elif isinstance(record, Metadata) and record.name == METADATA:
            self._add_metadata(record.metadata)

    def _add_metadata(self, metadata: Mapping[str, str]) -> None:
        """Add metadata, JSON strings by key, to the header of the recording. Raises `CaptureError` if invalid."""
        try:
            values = {key: parse_json(value.encode(), METADATA_MAX) for key, value in metadata.items()}
            self.header |= check_recording_header(values)
        except TextError as error:
            raise CaptureError(self.name, f"has a damaged header ({error})") from None

    def _check_schema(self, schema: Schema) -> str:
        """Return the type that an MCAP schema defines, "package/Name".

        An original message of any package is returned as `ORIGINAL_TYPE`. Raises `CaptureError` if a type of
        `READ_TYPES` has other fields than in this version.
        """
        name = schema.name.replace("/msg/", "/")
        if name.rpartition("/")[2] == _ORIGINAL_NAME:  # early original stacks use other package names
            name = ORIGINAL_TYPE
        if name not in READ_TYPES:
            return name
        if parse_fields(schema.data.decode(errors="replace").partition(SEPARATOR)[0]) != fields(name):
            raise CaptureError(
                self.name, f"has another definition of {schema.name}; use the release that wrote the file"
            )
        return name

    def close(self) -> None:
        """Close the MCAP file."""
        self._file.close()


class McapLink:
    """A `Link` that reads the hub's bytes from an MCAP file, without delay.

    Raises `CaptureError` as `McapReader` does.
    """

    is_real_time = False
    is_recorded = True
    has_flow_control = False

    def __init__(self, reader: McapReader) -> None:
        """Create a link that returns the hub's bytes which `reader` reads from an MCAP file."""
        self.name = reader.name
        self.header = reader.header
        self.has_arrivals = reader.header.get("clock") != "hub"
        # A missing or implausible baud rate is replaced by 1 Mbit/s.
        baud = self.header.get("baud", 1e6)
        self.baud = float(baud) if isinstance(baud, int | float) and 1e3 <= baud <= 1e9 else 1e6
        self._reader = reader
        self._messages = reader.messages()

    def read(self, timeout_s: float = 0.0) -> Chunk:
        """Return the next bytes of the hub in the MCAP file. Raises EOFError at the end of a complete file.

        The call does not wait; `timeout_s` has no effect.
        """
        for type_name, message, _ in self._messages:
            if type_name == BYTES_TYPE:
                return Chunk(message.data.tobytes(), int(message.arrival_ns))
        raise EOFError

    def write(self, data: bytes) -> None:
        """Raise `CaptureError`: a recording takes no commands."""
        raise CaptureError(self.name, "is a recording; it takes no commands")

    def close(self) -> None:
        """Close the MCAP file."""
        self._reader.close()


def open_mcap(path: str | os.PathLike[str]) -> Link:
    """Open an MCAP file as a link: the hub's bytes, or for a bag without them, bytes encoded from its messages."""
    reader = McapReader(path)
    if reader.has_bytes:
        return McapLink(reader)
    link = FramesLink(reader.name, _read_frames(reader))
    default = {"hand": ORIGINAL_HAND} if reader.has_original_messages else {}
    link.header = default | reader.header
    return link


def _read_frames(reader: McapReader) -> Iterator[TaxelFrame]:
    """Yield the valid scans, or the original messages, of an MCAP file as taxel frames; close the reader at the end."""
    original_frames = OriginalFrames()
    try:
        for type_name, message, time_ns in reader.messages():
            if type_name == ORIGINAL_TYPE and reader.has_original_messages:
                yield original_frames.convert(message, time_ns)
            elif type_name == SCAN_TYPE and message.valid:
                stamp = message.header.stamp
                time_s = stamp.sec + stamp.nanosec * 1e-9
                times_us = (message.board_time_us, message.hub_time_us)
                yield TaxelFrame(
                    message.address, message.cycle, message.sequence, time_s, *times_us, message.raw_counts
                )
    except OriginalMessageError as error:
        raise CaptureError(reader.name, str(error)) from None
    finally:
        reader.close()
