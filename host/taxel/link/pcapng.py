"""PCAPNG files with the bytes of a hub, for Wireshark and tshark: format and writer.

Format: draft-ietf-opsawg-pcapng. A file consists of one section header block, one interface description block of link
type USER0, and one enhanced packet block for each frame of the stream. The bytes of all packets in their order are the
bytes of the hub. The first comments in the section header block are the header of the recording, so that a file can be
converted back.
"""

import json
import os
import re
import struct
from pathlib import Path
from types import TracebackType

from taxel.link.capture import HEADER_MAX
from taxel.link.errors import CaptureError
from taxel.link.live_records import LiveRecords
from taxel.output import LiveOutput

SUFFIX = ".pcapng"
SECTION, INTERFACE, PACKET = 0x0A0D0D0A, 1, 6
"""Types of the blocks in a file: section header block, interface description block, enhanced packet block."""

BYTE_ORDER = 0x1A2B3C4D
LINK_TYPE = 147
"""LINKTYPE_USER0 (tcpdump.org/linktypes.html), reserved for private protocols; the project's dissector is registered
for this type.
"""

PIECE_MAX = 1 << 15
"""Largest packet, bytes. A longer piece of the stream without a delimiter contains no frame, and is divided."""

OPTION_COMMENT, OPTION_RESOLUTION, OPTION_APPLICATION, OPTION_FLAGS, OPTION_NAME = 1, 9, 4, 2, 2
APPLICATION = b"taxel"
"""Value of the application option in files of this project."""

COMMENT_MAX = 60_000
"""Size of each comment of a recording's header except the last one, bytes; the length of an option has 16 bits."""

_OPTIONS_END = 0
_INBOUND = 1
_FRAME = re.compile(rb"\0*[^\0]+\0")
"""Bytes of a frame between two delimiters (zero bytes), with all delimiters before them and one behind them."""


def make_option(code: int, value: bytes) -> bytes:
    """Encode an option of a block: code, length and value, padded to a multiple of 4 bytes."""
    return struct.pack("<HH", code, len(value)) + value + bytes(-len(value) % 4)


def make_block(kind: int, content: bytes) -> bytes:
    """Encode a block of a type, such as `PACKET`. content: a multiple of 4 bytes."""
    size = len(content) + 12
    return struct.pack("<II", kind, size) + content + struct.pack("<I", size)


def _make_start(header: dict[str, object], name: str) -> bytes:
    """Encode the section header block and the interface description block at the start of a file.

    header: header of the recording, which becomes one or several comments in the section header block. A comment
    shorter than `COMMENT_MAX` ends the header, so that comments which Wireshark appends are not read as a part of the
    header. name: name of the file for the `CaptureError` of a header that is too long.
    """
    text = json.dumps(header).encode()
    if len(text) > HEADER_MAX:
        raise CaptureError(name, f"cannot be written (its header has more than {HEADER_MAX} bytes)")
    if len(text) % COMMENT_MAX == 0:
        text += b" "  # the last comment must be shorter than `COMMENT_MAX`
    parts = [text[start : start + COMMENT_MAX] for start in range(0, len(text), COMMENT_MAX)]
    options = b"".join(make_option(OPTION_COMMENT, part) for part in parts)
    options += make_option(OPTION_APPLICATION, APPLICATION) + make_option(0, b"")
    # Version 1.0, length of the section unknown (-1); resolution 9: arrival times in units of 10**-9 s.
    section = struct.pack("<IHHq", BYTE_ORDER, 1, 0, -1) + options
    interface = struct.pack("<HHI", LINK_TYPE, 0, 0) + make_option(OPTION_NAME, b"hub")
    interface += make_option(OPTION_RESOLUTION, b"\x09") + make_option(0, b"")
    return make_block(SECTION, section) + make_block(INTERFACE, interface)


class PcapngWriter:
    """Writer of a PCAPNG file, with the interface of `CaptureWriter`. Each packet is a frame of the stream.

    A packet has the arrival time of its last byte. This time is Unix time if the header states the offset
    `epoch_offset_ns` (Unix time minus the time of the recording's clock). Complete packets are passed to the operating
    system at once.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        header: dict[str, object] | None = None,
        overwrite: bool = False,
        output: LiveOutput | None = None,
    ) -> None:
        """Create a PCAPNG file and write its header.

        header: header of the recording, a JSON object; None: {}. output: open output that is written instead of `path`;
        None: a new file, which replaces an existing one with its first packet. Raises `CaptureError` if the file exists
        and `overwrite` is False, if another program writes it, or if the system refuses.
        """
        self.path = Path(path)
        self.records = 0
        self._incomplete = b""  # received bytes behind the last complete frame
        self._time_ns = 0
        offset = (header or {}).get("epoch_offset_ns", 0)
        self._offset_ns = offset if isinstance(offset, int) and offset > 0 else 0
        self._file = LiveRecords(path, _make_start(header or {}, os.fspath(path)), overwrite, output, "packets")

    def write(self, data: bytes, time_ns: int) -> None:
        """Append bytes that arrived at `time_ns` (nanoseconds, not decreasing). Raises `CaptureError`.

        An incomplete frame at the end of the bytes is kept until the next call completes it.
        """
        self._incomplete += data
        self._time_ns = time_ns
        self.records += 1
        end = 0
        blocks = []
        # Behind the last delimiter no frame is complete: there the search would only fail, in quadratic time.
        last = self._incomplete.rfind(b"\0") + 1
        for match in _FRAME.finditer(self._incomplete, 0, last):
            blocks += self._make_packets(match[0])
            end = match.end()
        self._incomplete = self._incomplete[end:]
        if len(self._incomplete) > PIECE_MAX:
            blocks += self._make_packets(self._incomplete)
            self._incomplete = b""
        if blocks:
            self._file.append(b"".join(blocks))

    def _make_packets(self, data: bytes) -> list[bytes]:
        """Encode bytes as enhanced packet blocks with the latest arrival time: one block for each `PIECE_MAX` bytes."""
        time = self._time_ns + self._offset_ns
        blocks = []
        for start in range(0, len(data), PIECE_MAX):
            piece = data[start : start + PIECE_MAX]
            # Interface 0, time (high and low half), and the size in the file and in the stream, which are equal.
            head = struct.pack("<IIIII", 0, time >> 32 & 0xFFFFFFFF, time & 0xFFFFFFFF, len(piece), len(piece))
            options = make_option(OPTION_FLAGS, struct.pack("<I", _INBOUND)) + make_option(_OPTIONS_END, b"")
            blocks.append(make_block(PACKET, head + piece + bytes(-len(piece) % 4) + options))
        return blocks

    def tick(self) -> None:
        """Do nothing: each packet is written at once."""

    def close(self) -> None:
        """Write the bytes behind the last delimiter as a packet, and close the file. A second call has no effect.

        A file without bytes does not replace an existing one. Raises `CaptureError`.
        """
        incomplete, self._incomplete = self._incomplete, b""
        try:
            if incomplete and not self._file.is_closed:
                self._file.append(b"".join(self._make_packets(incomplete)))
        finally:
            self._file.close(has_records=self.records > 0)

    def discard(self) -> None:
        """Close the file; remove a file without bytes."""
        if self.records:
            self.close()
        else:
            self._file.discard()

    def __enter__(self) -> "PcapngWriter":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the file at the end of the `with` block."""
        self.close()
