"""The construct definition of a whole frame on the wire: fields in, bytes out, and back."""

from typing import Any

from construct import (
    Adapter,
    Checksum,
    GreedyBytes,
    Int8ul,
    Int16ul,
    Int32ul,
    Prefixed,
    RawCopy,
    StreamError,
    Struct,
    Switch,
    this,
)

from taxel_protocol.frames import FRAMES
from taxel_protocol.framing import cobs_decode, crc32, encode_body, whiten

Content = Struct(
    "type" / Int8ul,
    "sequence" / Int16ul,
    "payload" / Prefixed(Int16ul, Switch(this.type, {int(t): s.payload for t, s in FRAMES.items()}, GreedyBytes)),
)
"""Content of a frame. sequence: number of frames that the sender transmitted before this one, modulo 65536."""

Body = Struct(
    "content" / RawCopy(Content),
    "crc32" / Checksum(Int32ul, crc32, this.content.data),
)
"""A frame before whitening and stuffing."""


class _Delimited(Adapter):  # type: ignore[misc]
    """Adapter of construct between the body of a frame and its bytes on the wire: whitening, stuffing and two zeros."""

    def _decode(self, data: bytes, context: Any, path: str) -> Any:
        """Remove the two zero bytes, the byte stuffing and the whitening of a frame, and return its parsed content."""
        if len(data) < 2 or data[0] or data[-1]:
            raise StreamError("a frame begins and ends with a zero byte", path=path)
        return Body.parse(whiten(cobs_decode(data[1:-1]))).content.value

    def _encode(self, fields: Any, context: Any, path: str) -> bytes:
        """Whiten and stuff the fields of a frame, and enclose the result in its two zero bytes."""
        return encode_body(Body.build({"content": {"value": fields}}))


WireFrame = _Delimited(GreedyBytes)
"""One frame, delimiters included: `WireFrame.build({"type", "sequence", "payload"})`, `WireFrame.parse(bytes)`."""
