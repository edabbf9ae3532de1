"""Frames on a wire: CRC-32, whitening, byte stuffing (COBS), and a reference decoder that never loses an intact frame.

This module is the readable definition; `firmware/codec` is the fast implementation. The tests compare both with each
other and with the construct definition in `wire`.
"""

import zlib
from collections.abc import Iterator

from taxel_protocol.frames import FRAMES
from taxel_protocol.limits import (
    ADDRESS_MAX,
    ADDRESS_MIN,
    BODY_MAX,
    ENCODED_MAX,
    FRAME_CRC_SIZE,
    FRAME_HEADER_SIZE,
    PAYLOAD_MAX,
    SNAPSHOT_OVERHEAD,
    WHITENING_FACTOR,
    WHITENING_INCREMENT,
    WHITENING_SEED,
)
from taxel_protocol.names import FrameType


def crc32(data: bytes, start: int = 0) -> int:
    """Compute the CRC-32 of IEEE 802.3 (reflected polynomial 0xEDB88320, as zlib's); `start` continues a CRC."""
    return zlib.crc32(data, start)


def _compute_whitening(length: int) -> bytes:
    """Return the first `length` bytes of the pseudo-random sequence that is XORed with a frame to whiten it."""
    sequence = bytearray(length)
    state = WHITENING_SEED
    for i in range(length):
        sequence[i] = state
        state = (WHITENING_FACTOR * state + WHITENING_INCREMENT) & 0xFF
    return bytes(sequence)


_WHITENING = _compute_whitening(BODY_MAX)


def whiten(body: bytes) -> bytes:
    """XOR a frame with the whitening sequence; a second call restores the frame.

    Raises ValueError for more than BODY_MAX bytes.
    """
    if len(body) > BODY_MAX:
        raise ValueError(f"a frame has at most {BODY_MAX} bytes, got {len(body)}")
    sequence = int.from_bytes(_WHITENING[: len(body)], "little")  # integer arithmetic: byte by byte is ten times slower
    return (int.from_bytes(body, "little") ^ sequence).to_bytes(len(body), "little")


def cobs_encode(data: bytes) -> bytes:
    """Encode `data` without zero bytes, by consistent overhead byte stuffing (COBS; Cheshire and Baker, 1999).

    A block is a code byte, which is the size of the block, and up to 254 bytes. A zero follows a decoded block, unless
    the block is full (code 0xFF) or the last one.
    """
    out = bytearray()
    for is_last, block in _split_at_zeros(data):
        while len(block) > 254 or (len(block) == 254 and not is_last):
            out.append(0xFF)
            out += block[:254]
            block = block[254:]
        if len(block) == 254:
            out.append(0xFF)
            out += block
        else:
            out.append(len(block) + 1)
            out += block
    return bytes(out)


def _split_at_zeros(data: bytes) -> Iterator[tuple[bool, bytes]]:
    """Yield the pieces of `data` between zero bytes, each as (whether it is the last piece, piece)."""
    runs = data.split(b"\0")
    for i, run in enumerate(runs):
        yield i == len(runs) - 1, run


def cobs_decode(data: bytes) -> bytes:
    """Decode the bytes of `cobs_encode`. Raises ValueError if `data` contains a zero byte or ends inside a block."""
    if b"\0" in data:
        raise ValueError("stuffed data contains a zero byte")
    out = bytearray()
    position = 0
    while position < len(data):
        code = data[position]
        end = position + code
        if end > len(data):
            raise ValueError("stuffed data ends inside a block")
        out += data[position + 1 : end]
        position = end
        if code < 0xFF and position < len(data):
            out.append(0)
    return bytes(out)


def encode_body(body: bytes) -> bytes:
    """Whiten and stuff the body of a frame, and enclose it in its two zero bytes."""
    return b"\0" + cobs_encode(whiten(body)) + b"\0"


def encode_frame(frame_type: int, sequence: int, payload: bytes) -> bytes:
    """Encode a frame as sent on the wire, with the zero bytes that delimit it.

    Raises ValueError for a payload that the frame type does not allow.
    """
    header = bytes([frame_type]) + sequence.to_bytes(2, "little") + len(payload).to_bytes(2, "little")
    body = header + payload
    if not is_plausible_header(body):
        raise ValueError(f"frame type 0x{frame_type:02X} does not allow a payload of {len(payload)} bytes")
    return encode_body(body + crc32(body).to_bytes(4, "little"))


def is_plausible_header(body: bytes) -> bool:
    """Return whether this version permits the type, payload length, board address and number of taxels of a frame.

    body: unstuffed, unwhitened frame or its start, at least 5 bytes. The address is checked if `body` has 6 bytes, and
    the number of taxels if `body` has 7.
    """
    try:
        spec = FRAMES[FrameType(body[0])]
    except (ValueError, KeyError):
        return False
    length = int.from_bytes(body[3:5], "little")
    if not spec.minimum <= length <= spec.maximum:
        return False
    if spec.has_address and len(body) > 5 and not ADDRESS_MIN <= body[5] <= ADDRESS_MAX:
        return False
    if body[0] == FrameType.TAXELS and len(body) > 6:  # 8 bytes of taxel header, then a snapshot of 2 bytes per taxel
        return length == 8 + SNAPSHOT_OVERHEAD + 2 * body[6]
    return True


