"""PCAPNG files with the bytes of a hub, for Wireshark and tshark: format and writer.

Format: draft-ietf-opsawg-pcapng. One section, one interface of link type USER0, and one enhanced packet block for each
frame of the stream; the bytes of all packets in their order are the bytes of the hub. The first comments of the section
are the header of the recording, so that a file can be converted back.
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
"""Types of the blocks that this format uses."""

BYTE_ORDER = 0x1A2B3C4D
LINK_TYPE = 147
"""LINKTYPE_USER0 (tcpdump.org/linktypes.html): without a registered protocol. The dissector selects it."""

PIECE_MAX = 1 << 15
"""Largest packet, bytes. A longer piece of the stream without a delimiter contains no frame, and is divided."""

OPTION_COMMENT, OPTION_RESOLUTION, OPTION_APPLICATION, OPTION_FLAGS, OPTION_NAME = 1, 9, 4, 2, 2
APPLICATION = b"taxel"
"""Value of the application option in files of this project."""

COMMENT_MAX = 60_000
"""Size of each comment of a header but the last one, bytes; the length of an option has 16 bits."""

_INBOUND = 1
_FRAME = re.compile(rb"\0*[^\0]+\0")
"""Delimiters, the bytes between two delimiters, and the delimiter behind them: the last byte completes a frame."""


def make_option(code: int, value: bytes) -> bytes:
    """Return an option of a block: code, length and value, padded to a multiple of 4 bytes."""
    return struct.pack("<HH", code, len(value)) + value + bytes(-len(value) % 4)


def make_block(kind: int, content: bytes) -> bytes:
    """Return a block with this content, which has a multiple of 4 bytes."""
    size = len(content) + 12
    return struct.pack("<II", kind, size) + content + struct.pack("<I", size)


def _make_start(header: dict[str, object], name: str) -> bytes:
    """Return the section and interface blocks of a file; header: of the recording, as one or several comments.

    The last comment is shorter than the others, so that comments which Wireshark appends do not belong to the header.
    name: of the file, for the `CaptureError` of a header that is too long.
    """
    text = json.dumps(header).encode()
    if len(text) > HEADER_MAX:
        raise CaptureError(name, f"cannot be written (its header has more than {HEADER_MAX} bytes)")
    if len(text) % COMMENT_MAX == 0:
        text += b" "
    parts = [text[start : start + COMMENT_MAX] for start in range(0, len(text), COMMENT_MAX)]
    options = b"".join(make_option(OPTION_COMMENT, part) for part in parts)
    options += make_option(OPTION_APPLICATION, APPLICATION) + make_option(0, b"")
    section = struct.pack("<IHHq", BYTE_ORDER, 1, 0, -1) + options
    interface = struct.pack("<HHI", LINK_TYPE, 0, 0) + make_option(OPTION_NAME, b"hub")
    interface += make_option(OPTION_RESOLUTION, b"\x09") + make_option(0, b"")
    return make_block(SECTION, section) + make_block(INTERFACE, interface)


class PcapngWriter:
    """Writer of a PCAPNG file, with the interface of `CaptureWriter`. Each packet is a frame of the stream.

    A packet has the arrival time of its last byte, as Unix time if the header states the offset (`epoch_offset_ns`).
    Complete packets are passed to the operating system at once. Raises `CaptureError` if the file exists and
    `overwrite` is False, if another program writes it, or if the system refuses.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        header: dict[str, object] | None = None,
        overwrite: bool = False,
        output: LiveOutput | None = None,
    ) -> None:
        """Create a PCAPNG file and write its header.

        header: of the recording, a JSON object; None: {}. output: open output that is written instead of `path`; None:
        a new file, which replaces an existing one with its first packet.
        """
        self.path = Path(path)
        self.records = 0
        self._rest = b""
        self._time_ns = 0
        offset = (header or {}).get("epoch_offset_ns", 0)
        self._offset_ns = offset if isinstance(offset, int) and offset > 0 else 0
        self._file = LiveRecords(path, _make_start(header or {}, os.fspath(path)), overwrite, output, "packets")

    def write(self, data: bytes, time_ns: int) -> None:
        """Append bytes that arrived at `time_ns` (nanoseconds, not decreasing)."""
        self._rest += data
        self._time_ns = time_ns
        self.records += 1
        end = 0
        blocks = []
        last = self._rest.rfind(b"\0") + 1  # behind it, the pattern would search in vain, in quadratic time
        for match in _FRAME.finditer(self._rest, 0, last):
            blocks += self._make_packets(match[0])
            end = match.end()
        self._rest = self._rest[end:]
        if len(self._rest) > PIECE_MAX:
            blocks += self._make_packets(self._rest)
            self._rest = b""
        if blocks:
            self._file.append(b"".join(blocks))

    def _make_packets(self, data: bytes) -> list[bytes]:
        """Return the packet blocks with these bytes: one, or several for a piece longer than any frame."""
        time = self._time_ns + self._offset_ns
        blocks = []
        for start in range(0, len(data), PIECE_MAX):
            piece = data[start : start + PIECE_MAX]
            head = struct.pack("<IIIII", 0, time >> 32 & 0xFFFFFFFF, time & 0xFFFFFFFF, len(piece), len(piece))
            options = make_option(OPTION_FLAGS, struct.pack("<I", _INBOUND)) + make_option(0, b"")
            blocks.append(make_block(PACKET, head + piece + bytes(-len(piece) % 4) + options))
        return blocks

    def tick(self) -> None:
        """Do nothing: each packet is written at once."""

    def close(self) -> None:
        """Write the bytes behind the last delimiter as a packet, and close the file. A second call has no effect.

        A file without bytes does not replace an existing one. Raises `CaptureError`.
        """
        rest, self._rest = self._rest, b""
        try:
            if rest and not self._file.is_closed:
                self._file.append(b"".join(self._make_packets(rest)))
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
