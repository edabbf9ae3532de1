"""Expansion of gzip-compressed data, up to a given size."""

import zlib
from typing import Final

from taxel.input_files.text_error import TextError, format_reason

_GZIP: Final = 16 + zlib.MAX_WBITS
"""Argument `wbits` of zlib for the gzip format with its CRC-32."""


def expand_gzip(data: bytes, size_max: int) -> bytes:
    """Expand one gzip stream to at most `size_max` bytes.

    Raises TextError for other data, a wrong CRC-32, a truncated stream, bytes behind the stream, and a larger result.
    """
    expander = zlib.decompressobj(_GZIP)
    try:
        result = expander.decompress(data, size_max + 1)
    except zlib.error as error:
        raise TextError("file", "data compressed by gzip", format_reason(error)) from None
    if len(result) > size_max:
        raise TextError("file", f"at most {size_max} bytes after expansion", "more")
    if not expander.eof or expander.unused_data:
        raise TextError("file", "one complete gzip stream", "a truncated one" if not expander.eof else "more data")
    return result
