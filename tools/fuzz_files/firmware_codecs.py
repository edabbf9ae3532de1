"""Codecs of firmware files: images with a header, Intel HEX and `.cyacd`. Checksums of changed documents fit."""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass
from typing import Any, Final

_HEADER: Final = struct.Struct("<I8BII8s")
"""Header of an image without its CRC-32, 28 bytes (firmware/bootloader/SPEC.md)."""

_NAMES: Final = (
    "magic", "header_version", "device", "kind", "slot", "major", "minor", "patch", "reserved_a", "length", "vectors",
    "reserved_b",
)  # fmt: skip
_CRC_BYTES: Final = 4


@dataclass(frozen=True)
class Image:
    """Firmware images (.bin): a header with CRC-32, and the program."""

    is_strict: bool = False

    def decode(self, data: bytes) -> Any:
        """Return the fields of the header, and the program.

        Raises ValueError or struct.error for a truncated header.
        """
        fields = dict(zip(_NAMES, _HEADER.unpack_from(data), strict=True))
        if len(data) < _HEADER.size + _CRC_BYTES:
            raise ValueError("truncated")
        return {**fields, "program": data[_HEADER.size + _CRC_BYTES :]}

    def encode(self, document: Any) -> bytes:
        """Return the bytes of the image.

        The CRC is computed unless a mutation has added the key `crc`.
        """
        head = _HEADER.pack(*(document[name] for name in _NAMES))
        program = document["program"]
        covered = program[: max(0, document["length"] - _HEADER.size - _CRC_BYTES)]
        crc = document.get("crc", zlib.crc32(head + covered))
        return head + struct.pack("<I", crc) + bytes(program)


@dataclass(frozen=True)
class IntelHex:
    """Intel HEX files: lines of length, address, type, data and checksum."""

    is_strict: bool = False

    def decode(self, data: bytes) -> Any:
        """Return address, type and data of each line. Raises ValueError for a wrong length or checksum."""
        lines = []
        for line in data.decode("ascii").split():
            raw = bytes.fromhex(line[1:])
            if line[0] != ":" or sum(raw) & 0xFF or len(raw) != raw[0] + 5:
                raise ValueError("a damaged line")
            lines.append({"address": int.from_bytes(raw[1:3], "big"), "type": raw[3], "data": raw[4:-1]})
        return lines

    def encode(self, document: Any) -> bytes:
        """Return the text with correct checksums.

        The key `size` of a line, which a mutation may add, replaces the length of its data.
        """
        texts = []
        for line in document:
            size = line.get("size", len(line["data"]))
            raw = bytes([size]) + line["address"].to_bytes(2, "big") + bytes([line["type"]]) + line["data"]
            texts.append(f":{raw.hex().upper()}{-sum(raw) & 0xFF:02X}\n")
        return "".join(texts).encode()


@dataclass(frozen=True)
class Cyacd:
    """`.cyacd` files: a header line, and a line with number, length, data and checksum of each flash row."""

    is_strict: bool = False

    def decode(self, data: bytes) -> Any:
        """Return the header and the rows. Raises ValueError for a wrong length or checksum."""
        head, *lines = data.decode("ascii").split()
        rows = []
        for line in lines:
            raw = bytes.fromhex(line[1:])
            if line[0] != ":" or sum(raw) & 0xFF or len(raw) != int.from_bytes(raw[3:5], "big") + 6:
                raise ValueError("a damaged line")
            rows.append({"array": raw[0], "row": int.from_bytes(raw[1:3], "big"), "data": raw[5:-1]})
        return {"head": bytes.fromhex(head), "rows": rows}

    def encode(self, document: Any) -> bytes:
        """Return the text with correct checksums.

        The key `size` of a row, which a mutation may add, replaces the length of its data.
        """
        texts = [document["head"].hex().upper() + "\n"]
        for row in document["rows"]:
            size = row.get("size", len(row["data"]))
            raw = bytes([row["array"]]) + row["row"].to_bytes(2, "big") + size.to_bytes(2, "big") + row["data"]
            texts.append(f":{raw.hex().upper()}{-sum(raw) & 0xFF:02X}\n")
        return "".join(texts).encode()
