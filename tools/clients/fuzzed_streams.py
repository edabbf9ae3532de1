"""Streams that no hub sends: random bytes, and compact frames with a valid CRC and arbitrary content."""

import random
from collections.abc import Sequence

from reference import TO_HOST, TO_HUB, Stream

from taxel_protocol import FrameType, compact, crc32, encode_frame
from taxel_protocol.frames import FRAMES, TaxelHeader
from taxel_protocol.layout import pack
from taxel_protocol.limits import ADDRESS_MAX, ADDRESS_MIN, COMPACT_KEY_FRAME

SNAPSHOTS = 8


def make_random_stream(seed: int) -> Stream:
    """Create a stream of random bytes.

    Some streams consist of only a few different byte values, so that blocks and headers occur.
    """
    draw = random.Random(f"random {seed}")
    values = draw.choice((256, 256, 8, 3))
    data = bytes(draw.randrange(values) for _ in range(draw.randint(1, 3000)))
    return Stream(f"random {seed}", TO_HOST | TO_HUB, data)


def _make_snapshot(draw: random.Random, address: int, key_frame: bytes) -> bytes:
    """Create a compact snapshot with a valid CRC and arbitrary content.

    key_frame: id of the key frame to which it refers, two bytes.
    """
    format_byte = draw.choice((0, COMPACT_KEY_FRAME, COMPACT_KEY_FRAME, draw.randrange(256)))
    body = draw.randbytes(2) + bytes([format_byte]) + key_frame + draw.randbytes(3 + draw.randint(0, 60))
    return body + crc32(body, crc32(bytes([address]))).to_bytes(4, "little")


def make_compact_stream(seed: int) -> Stream:
    """Create a stream with a packed key frame of one board, then compact snapshots of arbitrary content."""
    draw = random.Random(f"compact {seed}")
    address, taxels = draw.randint(ADDRESS_MIN, ADDRESS_MAX), draw.randint(1, 40)
    counts: Sequence[int] = [draw.randrange(1 << 16) for _ in range(taxels)]
    snapshots = [compact.encode_packed(address, 1, draw.getrandbits(32), counts, True, draw.randint(0, 3))]
    key_frame = snapshots[0][-4:-2]
    for _ in range(SNAPSHOTS):
        snapshots.append(_make_snapshot(draw, address, key_frame))
        key_frame = draw.choice((key_frame, snapshots[-1][-4:-2]))
    data = b""
    spec = FRAMES[FrameType.COMPACT_TAXELS]
    for i, snapshot in enumerate(snapshots):
        count = taxels if draw.random() < 0.95 else draw.randrange(256)
        header = {"address": address, "taxel_count": count, "cycle": i, "hub_time_us": i}
        payload = pack(TaxelHeader, header, snapshot)
        if spec.minimum <= len(payload) <= spec.maximum:
            data += encode_frame(FrameType.COMPACT_TAXELS, i, payload)
    return Stream(f"compact {seed}", TO_HOST, data)
