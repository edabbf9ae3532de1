"""Reading a recording from MCAP as if its bytes came from a port."""

from __future__ import annotations

import json
import os
import struct
from collections.abc import Iterator
from typing import Any, BinaryIO

import zstandard
from mcap.exceptions import McapError
from mcap.records import Channel, Footer, Message, Metadata, Schema
from mcap.records import Chunk as McapChunk
from mcap.stream_reader import StreamReader, breakup_chunk

from taxel.link import CaptureError, Chunk, Link
from taxel.ros.cdr import CdrError, decode
from taxel.ros.definitions import fields, parse_fields
from taxel.ros.mcap_file import BYTES_TYPE, METADATA
from taxel.stream import TaxelFrame
from taxel.stream.encoder import FramesLink

MAGIC = b"\x89MCAP0\r\n"
SCAN_TYPE = "taxel_msgs/TaxelScan"
RECORD_MAX = 1 << 28
"""Bytes of a record or of an unpacked chunk; a file is not trusted."""

_DAMAGE = (McapError, ValueError, struct.error, zstandard.ZstdError, RuntimeError, OverflowError)


def is_mcap(path: str | os.PathLike[str]) -> bool:
    """Whether a file begins as an MCAP file does."""
    try:
        with open(path, "rb") as file:
            return file.read(len(MAGIC)) == MAGIC
    except OSError:
        return False


class McapReader:
    """Messages of the skin's own types, from front to back, in constant memory; no index is needed.

    `header`: the recording's, {} where there is none. `has_bytes`: whether the hub's bytes are in it. Raises
    `CaptureError` if the file cannot be read or has nothing of a skin.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.name = os.fspath(path)
        try:
            self._file: BinaryIO = open(path, "rb")  # noqa: SIM115
        except OSError as error:
            raise CaptureError(self.name, f"cannot be read ({error.strerror})") from error
        self.header: dict[str, Any] = {}
        self._channels: dict[int, tuple[str, str]] = {}
        self._schemas: dict[int, str] = {}
        self._records = self._read_records()
        self._held: list[tuple[str, Message]] = []
        try:
            self._look_ahead()
        except BaseException:
            self._file.close()
            raise
        self.has_bytes = bool(self._held) and self._held[0][0] == BYTES_TYPE

    def _look_ahead(self) -> None:
        """Read up to the first message of the skin; a file that is damaged later is no concern yet."""
        first = next(self._records, None)
        if first is not None:
            self._held.append(first)
        elif not self.header:
            raise CaptureError(self.name, "has no topic of a skin (taxel_msgs/msg/HubBytes or TaxelScan)")

    def messages(self) -> Iterator[tuple[str, dict[str, Any], int]]:
        """(type, fields, log time in nanoseconds) of each message.

        Raises `CaptureError` at the place where the file is cut short or damaged, after everything before it.
        """
        while self._held:
            yield self._decoded(*self._held.pop())
        for type_name, message in self._records:
            yield self._decoded(type_name, message)

    def _decoded(self, type_name: str, message: Message) -> tuple[str, dict[str, Any], int]:
        try:
            return type_name, decode(type_name, message.data), message.log_time
        except CdrError as error:
            raise CaptureError(self.name, f"has a message that cannot be read ({error})") from None

    def _read_records(self) -> Iterator[tuple[str, Message]]:
        try:
            reader = StreamReader(self._file, emit_chunks=True, record_size_limit=RECORD_MAX)
            for record in reader.records:
                if isinstance(record, Footer):
                    return
                if isinstance(record, McapChunk):
                    if record.uncompressed_size > RECORD_MAX:
                        raise ValueError("its chunk is too large")
                    for part in breakup_chunk(record, validate_crc=True):
                        yield from self._note(part)
                else:
                    yield from self._note(record)
        except _DAMAGE:
            place = f"near byte {self._file.tell()}"
            raise CaptureError(self.name, f"is cut short or damaged {place}; everything before it was read") from None

    def _note(self, record: Any) -> Iterator[tuple[str, Message]]:
        if isinstance(record, Message):
            known = self._channels.get(record.channel_id)
            if known is not None:
                yield known[0], record
        elif isinstance(record, Schema):
            self._schemas[record.id] = self._checked(record)
        elif isinstance(record, Channel):
            name = self._schemas.get(record.schema_id, "")
            if name in (BYTES_TYPE, SCAN_TYPE) and record.message_encoding == "cdr":
                self._channels[record.id] = (name, record.topic)
        elif isinstance(record, Metadata) and record.name == METADATA:
            self.header |= {key: json.loads(value) for key, value in record.metadata.items()}

    def _checked(self, schema: Schema) -> str:
        name = schema.name.replace("/msg/", "/")
        if name not in (BYTES_TYPE, SCAN_TYPE):
            return name
        own = parse_fields(schema.data.decode(errors="replace").partition("=" * 80)[0])
        if own != fields(name):
            raise CaptureError(self.name, f"has another form of {schema.name}; use the release that wrote it")
        return name

    def close(self) -> None:
        """Close the file."""
        self._file.close()


class McapLink:
    """The hub's bytes in an MCAP file, as fast as they are asked for; a `Link`.

    Raises `CaptureError` as `McapReader` does.
    """

    is_real_time = False
    is_recorded = True
    holds_back = False

    def __init__(self, reader: McapReader) -> None:
        self.name = reader.name
        self.header = reader.header
        self.has_arrivals = reader.header.get("clock") != "hub"
        baud = self.header.get("baud", 1e6)
        self.baud = float(baud) if isinstance(baud, int | float) and 1e3 <= baud <= 1e9 else 1e6
        self._reader = reader
        self._messages = reader.messages()

    def read(self, timeout_s: float = 0.0) -> Chunk:
        """The next bytes. Raises EOFError at the end of a whole file."""
        for type_name, message, _ in self._messages:
            if type_name == BYTES_TYPE:
                return Chunk(message["data"].tobytes(), int(message["arrival_ns"]))
        raise EOFError

    def write(self, data: bytes) -> None:
        """Refused: nobody answers in a recording."""
        raise CaptureError(self.name, "is a recording; it takes no commands")

    def close(self) -> None:
        """Close the file."""
        self._reader.close()


def open_mcap(path: str | os.PathLike[str]) -> Link:
    """The link of an MCAP file: its bytes, or where it has none (a bag of the ROS topics) bytes made from its scans."""
    reader = McapReader(path)
    if reader.has_bytes or not reader._held:
        return McapLink(reader)
    link = FramesLink(reader.name, _frames(reader))
    link.header = reader.header
    return link


def _frames(reader: McapReader) -> Iterator[TaxelFrame]:
    try:
        for type_name, message, _ in reader.messages():
            if type_name == SCAN_TYPE and message["valid"]:
                stamp = message["header"]["stamp"]
                time_s = stamp["sec"] + stamp["nanosec"] * 1e-9
                numbers = (message[name] for name in ("board_time_us", "hub_time_us", "raw_counts"))
                yield TaxelFrame(message["address"], message["cycle"], message["sequence"], time_s, *numbers)
    finally:
        reader.close()
