"""Process `taxel_deframe` of taxel_stream.ksy: finds the intact frames of a stream, and removes their byte stuffing."""

import struct
import zlib

from taxel_rules import (
    ADDRESS_MAX,
    ADDRESS_MIN,
    BODY_MAX,
    FRAME_CRC_SIZE,
    FRAME_HEADER_SIZE,
    FRAMES,
    PAYLOAD_MAX,
    SNAPSHOT_OVERHEAD,
    TYPE_TAXELS,
    WHITENING_FACTOR,
    WHITENING_INCREMENT,
    WHITENING_SEED,
)

_TAXEL_HEADER_SIZE = 8


def _make_whitening() -> bytes:
    """Return the whitening sequence of the longest body."""
    sequence = [WHITENING_SEED]
    while len(sequence) < BODY_MAX:
        sequence.append((WHITENING_FACTOR * sequence[-1] + WHITENING_INCREMENT) % 256)
    return bytes(sequence)


_WHITENING = _make_whitening()


def _whiten(body: bytes) -> bytes:
    """XOR a body with the whitening sequence."""
    return bytes(a ^ b for a, b in zip(body, _WHITENING, strict=False))


def _compute_expected_size(header: bytes) -> int:
    """Return the size of the body with this header; 0 if no frame has this length."""
    _, _, length = struct.unpack_from("<BHH", header)
    return FRAME_HEADER_SIZE + length + FRAME_CRC_SIZE if length <= PAYLOAD_MAX else 0


def _is_crc_correct(body: bytes) -> bool:
    """Return whether the CRC of a body is correct."""
    return zlib.crc32(body[:-FRAME_CRC_SIZE]) == int.from_bytes(body[-FRAME_CRC_SIZE:], "little")


def _is_known(body: bytes) -> bool:
    """Return whether this version defines a complete frame: its type, length, address and number of taxels."""
    payload = body[FRAME_HEADER_SIZE:-FRAME_CRC_SIZE]
    # The default for an unknown type, with a minimum above its maximum, permits no length.
    has_address, minimum, maximum = FRAMES.get(body[0], (False, 1, 0))
    if not minimum <= len(payload) <= maximum or (has_address and not ADDRESS_MIN <= payload[0] <= ADDRESS_MAX):
        return False
    return body[0] != TYPE_TAXELS or len(payload) == _TAXEL_HEADER_SIZE + SNAPSHOT_OVERHEAD + 2 * payload[1]


def _take_frame(chunk: bytes, start: int) -> tuple[int, bytes] | None:
    """Return the end and the whitened body of the frame that begins at `start`; None if no frame begins there.

    The chunk is a sequence of COBS blocks: a code byte, which is the size of the block, and its content; a zero follows
    the content of a block whose code is below 0xFF.
    """
    out, position, expected = bytearray(), start, 0
    while position < len(chunk):
        code = chunk[position]
        end = position + code
        if end > len(chunk) or len(out) + code - 1 > BODY_MAX:
            return None
        out += chunk[position + 1 : end]
        position = end
        if not expected and len(out) >= FRAME_HEADER_SIZE:
            expected = _compute_expected_size(_whiten(bytes(out[:FRAME_HEADER_SIZE])))
            if not expected:
                return None
        if expected and len(out) >= expected:
            is_frame = len(out) == expected and _is_crc_correct(_whiten(bytes(out)))
            return (position, bytes(out)) if is_frame else None
        if code < 0xFF:
            out.append(0)
    return None


class TaxelDeframe:
    """The custom process, as the compilers of Kaitai Struct call it."""

    def decode(self, data: bytes) -> bytes:
        """Return the whitened bodies of all frames in `data`, each preceded by three bytes.

        The first byte is 1 if this version defines the frame, otherwise 0. The other two bytes are the size of the
        body, the low byte first.
        """
        out = bytearray()
        for chunk in data.split(b"\0"):
            start = 0
            while start < len(chunk):
                frame = _take_frame(chunk, start)
                if frame is None:
                    start += 1
                    continue
                start = frame[0]
                out += struct.pack("<BH", _is_known(_whiten(frame[1])), len(frame[1])) + frame[1]
        return bytes(out)
