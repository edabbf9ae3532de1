"""Expected frames and losses of a stream, by the construct definition of a frame: the oracle of all decoders.

One difference: construct rejects a BOARD_INFO whose identity does not begin with 54, which a receiver does not check.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

from construct import ConstructError

from taxel_protocol import crc32
from taxel_protocol.frames import FRAMES
from taxel_protocol.framing import whiten
from taxel_protocol.limits import (
    ADDRESS_MAX,
    ADDRESS_MIN,
    BODY_MAX,
    ENCODED_MAX,
    FRAME_CRC_SIZE,
    FRAME_HEADER_SIZE,
)
from taxel_protocol.names import FrameType
from taxel_protocol.wire import WireFrame

Frame = tuple[int, int, bytes]
"""(type, sequence, payload)"""

TO_HOST = 1
TO_HUB = 2


def _list_block_ends(chunk: bytes) -> Iterator[tuple[int, bytes]]:
    """Decode the byte stuffing of a chunk block by block.

    chunk: received bytes between two zero bytes. After each block, yields the number of encoded bytes so far and the
    decoded (whitened) body so far; stops at an incomplete block, and when the body exceeds `BODY_MAX`.
    """
    body = bytearray()
    position = 0
    while position < len(chunk) and len(body) <= BODY_MAX:
        end = position + chunk[position]
        if end > len(chunk):
            return
        body += chunk[position + 1 : end]
        if len(body) > BODY_MAX:
            return
        yield end, whiten(bytes(body))
        if chunk[position] < 0xFF:  # only a block of the largest length is not followed by a zero byte
            body.append(0)
        position = end


def _parse_frame(wire: bytes, body: bytes, directions: int) -> Frame | None:
    """Parse a frame with construct. Returns None if construct or the rules of the frame type reject it.

    wire: encoded bytes of the frame; body: the same frame, decoded. directions: bit mask of the permitted directions,
    `TO_HOST` and `TO_HUB`. The rules of a type limit its direction, the payload's size and the board address.
    """
    try:
        content = WireFrame.parse(b"\0" + wire + b"\0")
        spec = FRAMES[FrameType(content.type)]
    except (ConstructError, ValueError, KeyError):
        return None
    payload = body[FRAME_HEADER_SIZE:-FRAME_CRC_SIZE]
    if not directions & (TO_HUB if content.type & 0x80 else TO_HOST):
        return None
    if not spec.minimum <= len(payload) <= spec.maximum or (
        spec.has_address and not ADDRESS_MIN <= payload[0] <= ADDRESS_MAX
    ):
        return None
    # The built payload differs if the description of the payload does not cover all its bytes.
    built = spec.payload.build(content.payload)
    return (content.type, content.sequence, payload) if built == payload else None


def _find_first_frame(chunk: bytes, directions: int) -> tuple[int, Frame | None] | None:
    """Find the complete frame with a correct CRC at the start of a chunk of received bytes.

    directions: bit mask of the permitted directions, `TO_HOST` and `TO_HUB`. Returns (number of encoded bytes, frame).
    The frame is None if construct or the rules of its type reject it: an unknown frame. Returns None instead of the
    tuple if no complete frame with a correct CRC starts here.
    """
    for end, body in _list_block_ends(chunk):
        if len(body) >= FRAME_HEADER_SIZE:
            expected_size = FRAME_HEADER_SIZE + int.from_bytes(body[3:5], "little") + FRAME_CRC_SIZE
            if expected_size > BODY_MAX:
                return None
            if len(body) >= expected_size:
                is_whole = len(body) == expected_size and crc32(body[:-4]) == int.from_bytes(body[-4:], "little")
                return (end, _parse_frame(chunk[:end], body, directions)) if is_whole else None
    return None


def parse_stream(stream: bytes, directions: int = TO_HOST | TO_HUB) -> list[Frame]:
    """Return all valid frames in a byte stream, in order.

    A frame may begin at any byte that is not part of a previous frame; construct parses it there. directions: bit mask
    of the permitted directions, `TO_HOST` and `TO_HUB`.
    """
    frames: list[Frame] = []
    for chunk in stream.split(b"\0"):
        start = 0
        while start < len(chunk):
            result = _find_first_frame(chunk[start : start + ENCODED_MAX], directions)
            if result is not None and result[1] is not None:
                frames.append(result[1])
            start += result[0] if result is not None else 1
    return frames


@dataclass
class Losses:
    """Losses on the wire, and numbers of frames by board address (SPEC.md, "Counting losses").

    received, damaged: taxel frames with a valid and an invalid CRC of the board. missing: frames missing in the cycles.
    """

    frames: int = 0
    lost: int = 0
    restarts: int = 0
    received: dict[int, int] = field(default_factory=dict)
    missing: dict[int, int] = field(default_factory=dict)
    damaged: dict[int, int] = field(default_factory=dict)

    def to_totals(self) -> list[int]:
        """Return the counters as a list in the layout of the C struct `taxel_batch_totals`.

        First frames, lost frames, restarts and unknown frames (not counted here, 0). Then 128 numbers by I2C address
        for each of received, missing and damaged frames, and for undecoded compact frames (not counted here, 0).
        """
        totals = [self.frames, self.lost, self.restarts, 0] + [0] * (4 * 128)
        for number, table in enumerate((self.received, self.missing, self.damaged)):
            for address, count in table.items():
                totals[4 + 128 * number + address] = count
        return totals


def _count_board(losses: Losses, last: dict[int, tuple[int, int]], payload: bytes) -> None:
    """Count a received taxel frame in `losses`: as received or damaged, and the frames missing before it.

    last: (poll cycle, scan number) of the previous frame of each board, by I2C address; updated. payload: payload of
    the taxel frame.
    """
    # Layout: I2C address in byte 0, poll cycle in bytes 2-3, then from byte 8 the snapshot, which begins with its scan
    # number and ends with the board's CRC of address and snapshot.
    address = payload[0]
    cycle, scan = int.from_bytes(payload[2:4], "little"), int.from_bytes(payload[8:10], "little")
    is_valid = crc32(payload[8:-4], crc32(payload[:1])) == int.from_bytes(payload[-4:], "little")
    table = losses.received if is_valid else losses.damaged
    table[address] = table.get(address, 0) + 1
    if address in last:
        # Without a new scan the board has no new frame, so the smaller number of elapsed cycles and scans counts.
        steps = min((cycle - last[address][0]) % 65536, (scan - last[address][1]) % 65536)
        losses.missing[address] = losses.missing.get(address, 0) + max(steps - 1, 0)
    last[address] = (cycle, scan)


def _read_uptime_us(frame_type: int, payload: bytes) -> int | None:
    """Return the hub's uptime in microseconds from a frame; None for a frame type that does not contain it."""
    start = {int(FrameType.HUB_HANDSHAKE): 16, int(FrameType.HUB_STATUS): 0}.get(frame_type)
    return None if start is None else int.from_bytes(payload[start : start + 8], "little")


def count_losses(frames: Iterable[Frame]) -> Losses:
    """Count the losses that a host must report after it has received these frames, in order."""
    losses = Losses()
    previous: int | None = None
    last_uptime_us = 0
    last: dict[int, tuple[int, int]] = {}
    for frame_type, sequence, payload in frames:
        uptime_us = _read_uptime_us(frame_type, payload)
        is_handshake = frame_type == FrameType.HUB_HANDSHAKE
        has_less_uptime = is_handshake and uptime_us is not None and uptime_us < last_uptime_us
        last_uptime_us = last_uptime_us if uptime_us is None else uptime_us
        # A hub announces a restart by a handshake with sequence 0 and tag (payload[0]) 0. If this frame was lost, the
        # smaller uptime in a later handshake shows the restart.
        if has_less_uptime or (is_handshake and sequence == 0 and payload[0] == 0):
            losses.restarts += previous is not None
            last.clear()
        elif previous is not None:
            losses.lost += (sequence - previous - 1) % 65536
        previous = sequence
        losses.frames += 1
        if frame_type == FrameType.TAXELS:
            _count_board(losses, last, payload)
    return losses
