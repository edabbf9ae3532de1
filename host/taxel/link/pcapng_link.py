"""Reader of PCAPNG files with the bytes of a hub, as a link whose bytes come from the file instead of a port."""

import os
import struct
from collections.abc import Iterator
from typing import Any, NamedTuple

from taxel.input_files import TextError, open_regular_file, parse_json
from taxel.link.base import Chunk
from taxel.link.capture import HEADER_MAX
from taxel.link.errors import CaptureError
from taxel.link.pcapng import (
    APPLICATION,
    BYTE_ORDER,
    COMMENT_MAX,
    INTERFACE,
    LINK_TYPE,
    OPTION_APPLICATION,
    OPTION_COMMENT,
    OPTION_RESOLUTION,
    PACKET,
    SECTION,
)
from taxel.link.recording_header import check_recording_header

BLOCK_MAX = 1 << 24
"""Largest block that the reader accepts, bytes: Wireshark's own limit for a packet is 256 KiB."""

TIME_NS_MAX = 2**63
"""Limit of the time of a packet, Unix nanoseconds: the year 2262."""

_SIGNATURE = struct.pack("<I", SECTION)  # the same in both byte orders
_SECTION_HEAD, _INTERFACE_HEAD, _PACKET_HEAD = 16, 8, 20


class _Interface(NamedTuple):
    """An interface of the file. unit: length of a time unit in nanoseconds, as (numerator, denominator)."""

    link_type: int
    unit: tuple[int, int]


def is_pcapng(path: str | os.PathLike[str]) -> bool:
    """Whether a file begins with a PCAPNG section header block; False for a file that cannot be read."""
    try:
        with open_regular_file(path) as file:
            return file.read(len(_SIGNATURE)) == _SIGNATURE
    except OSError:
        return False


