"""Intel HEX (Intel 1988, "Hexadecimal Object File Format Specification"): records of bytes at addresses."""

from typing import Final, NoReturn

from taxel_protocol.bootloader import BOOT_ROW_SIZE, LAYOUTS
from taxel_tools.errors import FirmwareFileError
from taxel_tools.files.firmware import FirmwareImage
from taxel_tools.files.rows import build_image

FLASH_SIZE: Final = max(layout.row_count for layout in LAYOUTS.values()) * BOOT_ROW_SIZE
"""Bytes of the largest flash."""
DATA, END, SEGMENT, SEGMENT_START, LINEAR, LINEAR_START = range(6)
RECORD_OVERHEAD: Final = 5
"""Size of length, address, type and checksum of a record, in bytes."""


Rows = dict[int, tuple[bytes, str]]
"""Flash rows that a file sets, by number: their bytes, and the line that sets the first of these bytes."""


def read_intel_hex(text: str, source: str) -> FirmwareImage:
    """Read the image of an Intel HEX file; bytes without a record are 00, as in erased flash.

    Raises `FirmwareFileError`.
    """
    return build_image(read_intel_hex_rows(text, source), source)


def read_intel_hex_rows(text: str, source: str) -> Rows:
    """Read all flash rows that an Intel HEX file sets, in ascending order. Raises `FirmwareFileError`.

    source: name of the file. Bytes without a record are 00. Returns (bytes, first line such as "line 12") by row. Two
    types of records set the base of the addresses that follow: a segment record in units of 16 bytes, and a linear
    record as the upper 16 bits of the address.
    """
    flash = bytearray(FLASH_SIZE)
    row_sources: dict[int, str] = {}
    is_set = bytearray(FLASH_SIZE)
    base, has_end = 0, False
    for number, line in enumerate(text.splitlines(), start=1):
        location = f"line {number}"
        if not line.strip():
            continue
        if has_end:
            _fail(source, location, "nothing after the end record", "another record")
        kind, offset, data = _parse_record(line.strip(), location, source)
        if kind == DATA:
            _store_data(flash, is_set, row_sources, base + offset, data, location, source)
        elif kind == END:
            has_end = True
        elif kind in (SEGMENT, LINEAR):
            base = int.from_bytes(data, "big") << (4 if kind == SEGMENT else 16)
        elif kind not in (SEGMENT_START, LINEAR_START):
            _fail(source, location, "record type 0 to 5", str(kind))
    if not has_end:
        _fail(source, "file", "an end record (:00000001FF)", "none", "the file is truncated; copy it again")
    return {
        row: (bytes(flash[row * BOOT_ROW_SIZE : (row + 1) * BOOT_ROW_SIZE]), location)
        for row, location in sorted(row_sources.items())
    }


def write_intel_hex(data: bytes, address: int) -> str:
    """Format the text of an Intel HEX file that places `data` at `address`, below 64 KiB."""
    lines = []
    for begin in range(0, len(data), 16):
        chunk = data[begin : begin + 16]
        record = bytes([len(chunk)]) + (address + begin).to_bytes(2, "big") + bytes([DATA]) + chunk
        lines.append(":" + (record + bytes([-sum(record) & 0xFF])).hex().upper())
    return "\n".join([*lines, ":00000001FF"]) + "\n"


def _fail(
    source: str, location: str, expected: str, found: str, remedy: str = "the file is damaged; copy it again"
) -> NoReturn:
    """Raise `FirmwareFileError` for an Intel HEX file.

    source: name of the file. location: line or field. expected, found: expected and found value. remedy: what the user
    can do.
    """
    raise FirmwareFileError(source, location, expected, found, remedy)


def _parse_record(line: str, location: str, source: str) -> tuple[int, int, bytes]:
    """Parse one line of an Intel HEX file: type of the record, 16-bit address, data.

    Bytes of a record: 0 number of data bytes, 1 and 2 address, 3 type, then the data and a checksum, the two's
    complement of the sum of all bytes before it.

    location: line, such as "line 12"; source: name of the file. Raises `FirmwareFileError` for a damaged line.
    """
    if not line.startswith(":"):
        _fail(source, location, "a record that begins with ':'", repr(line[:1]))
    try:
        record = bytes.fromhex(line[1:])
    except ValueError:
        _fail(source, location, "two hexadecimal digits for each byte", "other characters")
    if len(record) < RECORD_OVERHEAD or len(record) != RECORD_OVERHEAD + record[0]:
        stated_size = record[0] if record else 0
        _fail(
            source,
            location,
            f"{stated_size} bytes of data",
            f"{max(len(record) - RECORD_OVERHEAD, 0)}",
            "the line is truncated",
        )
    expected = -sum(record[:-1]) & 0xFF
    if record[-1] != expected:
        _fail(source, location, f"checksum {expected:02X}", f"{record[-1]:02X}")
    if record[3] in (SEGMENT, LINEAR) and record[0] != 2:
        _fail(source, location, "2 bytes of address", str(record[0]))
    return record[3], int.from_bytes(record[1:3], "big"), record[4:-1]


def _store_data(
    flash: bytearray,
    is_set: bytearray,
    row_sources: dict[int, str],
    address: int,
    data: bytes,
    location: str,
    source: str,
) -> None:
    """Store a data record of an Intel HEX file in the flash image `flash`.

    Updates is_set (1 for each byte of the flash that a record has set) and row_sources (for each row, the first line
    that sets a byte of the row). Raises `FirmwareFileError` for a byte that is set twice or is outside the flash.
    """
    end = address + len(data)
    if end > FLASH_SIZE:
        _fail(
            source,
            location,
            f"addresses below 0x{FLASH_SIZE:X}",
            f"0x{address:X}, beyond the flash",
            "export the application without the programmer's sections",
        )
    if any(is_set[address:end]):
        _fail(source, location, "each byte once", f"address 0x{address:X} a second time")
    flash[address:end] = data
    is_set[address:end] = b"\x01" * len(data)
    for row in range(address // BOOT_ROW_SIZE, -(-end // BOOT_ROW_SIZE)):
        row_sources.setdefault(row, location)
