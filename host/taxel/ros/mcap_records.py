"""Records of an MCAP file, from front to back, with bounded memory also for a damaged file."""

import dataclasses
import struct
from collections.abc import Iterator
from typing import Any, BinaryIO

from taxel.optional import optional_import

with optional_import("mcap", "an MCAP file (.mcap)"):
    import lz4.frame
    import zstandard
    from mcap.exceptions import McapError
    from mcap.records import Chunk, Footer
    from mcap.stream_reader import StreamReader, breakup_chunk

RECORD_MAX = 1 << 28
"""Largest size of a record or of an unpacked chunk, bytes. The limit bounds the memory that a damaged file can use."""

DAMAGE = (McapError, ValueError, TypeError, struct.error, zstandard.ZstdError, RuntimeError, OverflowError, MemoryError)
"""Errors of the library mcap, of the decompressors and of the values of metadata for a damaged file."""


def read_records(file: BinaryIO) -> Iterator[Any]:
    """Yield the records of an MCAP file before its footer: data section, then summary section.

    The summary section repeats schemas and channels, and contains statistics and indices. For a chunk, the records that
    it contains are yielded. Raises one of the errors in `DAMAGE` at a damaged record, or if the file ends without a
    footer.
    """
    for record in StreamReader(file, emit_chunks=True, record_size_limit=RECORD_MAX).records:
        if isinstance(record, Footer):
            return
        if isinstance(record, Chunk):
            yield from breakup_chunk(_decompress(record), validate_crc=True)
        else:
            yield record


def _decompress(chunk: Chunk) -> Chunk:
    """Return an MCAP chunk without its compression.

    Raises ValueError if its data do not have the size that the chunk states. The size is checked before the data are
    unpacked completely, because a compressed frame may state a false size.
    """
    if chunk.uncompressed_size > RECORD_MAX:
        raise ValueError("a chunk is too large")
    if chunk.compression == "zstd":
        with zstandard.ZstdDecompressor().stream_reader(chunk.data) as reader:
            data = reader.read(chunk.uncompressed_size + 1)
    elif chunk.compression == "lz4":
        data = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=chunk.uncompressed_size + 1)
    else:
        data = chunk.data
    if len(data) != chunk.uncompressed_size:
        raise ValueError("a chunk does not have the size that it states")
    return dataclasses.replace(chunk, compression="", data=data)