def decode_body(body: bytes) -> tuple[int, int, bytes] | None:
    """Decode an unstuffed, unwhitened frame to (type, sequence, payload); None if it is incomplete or damaged.

    A complete frame may be unknown: `is_plausible_header` states whether this version defines its type and length.
    """
    if len(body) < FRAME_HEADER_SIZE + FRAME_CRC_SIZE:
        return None
    length = int.from_bytes(body[3:5], "little")
    if len(body) != FRAME_HEADER_SIZE + length + FRAME_CRC_SIZE:
        return None
    if crc32(body[:-4]) != int.from_bytes(body[-4:], "little"):
        return None
    return body[0], int.from_bytes(body[1:3], "little"), body[5:-4]


def decode_prefix(chunk: bytes) -> tuple[int, tuple[int, int, bytes]] | None:
    """Decode the complete frame at the start of `chunk`, which contains no zero; return (bytes used, frame) or None.

    The header states the length of a frame, so its end is found without a delimiter: it is the end of the block where
    the unstuffed length equals the length stated in the header. A frame is (type, sequence, payload); its type and
    length may be unknown to this version.
    """
    out = bytearray()
    position = 0
    while position < len(chunk) and len(out) <= BODY_MAX:
        code = chunk[position]
        end = position + code
        if end > len(chunk):
            return None
        out += chunk[position + 1 : end]
        position = end
        if len(out) >= FRAME_HEADER_SIZE:
            length = int.from_bytes(whiten(bytes(out[:FRAME_HEADER_SIZE]))[3:5], "little")
            expected = FRAME_HEADER_SIZE + length + FRAME_CRC_SIZE
            if length > PAYLOAD_MAX or len(out) > expected:
                return None
            if len(out) == expected:
                frame = decode_body(whiten(bytes(out)))
                return None if frame is None else (position, frame)
        if code < 0xFF:
            out.append(0)
    return None


def _is_known(frame: tuple[int, int, bytes]) -> bool:
    """Return whether this version defines the type and the length of a complete frame (type, sequence, payload)."""
    frame_type, _, payload = frame
    return is_plausible_header(bytes([frame_type, 0, 0]) + len(payload).to_bytes(2, "little") + payload)


class ReferenceDecoder:
    """Stream decoder in pure Python: bytes in, frames out. It is the oracle for the C decoder.

    A chunk is the bytes between two zeros. If a chunk is not exactly one frame, every byte is tried as the start of a
    frame, so that frames joined to each other or to invalid bytes by a lost delimiter are all found. A complete frame
    that this version does not define is skipped and counted in `unknown_frames`; its bytes are not discarded bytes.
    """

    def __init__(self) -> None:
        """Create a decoder without received bytes."""
        self._chunk = bytearray()
        self.discarded_bytes = 0
        self.unknown_frames = 0

    def push(self, data: bytes) -> list[tuple[int, int, bytes]]:
        """Return the frames (type, sequence, payload) that the received bytes `data` complete, in order."""
        frames: list[tuple[int, int, bytes]] = []
        first, *later = data.split(b"\0")
        self._chunk += first
        for piece in later:
            frames += self._take_chunk(bytes(self._chunk))
            self._chunk = bytearray(piece)
        # A chunk without a delimiter is searched in parts, so that the buffered bytes stay limited.
        while len(self._chunk) > 2 * ENCODED_MAX:
            frames += self._scan(bytes(self._chunk[:ENCODED_MAX]), bytes(self._chunk))
        return frames

    def finish(self) -> list[tuple[int, int, bytes]]:
        """Return the frames in the remaining bytes when the stream ends without a delimiter."""
        frames = self._take_chunk(bytes(self._chunk))
        self._chunk.clear()
        return frames

    def _take_chunk(self, chunk: bytes) -> list[tuple[int, int, bytes]]:
        """Return the frames (type, sequence, payload) in a chunk, the bytes between two zero bytes of the stream."""
        if not chunk:
            return []
        return self._search(chunk, len(chunk))[1]

    def _scan(self, head: bytes, chunk: bytes) -> list[tuple[int, int, bytes]]:
        """Return the frames that start inside `head`, the first part of `chunk`, and remove the searched bytes."""
        used, frames = self._search(chunk, len(head))
        del self._chunk[:used]
        return frames

    def _search(self, chunk: bytes, until: int) -> tuple[int, list[tuple[int, int, bytes]]]:
        """Return the frames that start before position `until` of `chunk`, and the position where the search ended.

        A byte at which no frame starts is counted as discarded.
        """
        frames = []
        start = 0
        while start < until:
            match = decode_prefix(chunk[start : start + ENCODED_MAX])
            if match is None:
                start += 1
                self.discarded_bytes += 1
            else:
                start += match[0]
                if _is_known(match[1]):
                    frames.append(match[1])
                else:
                    self.unknown_frames += 1
        return start, frames
