"""PCAPNG files with the bytes of a hub, for Wireshark and tshark: format and writer.

Format: draft-ietf-opsawg-pcapng. One section, one interface of link type USER0, and one enhanced packet block for each
frame of the stream; the bytes of all packets in their order are the bytes of the hub. The comments of the section,
joined, are the header of the recording, so that a file can be converted back.
"""

import contextlib
import json
import os
import re
import struct
from pathlib import Path
from types import TracebackType
from typing import BinaryIO

from taxel.link.capture import EXISTS
from taxel.link.errors import CaptureError

SUFFIX = ".pcapng"
SECTION, INTERFACE, PACKET = 0x0A0D0D0A, 1, 6
"""Types of the blocks that this format uses."""

BYTE_ORDER = 0x1A2B3C4D
LINK_TYPE = 147
"""LINKTYPE_USER0 (tcpdump.org/linktypes.html): without a registered protocol. The dissector selects it."""

PIECE_MAX = 1 << 15
"""Largest packet, bytes. A longer piece of the stream without a delimiter contains no frame, and is divided."""

OPTION_COMMENT, OPTION_RESOLUTION, OPTION_APPLICATION, OPTION_FLAGS, OPTION_NAME = 1, 9, 4, 2, 2
_COMMENT_MAX = 60_000  # the length of an option has 16 bits
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


def _make_start(header: dict[str, object]) -> bytes:
    """Return the section and interface blocks of a file; header: of the recording, as one or several comments."""
    text = json.dumps(header).encode()
    parts = [text[start : start + _COMMENT_MAX] for start in range(0, len(text), _COMMENT_MAX)]
    options = b"".join(make_option(OPTION_COMMENT, part) for part in parts)
    options += make_option(OPTION_APPLICATION, b"taxel") + make_option(0, b"")
    section = struct.pack("<IHHq", BYTE_ORDER, 1, 0, -1) + options
    interface = struct.pack("<HHI", LINK_TYPE, 0, 0) + make_option(OPTION_NAME, b"hub")
    interface += make_option(OPTION_RESOLUTION, b"\x09") + make_option(0, b"")
    return make_block(SECTION, section) + make_block(INTERFACE, interface)


class PcapngWriter:
    """Writer of a PCAPNG file, with the interface of `CaptureWriter`. Each packet is a frame of the stream.

    A packet has the arrival time of its last byte, as Unix time if the header states the offset (`epoch_offset_ns`).
    Raises `CaptureError` if the file exists and `overwrite` is False, or cannot be written.
    """

    def __init__(
        self, path: str | os.PathLike[str], header: dict[str, object] | None = None, overwrite: bool = False
    ) -> None:
        """Create a PCAPNG file; header: of the recording, a JSON object; None: {}."""
        self.path = Path(path)
        self.records = 0
        self._rest = b""
        self._time_ns = 0
        offset = (header or {}).get("epoch_offset_ns", 0)
        self._offset_ns = offset if isinstance(offset, int) and offset > 0 else 0
        try:
            self._file: BinaryIO = open(self.path, "wb" if overwrite else "xb")  # noqa: SIM115
        except FileExistsError:
            raise CaptureError(str(path), EXISTS) from None
        except OSError as error:
            raise CaptureError(str(path), f"cannot be written ({error.strerror})") from error
        self._append(_make_start(header or {}))

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
            self._append(b"".join(blocks))

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

    def _append(self, blocks: bytes) -> None:
        """Write complete blocks; after a failure the file is truncated to the blocks before. Raises `CaptureError`."""
        end = self._file.tell()
        try:
            self._file.write(blocks)
        except OSError as error:
            self._truncate(end)
            raise self._make_write_error(error) from error

    def _truncate(self, end: int) -> None:
        """Discard everything behind byte `end` of the file, as far as the file system permits."""
        with contextlib.suppress(OSError):
            os.ftruncate(self._file.fileno(), end)

    def _make_write_error(self, error: OSError) -> CaptureError:
        """Return the error for a file that cannot be continued."""
        return CaptureError(str(self.path), f"cannot be written ({error.strerror}); the packets before are complete")

    def tick(self) -> None:
        """Write buffered packets to disk."""
        try:
            self._file.flush()
        except OSError as error:
            raise self._make_write_error(error) from error

    def close(self) -> None:
        """Write the bytes behind the last delimiter as a packet, and close the file."""
        if self._file.closed:
            return
        try:
            if self._rest:
                self._append(b"".join(self._make_packets(self._rest)))
                self._rest = b""
            self._file.close()
        except OSError as error:
            raise self._make_write_error(error) from error

    def __enter__(self) -> "PcapngWriter":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the file at the end of the `with` block."""
        self.close()
