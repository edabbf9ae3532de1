"""Streams of an original hub with known content: messages, damage, and the losses that a receiver can count."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from taxel.link import Chunk, LinkError
from taxel_protocol.original import FORMATS, PUBLISHED, READ_SEQUENCE, OriginalFormat, encode_message

ORDER = tuple(address for address in READ_SEQUENCE if address in PUBLISHED)
BYTE_MS = 10e3 / 115200


@dataclass(frozen=True)
class SentMessage:
    """A message of a synthesised stream, with the poll cycle to which it belongs."""

    address: int
    cycle: int
    data: bytes


def synthesise_messages(
    cycles: int,
    seed: int = 1,
    order: Sequence[int] = ORDER,
    message_format: OriginalFormat = FORMATS["original"],
    pause_ms: float = 0.0,
    not_sent: Iterable[tuple[int, int]] = (),
    time_ms: float = 120_000.0,
) -> list[SentMessage]:
    """Synthesise the messages of a hub that reads its boards in `order`, with random counts.

    pause_ms: pause of the hub after each cycle. not_sent: (cycle, address) of the messages that the hub does not send.
    time_ms: timestamp of the first message.
    """
    rng = np.random.default_rng(seed)
    skipped = set(not_sent)
    messages = []
    for cycle in range(cycles):
        for address in order:
            if (cycle, address) not in skipped:
                counts = rng.integers(1200, 2000, message_format.taxels[address]).tolist()
                data = encode_message(message_format, address, counts, round(time_ms) % (1 << 32))
                messages.append(SentMessage(address, cycle, data))
                time_ms += len(data) * BYTE_MS
        time_ms += pause_ms
    return messages


def join_messages(messages: Iterable[SentMessage]) -> bytes:
    """Return the bytes of successive messages."""
    return b"".join(message.data for message in messages)


class BytesLink:
    """A recorded link with given bytes, in pieces of `size` bytes."""

    name = "bytes"
    is_real_time = False
    is_recorded = True
    has_flow_control = False
    has_arrivals = False
    baud = 115200.0

    def __init__(self, data: bytes, size: int = 700) -> None:
        """Create a link that returns `data` in pieces of `size` bytes."""
        self._data = data
        self._size = size

    def read(self, timeout_s: float) -> Chunk:
        """Return the next piece."""
        piece, self._data = self._data[: self._size], self._data[self._size :]
        if not piece:
            raise EOFError
        return Chunk(piece, 0)

    def write(self, data: bytes) -> None:
        """Reject commands as a recording does."""
        raise LinkError(self.name, "is a recording")

    def close(self) -> None:
        """Do nothing."""


def damage_bytes(messages: Sequence[SentMessage], share: float, seed: int) -> tuple[bytes, list[bool]]:
    """Damage a share of all bytes: changed, dropped, or preceded by an inserted byte, each with equal probability.

    Returns the received bytes, and whether each message arrived undamaged.
    """
    changed, dropped, preceded, undamaged = range(4)
    rng = np.random.default_rng(seed)
    pieces: list[bytes] = []
    is_undamaged: list[bool] = []
    for message in messages:
        received = bytearray()
        hits = rng.random(len(message.data)) < share
        for byte, is_hit in zip(message.data, hits.tolist(), strict=True):
            damage = int(rng.integers(3)) if is_hit else undamaged
            if damage == changed:
                received.append((byte + int(rng.integers(1, 256))) % 256)
            elif damage == preceded:
                received += bytes([int(rng.integers(256)), byte])
            elif damage != dropped:
                received.append(byte)
        pieces.append(bytes(received))
        is_undamaged.append(not hits.any())
    return b"".join(pieces), is_undamaged
