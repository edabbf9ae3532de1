"""Writer of MCAP recordings: the topics of the skin as ROS 2 messages, and the bytes of the hub."""

import contextlib
import json
import os
import threading
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import IO, Final, Self, cast

from taxel.link import CaptureError
from taxel.link.live_records import open_live_output
from taxel.optional import optional_import
from taxel.output import LiveOutput
from taxel.ros.cdr import encode
from taxel.ros.definitions import make_ros2_schema
from taxel.ros.record_stream import RecordStream
from taxel.ros.tf_tree import make_header
from taxel.ros.topics import TopicMessage

with optional_import("mcap", "an MCAP file (.mcap)"):
    from mcap.well_known import MessageEncoding, SchemaEncoding
    from mcap.writer import CompressionType, Writer

BYTES_TOPIC: Final = "/taxel/hub_bytes"
BYTES_TYPE: Final = "taxel_msgs/HubBytes"
METADATA: Final = "taxel"
"""Name of the metadata record with the header of the recording; each value is JSON."""

FLUSH_S: Final = 0.5
"""Longest time for which a message stays in memory while messages are written, seconds. A killed program loses at most
this much. A smaller value makes smaller chunks, which compress less.
"""

CHUNK_BYTES: Final = 1 << 20
LIBRARY: Final = "taxel"


class McapFile:
    """An MCAP file that is being written. Two threads may use the same object.

    head: header of the recording; its values must be JSON values. Chunks are compressed (zstd) and passed to the
    operating system at least every `FLUSH_S` seconds as long as `tick` or a write method is called. The file of a
    killed program has no index, but readers that read from front to back accept the file. Raises `CaptureError` if the
    file exists and `overwrite` is False, or if the file cannot be written.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        head: Mapping[str, object],
        overwrite: bool = False,
        output: LiveOutput | None = None,
    ) -> None:
        """Create an MCAP file and write the header of the recording.

        head: header of the recording, JSON values. output: open output that is written instead of `path`; None: a new
        file. With `overwrite`, an existing file is replaced when the first message is written. Raises CaptureError if
        the file exists and `overwrite` is False, or if the file cannot be written.
        """
        self.path = Path(path)
        self.messages = 0
        self._lock = threading.Lock()
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._flushed_s = time.monotonic()
        self._has_unflushed = False
        self._is_grouping = False
        self._output = open_live_output(path, overwrite) if output is None else output
        self._stream = RecordStream(self._output.file)
        try:
            self._writer = Writer(cast(IO[bytes], self._stream), CHUNK_BYTES, CompressionType.ZSTD)
            self._writer.start("ros2", LIBRARY)
            self.add_metadata(METADATA, head)
            with self._errors():
                self._output.begin()
        except BaseException:
            self._output.discard()
            raise

    def add_metadata(self, name: str, values: Mapping[str, object]) -> None:
        """Add a metadata record to the MCAP file; each value is written as JSON."""
        with self._lock, self._errors():
            self._writer.add_metadata(name, {key: json.dumps(value) for key, value in values.items()})
            self._stream.flush()

    def publish(self, message: TopicMessage) -> None:
        """Append a ROS message to its topic in the MCAP file."""
        with self._lock, self._errors():
            self._append(message.topic, message.type, message.time_ns, encode(message.type, message.message))
            self._flush_if_due()

    def write_bytes(self, data: bytes, arrival_ns: int, time_ns: int) -> None:
        """Append bytes of the hub to the MCAP file.

        arrival_ns: arrival time on the clock of the link, nanoseconds. time_ns: the same moment as Unix time.
        """
        message = {"header": make_header(time_ns, ""), "arrival_ns": arrival_ns, "data": data}
        with self._lock, self._errors():
            self._append(BYTES_TOPIC, BYTES_TYPE, time_ns, encode(BYTES_TYPE, message))
            self._flush_if_due()

    def tick(self) -> None:
        """Write the current chunk of the MCAP file if `FLUSH_S` seconds have elapsed since the last chunk.

        Call this method regularly while no data arrives.
        """
        with self._lock, self._errors():
            self._flush_if_due()

    @contextlib.contextmanager
    def group(self) -> Iterator[None]:
        """Context manager that keeps the messages of its `with` block in one chunk.

        A chunk that becomes due within the block is written at the end of the block.
        """
        self._is_grouping = True
        try:
            yield
        finally:
            self._is_grouping = False
            self.tick()

    def _append(self, topic: str, type_name: str, time_ns: int, data: bytes) -> None:
        """Append an encoded message to a topic of the MCAP file, without writing a chunk that is due.

        type_name: "package/Name". time_ns: Unix time. The first message gives the file its final name.
        """
        self._stream.check()
        channel = self._channels.get(topic)
        if channel is None:
            channel = self._channels[topic] = self._new_channel(topic, type_name)
        self._writer.add_message(channel, max(time_ns, 0), data, max(time_ns, 0))
        self.messages += 1
        self._has_unflushed = True
        if not self._output.is_published:
            self._flush()
            self._output.publish()

    def _new_channel(self, topic: str, type_name: str) -> int:
        """Register a channel of the MCAP file for a topic, with the schema of its type. Returns the channel number."""
        schema = self._schemas.get(type_name)
        if schema is None:
            name = type_name.replace("/", "/msg/")
            schema = self._writer.register_schema(name, SchemaEncoding.ROS2, make_ros2_schema(type_name).encode())
            self._schemas[type_name] = schema
        return self._writer.register_channel(topic, MessageEncoding.CDR, schema)

    def _flush_if_due(self) -> None:
        """Write the current chunk if `FLUSH_S` seconds have elapsed since the last chunk and no `group` is open."""
        now_s = time.monotonic()
        if self._has_unflushed and not self._is_grouping and now_s - self._flushed_s >= FLUSH_S:
            self._flush()

    def _flush(self) -> None:
        """Write the current chunk of the MCAP file."""
        self._writer.flush()  # type: ignore[no-untyped-call]
        self._stream.flush()
        self._flushed_s = time.monotonic()
        self._has_unflushed = False

    @contextlib.contextmanager
    def _errors(self) -> Iterator[None]:
        """Context manager that converts an OSError into a `CaptureError` that names this file."""
        try:
            yield
        except OSError as error:
            problem = f"cannot be written ({error.strerror}); the part before is kept"
            raise CaptureError(str(self.path), problem + self._output.describe_previous()) from error

    @property
    def is_closed(self) -> bool:
        """Whether the file is closed."""
        return self._output.file.closed

    def close(self) -> None:
        """Write the last chunk and the index of the MCAP file, and close the file. A second call has no effect.

        After a failed write only the file is closed. A file without messages does not replace an existing one.
        """
        with self._lock, self._errors():
            if self._output.file.closed:
                return
            try:
                if not self.messages and not self._output.is_published:
                    self._output.discard()
                elif not self._stream.has_failed:
                    self._flush()
                    self._writer.finish()  # type: ignore[no-untyped-call]
                    self._stream.flush()
                    self._output.close()
            finally:
                self._output.fail()

    def discard(self) -> None:
        """Close the file. A file without messages is removed, and an existing file of the same name stays."""
        if self.messages:
            self.close()
        else:
            self._output.discard()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Complete and close the MCAP file at the end of the `with` block."""
        self.close()
