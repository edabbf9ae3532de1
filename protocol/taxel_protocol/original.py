"""Messages of the original hub, the hub of the thesis's author: board tables, formats and construct definitions.

A message has no CRC, no sequence number and no byte stuffing. `SPEC.md`, part 7, gives the layouts, the framing rule
and the damage that a receiver cannot detect; `original_stream` decodes streams. Sources: the author's public firmware
projects (2021) and ROS host (2023).
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from construct import Array, Bytes, Const, Construct, Int8ul, Int16sb, Int16sl, Int16ub, Int16ul, Int32ub, Struct

START = 0x01
"""First byte of every framed message; the value also occurs inside messages."""

END = 0x0A
"""Last byte of every framed message (line feed); the value also occurs inside messages."""

HEADER_SIZE = 3
"""Bytes of start, length and address: the part of a message that is fixed for each board."""

TIMESTAMP_SIZE = 4
ADDRESSES = 128
"""Number of 7-bit I2C addresses."""

WORDS_MAX = 125
"""Largest number of 16-bit words of a message: its length field has 8 bits (123 words with a timestamp)."""

ACCELERATIONS = 3
"""Accelerations (x, y, z) that the older fingertip messages carry after the counts."""

RECORD_SIZE = 50
"""Bytes of an unframed fingertip record."""

RECORD_ADDRESS = 0x08
"""Address of the only board of the unframed fingertip records."""

REFERENCE_TIMES = 4
"""Number of earlier messages with which the time of a candidate is compared. One reference would be lost with one
damaged timestamp; each further reference increases the share of random timestamps that pass."""

TIME_STEP_MAX_MS = 60_000
"""Largest plausible step in ms from an earlier message. Origin: the share (REFERENCE_TIMES + 1) * 60001 / 2^32 = 7.0e-5
of random timestamps passes, and a pause of up to a minute keeps the times plausible. A larger value permits longer
pauses and lets more random timestamps pass."""

TAXELS: dict[int, int] = dict(
    zip(
        range(0x08, 0x1E),
        (65, 30, 78, 66, 27, 65, 30, 78, 66, 31, 65, 47, 78, 121, 118, 66, 27, 65, 30, 78, 66, 27),
        strict=True,
    )
)
"""Taxels of each board of the later (thesis) generation by I2C address: 22 boards, 1,324 taxels. 0x10 to 0x14 belong to
the thumb, 0x15 is the palm, 0x16 the back of the hand."""

FITTED: tuple[int, ...] = tuple(address for address in TAXELS if not 0x10 <= address <= 0x14)
"""Addresses of the 17 boards that were fitted to the hand: 1,037 taxels."""

PUBLISHED: tuple[int, ...] = tuple(address for address in FITTED if address not in (0x0B, 0x17))
"""Addresses of the 15 boards that the original host published: 905 taxels. The host dropped two unstable fingertips."""

FINGERTIPS: tuple[int, ...] = (0x0B, 0x10, 0x17, 0x1C)
"""Addresses of the fingertips, in both generations."""

READ_SEQUENCE: tuple[int, ...] = (*range(0x17, 0x1E), *range(0x08, 0x17))
"""Order in which the hub's firmware of 2021 reads the boards. The order of the later hub is not published."""

FIRST_GENERATION_TAXELS: dict[int, int] = dict(
    zip(
        range(0x08, 0x1E),
        (6, 6, 15, 14, 6, 6, 6, 15, 14, 6, 6, 6, 6, 20, 25, 14, 6, 6, 6, 15, 14, 6),
        strict=True,
    )
)
"""Taxels of each board of the first generation by I2C address: 22 boards, 224 taxels."""

EARLY_ADDRESSES: dict[int, int] = {early: 0x16 + early for early in range(0x01, 0x08)}
"""Addresses 0x01 to 0x07, which I2C reserves, of seven boards before 2021-09-27, and their later addresses."""


@dataclass(frozen=True)
class OriginalFormat:
    """One variant of the message of the original hub.

    taxels: number of taxels by I2C address; other addresses are not accepted. has_timestamp: a timestamp follows the
    address. is_big_endian: counts are sent high byte first. accelerated: addresses whose messages carry three
    accelerations after the counts. record_size: length in bytes of a record without any frame; 0: messages are framed.
    """

    name: str
    taxels: Mapping[int, int]
    has_timestamp: bool = True
    is_big_endian: bool = False
    accelerated: tuple[int, ...] = ()
    record_size: int = 0
    lengths: Mapping[int, int] = field(init=False, repr=False, compare=False)
    """Length of a complete message in bytes by address."""

    def __post_init__(self) -> None:
        """Compute the message length of each board.

        Raises ValueError for a board whose message length does not fit the 8-bit length field.
        """
        lengths = {address: self._compute_length(address) for address in self.taxels}
        for address, length in lengths.items():
            if not 0 <= address < ADDRESSES or self.taxels[address] < 1 or length > 0xFF:
                raise ValueError(
                    f"board 0x{address:02X}: expected a 7-bit address, 1 taxel or more and a message of at most"
                    f" 255 bytes, found {self.taxels[address]} taxels and {length} bytes"
                )
        object.__setattr__(self, "lengths", lengths)

    def _compute_length(self, address: int) -> int:
        """Return the length of a complete message of the board at `address`, bytes.

        A record without a frame (`record_size` above 0) has this fixed length.
        """
        if self.record_size:
            return self.record_size
        words = self.taxels[address] + ACCELERATIONS * (address in self.accelerated)
        return self.counts_offset + 2 * words + 1

    @property
    def counts_offset(self) -> int:
        """Offset of the first count in a message, in bytes; 0 in a record without a frame (`record_size` above 0)."""
        if self.record_size:
            return 0
        return HEADER_SIZE + TIMESTAMP_SIZE * self.has_timestamp

    def select(self, addresses: Iterable[int]) -> "OriginalFormat":
        """Return this message format with a part of its boards.

        Raises KeyError for an address that the format lacks.
        """
        taxels = {address: self.taxels[address] for address in addresses}
        accelerated = tuple(address for address in self.accelerated if address in taxels)
        return OriginalFormat(self.name, taxels, self.has_timestamp, self.is_big_endian, accelerated, self.record_size)


