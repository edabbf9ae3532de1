"""Codecs of binary files: captures, MCAP, ROS 1 bags, firmware images, and binary clouds and meshes."""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass
from typing import Any, Final

from fuzz_files.text_codecs import Json

_CAPTURE: Final = struct.Struct("<8sHHI")
_RECORD: Final = struct.Struct("<QI")


@dataclass(frozen=True)
class Capture:
    """Capture files (protocol/SPEC.md): a header in JSON, and records of a time and bytes."""

    is_strict: bool = False

    def decode(self, data: bytes) -> Any:
        """Return magic, version, header and records. Raises ValueError for a truncated record."""
        magic, version, zero, size = _CAPTURE.unpack_from(data)
        end = _CAPTURE.size + size
        header = Json().decode(data[_CAPTURE.size : end])
        records = []
        while end < len(data):
            time_ns, size = _RECORD.unpack_from(data, end)
            body = data[end + _RECORD.size : end + _RECORD.size + size]
            if len(body) != size:
                raise ValueError("truncated")
            records.append({"time_ns": time_ns, "data": body})
            end += _RECORD.size + size
        return {"magic": magic, "version": version, "zero": zero, "header": header, "records": records}

    def encode(self, document: Any) -> bytes:
        """Return the bytes of the file.

        The key `size` of a record, which a mutation may add, replaces the length of its data.
        """
        text = Json().encode(document["header"])
        head = _CAPTURE.pack(document["magic"], document["version"], document["zero"], len(text))
        records = [
            _RECORD.pack(record["time_ns"], record.get("size", len(record["data"]))) + record["data"]
            for record in document["records"]
        ]
        return b"".join([head, text, *records])


MCAP_MAGIC: Final = b"\x89MCAP0\r\n"
_CHUNK: Final = 6


@dataclass(frozen=True)
class Mcap:
    """MCAP files (mcap.dev/spec): records of an opcode and bytes.

    Chunks contain records, and their CRC is recomputed.
    """

    is_strict: bool = False

    def decode(self, data: bytes) -> Any:
        """Return the records; those in an uncompressed chunk are decoded, too.

        Raises ValueError for a file without the magic bytes.
        """
        if data[:8] != MCAP_MAGIC or data[-8:] != MCAP_MAGIC:
            raise ValueError("no MCAP file")
        return _split_records(data[8:-8])

    def encode(self, document: Any) -> bytes:
        """Return the bytes of the file."""
        return MCAP_MAGIC + _join_records(document) + MCAP_MAGIC


def _split_records(data: bytes) -> list[dict[str, Any]]:
    """Return the records in a part of an MCAP file: opcode, and body or fields of a chunk.

    A record begins with its opcode (1 byte) and the length of its body (8 bytes). Raises ValueError for a truncated
    record.
    """
    records, place = [], 0
    while place < len(data):
        code, size = struct.unpack_from("<BQ", data, place)
        body = data[place + 9 : place + 9 + size]
        if len(body) != size:
            raise ValueError("truncated")
        records.append({"code": code, **(_split_chunk(body) if code == _CHUNK else {"body": body})})
        place += 9 + size
    return records


def _split_chunk(body: bytes) -> dict[str, Any]:
    """Return the fields of a chunk: times, compression and records.

    A compressed chunk has its data and CRC instead of records. Body of a chunk in MCAP: start, end and size of the
    uncompressed data (8 bytes each), CRC (4 bytes), name of the compression after its length (4 bytes), size of the
    data (8 bytes), data.
    """
    start, end, _, crc = struct.unpack_from("<QQQI", body)
    (length,) = struct.unpack_from("<I", body, 28)
    compression = body[32 : 32 + length].decode()
    data = body[40 + length :]
    if compression:
        return {"start": start, "end": end, "compression": compression, "data": data, "crc": crc}
    return {"start": start, "end": end, "compression": "", "records": _split_records(data)}


def _join_records(records: Any) -> bytes:
    """Return the bytes of MCAP records.

    The key `size` of a record, which a mutation may add, replaces the length of its body.
    """
    parts = []
    for record in records:
        body = record["body"] if "body" in record else _join_chunk(record)
        parts.append(struct.pack("<BQ", record["code"], record.get("size", len(body))) + body)
    return b"".join(parts)


