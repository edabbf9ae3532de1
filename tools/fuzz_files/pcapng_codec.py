"""Codec of PCAPNG files with the bytes of a hub."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Any, Final

from fuzz_files.text_codecs import Json

_SECTION: Final = 0x0A0D0D0A
_INTERFACE: Final = 1
_PACKET: Final = 6
_HEADS: Final = {_SECTION: struct.Struct("<IHHq"), _INTERFACE: struct.Struct("<HHI"), _PACKET: struct.Struct("<IIIII")}
_COMMENT: Final = 1


@dataclass(frozen=True)
class Pcapng:
    """PCAPNG files (draft-ietf-opsawg-pcapng) in little endian: blocks of a fixed head, data and options.

    The first comment of a section is the recording's header in JSON.
    """

    is_strict: bool = False

    def decode(self, data: bytes) -> Any:
        """Return the blocks: kind, values of the head, options, and the data of a packet.

        Raises ValueError for a truncated block.
        """
        blocks, place = [], 0
        while place < len(data):
            kind, size = struct.unpack_from("<II", data, place)
            body = data[place + 8 : place + size - 4]
            if size < 12 or len(body) != size - 12 or data[place + size - 4 : place + size] != struct.pack("<I", size):
                raise ValueError("truncated")
            blocks.append(_split_block(kind, body))
            place += size
        return blocks

    def encode(self, document: Any) -> bytes:
        """Return the bytes of the file.

        The keys `size` and `captured` of a block, which a mutation may add, replace its lengths.
        """
        return b"".join(map(_join_block, document))


def _split_block(kind: int, body: bytes) -> dict[str, Any]:
    """Return the fields of a block: kind, values of the head, options, and data or header.

    body: block without its lengths.
    """
    head = _HEADS[kind]
    values = list(head.unpack_from(body))
    block: dict[str, Any] = {"kind": kind, "head": values}
    place = head.size
    if kind == _PACKET:
        block["data"] = body[place : place + values[3]]
        place += values[3] + -values[3] % 4
        del values[3:]  # both lengths are those of the data
    options = []
    while place < len(body):
        code, size = struct.unpack_from("<HH", body, place)
        value = body[place + 4 : place + 4 + size]
        place += 4 + size + -size % 4
        if kind == _SECTION and code == _COMMENT:
            block["header"] = Json().decode(value)
        else:
            options.append({"code": code, "value": value})
    return block | {"options": options}


def _join_block(block: Any) -> bytes:
    """Return the bytes of a block."""
    head = list(block["head"])
    parts = []
    if "data" in block:
        size = len(block["data"])
        head += [block.get("captured", size), size]
        parts.append(block["data"] + bytes(-size % 4))
    parts.insert(0, _HEADS[block["kind"]].pack(*head) if block["kind"] in _HEADS else b"")
    if "header" in block:
        parts.append(_join_option(_COMMENT, Json().encode(block["header"])))
    parts += [_join_option(option["code"], option["value"]) for option in block["options"]]
    body = b"".join(parts)
    size = block.get("size", len(body) + 12)
    return struct.pack("<II", block["kind"], size) + body + struct.pack("<I", size)


def _join_option(code: int, value: bytes) -> bytes:
    """Return the bytes of an option, padded to a multiple of four."""
    return struct.pack("<HH", code, len(value)) + value + bytes(-len(value) % 4)
