"""Reader of linked images (ELF): loaded bytes, sections and symbols."""

import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NoReturn

from taxel_tools.errors import FirmwareFileError

HEADER: Final = struct.Struct("<16sHHIIIIIHHHHHH")
PROGRAM_HEADER: Final = struct.Struct("<IIIIIIII")
SECTION_HEADER: Final = struct.Struct("<IIIIIIIIII")
SYMBOL: Final = struct.Struct("<IIIBBH")
IDENTIFICATION: Final = b"\x7fELF\x01\x01"  # 32 bits, little-endian
EXECUTABLE, ARM = 2, 40
LOAD: Final = 1
SYMBOL_TABLE: Final = 2
FUNCTION: Final = 2


@dataclass(frozen=True)
class Section:
    """A section in memory; `size` in bytes."""

    name: str
    address: int
    size: int


@dataclass(frozen=True)
class Function:
    """A function of `size` bytes at `address`, without the Thumb bit."""

    name: str
    address: int
    size: int


@dataclass(frozen=True)
class LinkedImage:
    """A linked image. content: bytes from `address` on, gaps filled with zeros. symbols: values by name, functions
    included.
    """

    path: str
    address: int
    content: bytes
    sections: tuple[Section, ...]
    symbols: dict[str, int]
    functions: tuple[Function, ...]

    def symbol(self, name: str) -> int:
        """Return the value of a symbol of the linked image. Raises FirmwareFileError if it is missing."""
        if name not in self.symbols:
            _fail(self.path, f"symbol {name}", "one", "none", "link it with image.ld.in")
        return self.symbols[name]


def _fail(path: str, field: str, expected: str, found: str, remedy: str = "rebuild it") -> NoReturn:
    """Raise `FirmwareFileError` for a defect of an ELF file."""
    raise FirmwareFileError(path, field, expected, found, remedy)


def read_linked_image(path: Path) -> LinkedImage:
    """Read a linked image from an ELF file.

    Raises FirmwareFileError with a one-line message for a damaged file, OSError. The code uses header fields by their
    index:

    - ELF header: 1 type, 2 machine; of the section headers: 6 offset, 11 size of one, 12 number, 13 index of the
      section with the section names.
    - Section header: 0 offset of the name, 2 flags (bit 1: in memory), 3 address, 4 offset in the file, 5 size.
    """
    data = path.read_bytes()
    if not data.startswith(IDENTIFICATION) or len(data) < HEADER.size:
        _fail(str(path), "file", "a 32-bit little-endian ELF", repr(data[:6]), "pass the linker's output")
    header = HEADER.unpack_from(data)
    if header[1] != EXECUTABLE or header[2] != ARM:
        _fail(
            str(path),
            "file",
            "an executable for ARM",
            f"type {header[1]}, machine {header[2]}",
            "use arm-none-eabi-gcc",
        )
    try:
        address, content = _read_flash(str(path), data, header)
        tables = [SECTION_HEADER.unpack_from(data, header[6] + place * header[11]) for place in range(header[12])]
        names = tables[header[13]]
        symbols, functions = _read_symbols(data, tables)
        return LinkedImage(
            str(path),
            address,
            content,
            tuple(
                Section(_read_text(data, names[4] + table[0]), table[3], table[5]) for table in tables if table[2] & 2
            ),
            symbols,
            functions,
        )
    except (struct.error, IndexError, UnicodeDecodeError):
        _fail(str(path), "file", "complete tables", "a table beyond the end of the file")


def _read_text(data: bytes, offset: int) -> str:
    """Return the string in the bytes of an ELF file from `offset` to the next zero byte; "" if there is none."""
    return data[offset : data.index(0, offset)].decode("ascii") if 0 in data[offset:] else ""


def _read_flash(path: str, data: bytes, header: tuple[int, ...]) -> tuple[int, bytes]:
    """Return the start address and the bytes of everything that a linked image loads into flash.

    header: fields of the ELF header (5 offset, 9 size and 10 number of the program headers). Gaps between the loaded
    pieces become zeros. All pieces must lie within 64 KiB; addresses beyond are not flash.
    """
    pieces: list[tuple[int, bytes]] = []
    for place in range(header[10]):
        segment = PROGRAM_HEADER.unpack_from(data, header[5] + place * header[9])
        kind, offset, _, address, size = segment[:5]
        if kind == LOAD and size:
            if offset + size > len(data):
                _fail(path, f"segment {place}", f"{size} bytes", f"{len(data) - offset}")
            pieces.append((address, data[offset : offset + size]))
    if not pieces:
        _fail(path, "file", "bytes for the flash", "none")
    pieces.sort()
    begin = pieces[0][0]
    content = bytearray()
    for address, piece in pieces:
        if address < begin + len(content):
            _fail(path, "segments", "each address once", f"0x{address:X} again")
        if address > begin + 0x10000:
            _fail(path, "segments", "flash alone", f"address 0x{address:X}")
        content += bytes(address - begin - len(content)) + piece
    return begin, bytes(content)


def _read_symbols(data: bytes, tables: list[tuple[int, ...]]) -> tuple[dict[str, int], tuple[Function, ...]]:
    """Return the values of all symbols of an ELF file by name, and its functions in ascending order of address.

    tables: fields of each section header (1 type, 4 offset, 5 size, 6 section with the names). Names that begin with $
    mark code and data for disassemblers and are omitted. The lowest bit of a function's value is the Thumb bit.
    """
    values: dict[str, int] = {}
    functions: list[Function] = []
    for table in tables:
        if table[1] != SYMBOL_TABLE:
            continue
        names = tables[table[6]][4]
        for offset in range(table[4], table[4] + table[5], SYMBOL.size):
            name, value, size, info, _, _ = SYMBOL.unpack_from(data, offset)
            text = _read_text(data, names + name)
            if not text or text.startswith("$"):
                continue
            values[text] = value
            if info & 0xF == FUNCTION:
                functions.append(Function(text, value & ~1, size))
    return values, tuple(sorted(functions, key=lambda function: (function.address, function.name)))