def _join_chunk(record: Any) -> bytes:
    """Return the body of a chunk.

    Size and CRC are computed from its records unless the document states them.
    """
    name = record["compression"].encode()
    data = record["data"] if "data" in record else _join_records(record["records"])
    crc = record.get("crc", zlib.crc32(data))
    head = struct.pack("<QQQI", record["start"], record["end"], record.get("size_of_data", len(data)), crc)
    return b"".join([head, struct.pack("<I", len(name)), name, struct.pack("<Q", len(data)), data])


BAG_MAGIC: Final = b"#ROSBAG V2.0\n"


@dataclass(frozen=True)
class Bag:
    """ROS 1 bags (wiki.ros.org/Bags/Format/2.0): records of named header fields and data."""

    is_strict: bool = False

    def decode(self, data: bytes) -> Any:
        """Return the records. Raises ValueError for a file without the magic bytes, or with a truncated record."""
        if not data.startswith(BAG_MAGIC):
            raise ValueError("no bag")
        records, place = [], len(BAG_MAGIC)
        while place < len(data):
            head, place = _take_block(data, place)
            body, place = _take_block(data, place)
            fields, inner = [], 0
            while inner < len(head):
                field, inner = _take_block(head, inner)
                name, _, value = field.partition(b"=")
                fields.append({"name": name.decode(), "value": value})
            records.append({"fields": fields, "data": body})
        return records

    def encode(self, document: Any) -> bytes:
        """Return the bytes of the bag, with the lengths of the fields and data."""
        parts = [BAG_MAGIC]
        for record in document:
            fields = [field["name"].encode() + b"=" + field["value"] for field in record["fields"]]
            head = b"".join(struct.pack("<I", len(field)) + field for field in fields)
            parts += [struct.pack("<I", len(head)), head, struct.pack("<I", len(record["data"])), record["data"]]
        return b"".join(parts)


def _take_block(data: bytes, place: int) -> tuple[bytes, int]:
    """Return the block at `place`, which begins with its length in 32 bits, and the place after the block.

    Raises ValueError for a truncated block.
    """
    (size,) = struct.unpack_from("<I", data, place)
    block = data[place + 4 : place + 4 + size]
    if len(block) != size:
        raise ValueError("truncated")
    return block, place + 4 + size


@dataclass(frozen=True)
class BinaryTable:
    """PLY and PCD files: a text header, and rows of one fixed binary form.

    marker: end of the header. row: form of a row, as a format of the module struct.
    """

    marker: bytes
    row: str
    is_strict: bool = False

    def decode(self, data: bytes) -> Any:
        """Return the words of the header's lines, the rows, and the bytes after the last complete row.

        Raises ValueError for a file without the end of a header.
        """
        head, marker, body = data.partition(self.marker)
        if not marker:
            raise ValueError("no header")
        count = len(body) // struct.calcsize(self.row)
        rows = [list(row) for row in struct.iter_unpack(self.row, body[: count * struct.calcsize(self.row)])]
        lines = [line.split(" ") for line in head.decode().splitlines()]
        return {"head": lines, "rows": rows, "rest": body[count * struct.calcsize(self.row) :]}

    def encode(self, document: Any) -> bytes:
        """Return the bytes of the file."""
        head = "\n".join(" ".join(map(str, line)) for line in document["head"]).encode() + b"\n"
        rows = [struct.pack(self.row, *row) for row in document["rows"]]
        return b"".join([head, self.marker, *rows, document["rest"]])


@dataclass(frozen=True)
class BinaryStl:
    """Binary STL files: a header of 80 bytes, the number of triangles, and triangles of twelve numbers and a word."""

    is_strict: bool = False

    def decode(self, data: bytes) -> Any:
        """Return header, number of triangles, triangles, and the bytes after the last triangle.

        A binary STL file has a header of 80 bytes, the number of triangles (4 bytes), and 50 bytes for each triangle:
        normal, three corners, and an attribute.
        """
        (count,) = struct.unpack_from("<I", data, 80)
        triangles = [list(row) for row in struct.iter_unpack("<12fH", data[84 : 84 + 50 * count])]
        return {"head": data[:80], "count": count, "triangles": triangles, "rest": data[84 + 50 * count :]}

    def encode(self, document: Any) -> bytes:
        """Return the bytes of the file; the document states the number of triangles, which may be wrong."""
        rows = [struct.pack("<12fH", *row) for row in document["triangles"]]
        return b"".join([document["head"], struct.pack("<I", document["count"]), *rows, document["rest"]])
