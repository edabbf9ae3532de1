"""Intel HEX (Intel 1988, "Hexadecimal Object File Format Specification"): records of bytes at addresses."""

from __future__ import annotations

from typing import Final, NoReturn

from taxel_protocol.bootloader import BOOT_ROW_COUNT, BOOT_ROW_SIZE
from taxel_tools.errors import FirmwareFileError
from taxel_tools.files.firmware import FirmwareImage
from taxel_tools.files.rows import image_of_rows

FLASH_SIZE: Final = BOOT_ROW_COUNT * BOOT_ROW_SIZE
DATA, END, SEGMENT, SEGMENT_START, LINEAR, LINEAR_START = range(6)
OVERHEAD: Final = 5
"""Length, address, type and checksum of a record, in bytes."""


Rows = dict[int, tuple[bytes, str]]
"""Flash rows that a file sets, by number: their bytes, and the line that sets the first of them."""


def read_intel_hex(text: str, source: str) -> FirmwareImage:
    """The image of an Intel HEX file; what no record names is 00, as in erased flash. Raises `FirmwareFileError`."""
    return image_of_rows(rows_of_intel_hex(text, source), source)


def rows_of_intel_hex(text: str, source: str) -> Rows:
    """All rows that an Intel HEX file sets, of whatever part of the flash. Raises `FirmwareFileError`."""
    flash = bytearray(FLASH_SIZE)
    set_in: dict[int, str] = {}
    taken = bytearray(FLASH_SIZE)
    base, has_end = 0, False
    for number, line in enumerate(text.splitlines(), start=1):
        where = f"line {number}"
        if not line.strip():
            continue
        if has_end:
            _fail(source, where, "nothing after the end record", "another record")
        kind, offset, data = _record(line.strip(), where, source)
        if kind == DATA:
            _place(flash, taken, set_in, base + offset, data, where, source)
        elif kind == END:
            has_end = True
        elif kind in (SEGMENT, LINEAR):
            base = int.from_bytes(data, "big") << (4 if kind == SEGMENT else 16)
        elif kind not in (SEGMENT_START, LINEAR_START):
            _fail(source, where, "record type 0 to 5", str(kind))
    if not has_end:
        _fail(source, "file", "an end record (:00000001FF)", "none", "the file is cut short; copy it anew")
    return {
        row: (bytes(flash[row * BOOT_ROW_SIZE : (row + 1) * BOOT_ROW_SIZE]), where)
        for row, where in sorted(set_in.items())
    }


def write_intel_hex(data: bytes, address: int) -> str:
    """The text of a file that puts `data` at `address`, below 64 KiB."""
    lines = []
    for begin in range(0, len(data), 16):
        piece = data[begin : begin + 16]
        record = bytes([len(piece)]) + (address + begin).to_bytes(2, "big") + bytes([DATA]) + piece
        lines.append(":" + (record + bytes([-sum(record) & 0xFF])).hex().upper())
    return "\n".join([*lines, ":00000001FF"]) + "\n"


def _fail(
    source: str, where: str, expected: str, found: str, remedy: str = "the file is damaged; copy it anew"
) -> NoReturn:
    raise FirmwareFileError(source, where, expected, found, remedy)


def _record(line: str, where: str, source: str) -> tuple[int, int, bytes]:
    """(type, address, data) of a line."""
    if not line.startswith(":"):
        _fail(source, where, "a record that begins with ':'", repr(line[:1]))
    try:
        record = bytes.fromhex(line[1:])
    except ValueError:
        _fail(source, where, "hexadecimal digits, two a byte", "others")
    if len(record) < OVERHEAD or len(record) != OVERHEAD + record[0]:
        claimed = record[0] if record else 0
        _fail(source, where, f"{claimed} bytes of data", f"{max(len(record) - OVERHEAD, 0)}", "the line is cut short")
    expected = -sum(record[:-1]) & 0xFF
    if record[-1] != expected:
        _fail(source, where, f"checksum {expected:02X}", f"{record[-1]:02X}")
    if record[3] in (SEGMENT, LINEAR) and record[0] != 2:
        _fail(source, where, "2 bytes of address", str(record[0]))
    return record[3], int.from_bytes(record[1:3], "big"), record[4:-1]


def _place(
    flash: bytearray, taken: bytearray, set_in: dict[int, str], address: int, data: bytes, where: str, source: str
) -> None:
    end = address + len(data)
    if end > FLASH_SIZE:
        _fail(
            source,
            where,
            f"addresses below 0x{FLASH_SIZE:X}",
            f"0x{address:X}, beyond the flash",
            "give the application's file without the programmer's sections",
        )
    if any(taken[address:end]):
        _fail(source, where, "each byte once", f"address 0x{address:X} again")
    flash[address:end] = data
    taken[address:end] = b"\x01" * len(data)
    for row in range(address // BOOT_ROW_SIZE, -(-end // BOOT_ROW_SIZE)):
        set_in.setdefault(row, where)