FORMATS: dict[str, OriginalFormat] = {
    known.name: known
    for known in (
        OriginalFormat("original", TAXELS),
        OriginalFormat("original_accelerations", TAXELS, accelerated=FINGERTIPS),
        OriginalFormat("first_generation", FIRST_GENERATION_TAXELS),
        OriginalFormat("first_generation_test", FIRST_GENERATION_TAXELS, is_big_endian=True),
        OriginalFormat(
            "first_generation_untimed",
            FIRST_GENERATION_TAXELS | {early: FIRST_GENERATION_TAXELS[a] for early, a in EARLY_ADDRESSES.items()},
            has_timestamp=False,
        ),
        OriginalFormat(
            "fingertip_records", {RECORD_ADDRESS: RECORD_SIZE // 2}, has_timestamp=False, record_size=RECORD_SIZE
        ),
    )
}
"""Every variant by its name. `original` is the format of the thesis's hand."""

Timestamped = Struct(
    "start" / Const(START, Int8ul),
    "length" / Int8ul,
    "address" / Int8ul,
    "timestamp_ms" / Int32ub,
)
"""Header of a message with a timestamp. length: whole message, start and end included. timestamp_ms: time since the
start of the hub, big-endian, at which the hub built the message."""

Untimed = Struct(
    "start" / Const(START, Int8ul),
    "length" / Int8ul,
    "address" / Int8ul,
)
"""Header of a message without a timestamp."""


def define_message(message_format: OriginalFormat, address: int) -> Construct:
    """Return the construct definition of a complete message of a board. Raises KeyError for an unknown address.

    Fields: start, length, address, timestamp_ms, counts, accelerations, end, as far as the format has them. A format
    with a `record_size` has records without a frame, which consist of the counts alone.
    """
    count = Int16ub if message_format.is_big_endian else Int16ul
    counts = "counts" / Array(message_format.taxels[address], count)
    if message_format.record_size:
        return Struct(counts)
    fields = [
        "start" / Const(START, Int8ul),
        "length" / Const(message_format.lengths[address], Int8ul),
        "address" / Const(address, Int8ul),
    ]
    if message_format.has_timestamp:
        fields.append("timestamp_ms" / Int32ub)
    fields.append(counts)
    if address in message_format.accelerated:
        fields.append("accelerations" / Array(ACCELERATIONS, Int16sb if message_format.is_big_endian else Int16sl))
    return Struct(*fields, "end" / Const(bytes([END]), Bytes(1)))


@dataclass(frozen=True, slots=True)
class OriginalMessage:
    """One decoded message.

    timestamp_ms: hub's clock, None in formats without a timestamp. counts: raw counts in taxel order. accelerations:
    three signed numbers, or empty. position: offset of the first byte in the stream. is_time_plausible: the timestamp
    follows one of the last four messages by at most TIME_STEP_MAX_MS, or the hub started less than this time ago;
    False after a longer pause, at the start of a stream, for most damaged timestamps, and without timestamps.
    """

    address: int
    timestamp_ms: int | None
    counts: tuple[int, ...]
    accelerations: tuple[int, ...] = ()
    position: int = 0
    is_time_plausible: bool = False


def encode_message(
    message_format: OriginalFormat,
    address: int,
    counts: Sequence[int],
    timestamp_ms: int = 0,
    accelerations: Sequence[int] = (),
) -> bytes:
    """Encode one message as the original hub sends it.

    Raises KeyError for an address that the format does not have, and construct's errors for a wrong number of counts or
    a number out of range.
    """
    values = {"counts": list(counts), "timestamp_ms": timestamp_ms, "accelerations": list(accelerations)}
    return bytes(define_message(message_format, address).build(values))


def parse_message(message_format: OriginalFormat, address: int, data: bytes) -> OriginalMessage:
    """Parse the message at the start of `data` with construct. Raises construct's errors if no message begins there."""
    fields = define_message(message_format, address).parse(data)
    return OriginalMessage(
        address,
        fields.get("timestamp_ms"),
        tuple(fields.counts),
        tuple(fields.get("accelerations", ())),
    )
