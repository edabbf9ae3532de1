"""`.cyacd`, the text format of the Cypress bootloader: a header line, then one line for each flash row."""

from typing import Final, NoReturn

from taxel_protocol.bootloader import BOOT_ROW_SIZE, LAYOUTS, BootChecksum
from taxel_tools.errors import FirmwareFileError
from taxel_tools.files.firmware import FirmwareImage
from taxel_tools.files.rows import build_image

HEADER_BYTES: Final = 6
ROW_OVERHEAD: Final = 6
"""Size of array, row, length and sum of a row line, in bytes."""


def read_cyacd(text: str, source: str) -> FirmwareImage:
    """Read the image of a `.cyacd` file. Raises `FirmwareFileError` that names the line.

    Header: silicon id u32, revision u8, checksum kind u8. Row: `:`, array u8, row u16, length u16, data, two's
    complement of the sum of all preceding bytes of the line. Numbers are big-endian hexadecimal. source: name of the
    file.
    """
    lines = text.splitlines()
    silicon_id = _read_header(lines[0] if lines else "", source)
    known_ids = {layout.silicon_id for layout in LAYOUTS.values()}
    if silicon_id not in known_ids:
        _fail_processor(source, known_ids, silicon_id)
    image = build_image(_read_rows(lines, source), source)
    if silicon_id != LAYOUTS[image.device].silicon_id:
        _fail_processor(source, {LAYOUTS[image.device].silicon_id}, silicon_id)
    return image


def _fail_processor(source: str, expected_ids: set[int], silicon_id: int) -> NoReturn:
    """Raise `FirmwareFileError` for a .cyacd file whose silicon id is that of another processor."""
    expected = " or ".join(f"{known_id:08X}" for known_id in sorted(expected_ids))
    _fail(source, "line 1", f"silicon id {expected}", f"{silicon_id:08X}", "the file is for another processor")


def read_cyacd_rows(text: str, source: str) -> tuple[int, dict[int, bytes]]:
    """Read silicon id and rows (by number) of a `.cyacd` file for any part, for example of the original firmware.

    source: name of the file. Raises `FirmwareFileError` that names the line.
    """
    lines = text.splitlines()
    silicon_id = _read_header(lines[0] if lines else "", source)
    return silicon_id, {row: data for row, (data, _) in _read_rows(lines, source).items()}


def _read_rows(lines: list[str], source: str) -> dict[int, tuple[bytes, str]]:
    """Parse the row lines of a .cyacd file. Raises `FirmwareFileError`.

    lines: all lines of the file. Returns (data, line such as "line 12") by row number.
    """
    rows: dict[int, tuple[bytes, str]] = {}
    for number, line in enumerate(lines[1:], start=2):
        if not line.strip():
            continue
        row, data = _parse_row(line.strip(), f"line {number}", source)
        if row in rows:
            _fail(source, f"line {number}", "each row once", f"row {row} a second time (first in {rows[row][1]})")
        rows[row] = data, f"line {number}"
    if not rows:
        _fail(source, "file", "rows after the header", "none", "the file is truncated; copy it again")
    return rows


def write_cyacd(image: FirmwareImage, first_row: int, checksum: BootChecksum = BootChecksum.SUM) -> str:
    """Format the text of a `.cyacd` file for `image`, whose slot begins at the flash row `first_row`."""
    lines = [f"{LAYOUTS[image.device].silicon_id:08X}00{checksum:02X}"]
    for index, data in enumerate(image.rows()):
        body = bytes([0]) + (first_row + index).to_bytes(2, "big") + len(data).to_bytes(2, "big") + data
        lines.append(":" + (body + bytes([-sum(body) & 0xFF])).hex().upper())
    return "\n".join(lines) + "\n"


def _fail(
    source: str, location: str, expected: str, found: str, remedy: str = "the file is damaged; copy it again"
) -> NoReturn:
    """Raise `FirmwareFileError` for a .cyacd file.

    source: name of the file. location: line or field. expected, found: expected and found value. remedy: what the user
    can do.
    """
    raise FirmwareFileError(source, location, expected, found, remedy)


def _parse_hex(digits: str, location: str, source: str) -> bytes:
    """Decode a string of hexadecimal digits. Raises `FirmwareFileError` with the position of a wrong digit.

    location: line of the file, such as "line 1"; source: name of the file; both for the message.
    """
    if len(digits) % 2:
        _fail(source, location, "two hexadecimal digits for each byte", f"{len(digits)} digits")
    for i, digit in enumerate(digits):
        if digit not in "0123456789abcdefABCDEF":
            _fail(source, location, "hexadecimal digits", f"{digit!r} at digit {i + 1}")
    return bytes.fromhex(digits)


def _read_header(line: str, source: str) -> int:
    """Return the silicon id from the first line of a .cyacd file.

    Bytes of the line: 0 to 3 silicon id, 4 revision, 5 checksum kind. source: name of the file. Raises
    `FirmwareFileError` if the line is no header, or if its checksum kind is unknown.
    """
    header = _parse_hex(line.strip(), "line 1", source)
    if len(header) != HEADER_BYTES:
        _fail(source, "line 1", "a header of 12 digits", f"{2 * len(header)}", "is this a .cyacd file?")
    if header[5] not in (BootChecksum.SUM, BootChecksum.CRC):
        _fail(source, "line 1", "checksum kind 0 or 1", str(header[5]))
    return int.from_bytes(header[:4], "big")


def _parse_row(line: str, location: str, source: str) -> tuple[int, bytes]:
    """Parse one line of a .cyacd file: number and data of a flash row.

    Bytes of a line: 0 flash array, 1 and 2 number of the row, 3 and 4 length, then the data and a checksum, the two's
    complement of the sum of all bytes before it.

    location: line of the file, source: name of the file, both for the message. Raises `FirmwareFileError` for a damaged
    line.
    """
    if not line.startswith(":"):
        _fail(source, location, "a row that begins with ':'", repr(line[:1]))
    record = _parse_hex(line[1:], location, source)
    if len(record) < ROW_OVERHEAD:
        _fail(
            source,
            location,
            f"at least {ROW_OVERHEAD} bytes",
            f"{len(record)}",
            "the line is truncated; copy the file again",
        )
    length = int.from_bytes(record[3:5], "big")
    if len(record) != ROW_OVERHEAD + length:
        _fail(
            source,
            location,
            f"{length} bytes of data",
            f"{len(record) - ROW_OVERHEAD}",
            "the line is truncated; copy the file again",
        )
    expected = -sum(record[:-1]) & 0xFF
    if record[-1] != expected:
        _fail(source, location, f"checksum {expected:02X}", f"{record[-1]:02X}")
    if record[0]:
        _fail(source, location, "flash array 0", str(record[0]), "the file is for another processor")
    if length != BOOT_ROW_SIZE:
        _fail(source, location, f"rows of {BOOT_ROW_SIZE} bytes", f"{length}", "the file is for another processor")
    return int.from_bytes(record[1:3], "big"), record[5:-1]