class PcapngLink:
    """A PCAPNG file as a link: each `read` returns the bytes of the next packet without waiting.

    Raises `CaptureError` if the file is no PCAPNG file, or contains packets of another link type. A truncated file
    raises `CaptureError` after all complete packets.
    """

    is_real_time = False
    is_recorded = True
    has_flow_control = False

    def __init__(self, path: str | os.PathLike[str]) -> None:
        """Open a PCAPNG file, and set `header` to the recording's header in the comments of the file.

        Without such comments, `header` is {}. `has_arrivals` is False if the header states that the arrival times are
        not real.
        """
        self.name = os.fspath(path)
        self.header: dict[str, Any] = {}
        self._order = "<"
        self._block_offset = 0
        self._interfaces: list[_Interface] = []
        try:
            self._file = open_regular_file(path)
        except OSError as error:
            raise CaptureError(self.name, f"cannot be read ({error.strerror})") from error
        try:
            self._read_start()
        except BaseException:
            self._file.close()
            raise
        self.has_arrivals = self.header.get("clock") != "hub"
        baud = self.header.get("baud", 1e6)
        self.baud = float(baud) if isinstance(baud, int | float) and 1e3 <= baud <= 1e9 else 1e6
        offset = self.header.get("epoch_offset_ns", 0)
        self._offset_ns = offset if isinstance(offset, int) and offset > 0 else 0

    def _read_start(self) -> None:
        """Read the section header block at the start of the file, and the header of the recording in its comments."""
        if self._file.peek(len(_SIGNATURE))[: len(_SIGNATURE)] != _SIGNATURE:
            raise CaptureError(self.name, "is not a PCAPNG file (it does not begin with a section)")
        kind, content = self._read_block()
        assert kind == SECTION
        self._begin_section(content)
        self.header = self._read_header(list(self._iterate_options(content[_SECTION_HEAD:])))

    def _read_header(self, options: list[tuple[int, bytes]]) -> dict[str, Any]:
        """Return the header of the recording from the options of the section header block; {} without a header.

        options: (code, value). The first comments, up to one shorter than `COMMENT_MAX`, are the header if the
        application option is `taxel` or if they begin like a JSON object. Wireshark replaces the application option
        when it saves a file, and other programs write comments, too. Raises CaptureError for a damaged header.
        """
        text = b""
        for comment in (value for code, value in options if code == OPTION_COMMENT):
            text += comment
            if len(comment) < COMMENT_MAX or len(text) > HEADER_MAX:
                break
        if not text.startswith(b"{") and (OPTION_APPLICATION, APPLICATION) not in options:
            return {}
        try:
            return check_recording_header(parse_json(text, HEADER_MAX + 1))
        except TextError as error:
            raise CaptureError(self.name, f"has a damaged header ({error})") from None

    def _make_damage_error(self, offset: int, is_truncated: bool = False) -> CaptureError:
        """Create the error for the block at byte `offset`. is_truncated: the file ends within the block."""
        problem = "is cut short in a block" if is_truncated else "is damaged"
        return CaptureError(self.name, f"{problem} at byte {offset}; everything before it was read")

    def _read_block(self) -> tuple[int, bytes]:
        """Read the next block; return its type and content. Raises EOFError at the end, CaptureError for damage.

        A block consists of type, size, content and a copy of the size. The size counts all of these bytes, at least 12.
        """
        offset = self._block_offset = self._file.tell()
        head = self._file.read(8)
        if not head:
            raise EOFError
        if len(head) < 8:
            raise self._make_damage_error(offset, is_truncated=True)
        if head[:4] == _SIGNATURE:
            self._order = self._find_order(offset)
        kind, size = struct.unpack(f"{self._order}II", head)
        if size < 12 or size > BLOCK_MAX or size % 4:
            raise self._make_damage_error(offset)
        content = self._file.read(size - 8)
        if len(content) < size - 8:
            raise self._make_damage_error(offset, is_truncated=True)
        if struct.unpack(f"{self._order}I", content[-4:])[0] != size:
            raise self._make_damage_error(offset)
        return kind, content[:-4]

    def _find_order(self, offset: int) -> str:
        """Return the byte order, "<" or ">" as for `struct`, of the section whose first 8 bytes were just read.

        offset: start of the block in the file. Raises CaptureError for a damaged byte-order magic.
        """
        magic = self._file.peek(4)[:4]
        for order in "<>":
            if magic == struct.pack(f"{order}I", BYTE_ORDER):
                return order
        raise self._make_damage_error(offset)

    def _begin_section(self, content: bytes) -> None:
        """Check a section header block, and remove the interfaces of the previous section. Raises CaptureError."""
        if len(content) < _SECTION_HEAD:
            raise self._make_damage_error(self._block_offset)
        major = struct.unpack_from(f"{self._order}H", content, 4)[0]
        if major != 1:
            raise CaptureError(self.name, f"is a PCAPNG file of version {major}; this program reads version 1")
        self._interfaces = []

    def _iterate_options(self, data: bytes) -> Iterator[tuple[int, bytes]]:
        """Yield (code, value) of each option in the option list of a block.

        Values are padded to a multiple of 4 bytes; the code 0 ends the list.
        """
        position = 0
        while position + 4 <= len(data):
            code, size = struct.unpack_from(f"{self._order}HH", data, position)
            if code == 0:
                return
            yield code, data[position + 4 : position + 4 + size]
            position += 4 + size + -size % 4

    def _add_interface(self, content: bytes) -> None:
        """Store the link type and the time unit of an interface description block. Raises CaptureError."""
        if len(content) < _INTERFACE_HEAD:
            raise self._make_damage_error(self._block_offset)
        options = dict(self._iterate_options(content[_INTERFACE_HEAD:]))
        # The time unit is 10**-n s, or 2**-n s if the highest bit is set; microseconds without the option.
        resolution = options.get(OPTION_RESOLUTION, b"\x06")[:1] or b"\x06"
        exponent = resolution[0] & 0x7F
        unit = 1 << exponent if resolution[0] & 0x80 else 10**exponent
        self._interfaces.append(_Interface(struct.unpack_from(f"{self._order}H", content)[0], (1_000_000_000, unit)))

    def read(self, timeout_s: float = 0.0) -> Chunk:
        """Return the bytes of the next packet and their arrival time.

        The call does not wait; `timeout_s` has no effect. Raises EOFError at the end of a complete file, `CaptureError`
        for a damaged block or a packet of another link type.
        """
        while True:
            kind, content = self._read_block()
            if kind == SECTION:
                self._begin_section(content)
            elif kind == INTERFACE:
                self._add_interface(content)
            elif kind == PACKET:
                chunk = self._take_packet(content)
                if chunk.data:
                    return chunk

    def _take_packet(self, content: bytes) -> Chunk:
        """Return the bytes and the time of an enhanced packet block, on the clock of the recording."""
        if len(content) < _PACKET_HEAD:
            raise self._make_damage_error(self._block_offset)
        interface, high, low, size = struct.unpack_from(f"{self._order}IIII", content)
        if interface >= len(self._interfaces) or size > len(content) - _PACKET_HEAD:
            raise self._make_damage_error(self._block_offset)
        link_type, (numerator, unit) = self._interfaces[interface]
        if link_type != LINK_TYPE:
            problem = f"has packets of link type {link_type}; expected {LINK_TYPE} (USER0) with the bytes of a hub"
            raise CaptureError(self.name, problem)
        time_ns = (high << 32 | low) * numerator // unit
        if time_ns >= TIME_NS_MAX:
            raise self._make_damage_error(self._block_offset)
        return Chunk(content[_PACKET_HEAD : _PACKET_HEAD + size], max(time_ns - self._offset_ns, 0))

    def write(self, data: bytes) -> None:
        """Raise `CaptureError`: a recording accepts no commands."""
        raise CaptureError(self.name, "is a recording; it takes no commands")

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __enter__(self) -> "PcapngLink":
        return self

    def __exit__(self, *_: object) -> None:
        """Close the file at the end of the `with` block."""
        self.close()
