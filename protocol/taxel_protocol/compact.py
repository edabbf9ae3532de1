"""Compact snapshots: the executable definition of their coding, and the oracle for the C implementation.

A packed frame holds its counts with a fixed number of bits. A delta frame is coded against a key frame, which is a
state (`KeyFrame`) that board and host have both derived from acknowledged snapshots. SPEC.md, "Coding of compact
snapshots", explains every step.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from taxel_protocol import compact_tables as t
from taxel_protocol.framing import crc32
from taxel_protocol.layout import pack, unpack
from taxel_protocol.limits import (
    COMPACT_KEY_FRAME,
    COMPACT_LENGTH_FINE,
    COMPACT_LENGTH_STEP,
    COMPACT_OVERHEAD_DELTA,
    COMPACT_OVERHEAD_PACKED,
    COMPACT_START_MASK,
    COMPACT_START_SHIFT,
    COMPACT_WIDTH_MASK,
)
from taxel_protocol.registers import CompactDelta, CompactPacked

_TOTAL = 1 << t.COMPACT_TOTAL_BITS
_MIDDLE = t.COMPACT_ESCAPE + t.COMPACT_CUMULATIVE[-1]
_COUNT_MAX = 0xFFFF


class CompactError(ValueError):
    """Bytes that are no valid compact snapshot, or a delta frame whose key frame is not available."""


@dataclass(frozen=True)
class Taxel:
    """Prediction for the count of one taxel: `mean` in 64ths of a count, `level` of its scale (logarithmic spread)."""

    mean: int
    level: int

    @property
    def centre(self) -> int:
        """Return the count nearest to the predicted mean of the taxel."""
        return min((self.mean + 32) >> t.COMPACT_FRACTION_BITS, _COUNT_MAX)

    @property
    def octave(self) -> int:
        """Octave of the scale (predicted spread) of the taxel's counts; octave 0 begins at 1/16 count."""
        return self.level >> 6

    @property
    def raw_bits(self) -> int:
        """Number of low bits of a count that are sent without entropy coding; 0 unless the counts vary strongly."""
        return max(self.octave - t.COMPACT_COARSE_OCTAVE, 0)

    def distance(self, difference: int) -> int:
        """Convert a difference from the predicted mean, in 64ths of a count, to 1024ths of the taxel's scale.

        The scale is the predicted spread of the counts. The result is truncated towards zero.
        """
        # The level has 64 steps per octave: bits 3 to 5 select the factor 2^(-j/8), and `octave` is the power of two.
        size = abs(difference) * t.COMPACT_MULTIPLIERS[(self.level >> 3) & 7] >> self.octave
        return size if difference >= 0 else -size

    def cumulative(self, difference: int) -> int:
        """Return the predicted probability, in units of 2^-16, that a count is below the mean plus `difference`.

        difference: in 64ths of a count. The probability of an escape code, which is first in the code space, is
        included.
        """
        distance = self.distance(difference)
        size = min(abs(distance), t.COMPACT_REACH)
        corner, fraction = size >> t.COMPACT_STEP_BITS, size & ((1 << t.COMPACT_STEP_BITS) - 1)
        # The table contains one half of the symmetric distribution; values between its corners are interpolated.
        share = t.COMPACT_CUMULATIVE[corner]
        if fraction:
            share += (t.COMPACT_CUMULATIVE[corner + 1] - share) * fraction >> t.COMPACT_STEP_BITS
        return _MIDDLE + share if distance >= 0 else _MIDDLE - share

    def interval(self, symbol: int) -> tuple[int, int]:
        """Return (first, size) of the probability interval of all counts whose upper bits equal `symbol`.

        The upper bits of a count are the bits above its `raw_bits` low bits. Unit: 2^-16 of the probability.
        """
        # From half a count (32/64) below the smallest of these counts, relative to the mean, in 64ths of a count.
        edge = (symbol << (self.raw_bits + 6)) - 32 - self.mean
        first = self.cumulative(edge)
        return first, self.cumulative(edge + (64 << self.raw_bits)) - first

    def update(self, count: int, gain: int) -> "Taxel":
        """Return the prediction for the taxel after the count of an acknowledged key frame.

        gain: weight of the new count, in 256ths. A count far from the prediction replaces the mean and keeps the level
        of the scale.
        """
        difference = 64 * (self.centre + quantise(count - self.centre)) - self.mean
        size = abs(self.distance(difference))
        if size >= t.COMPACT_JUMP:
            step, level = abs(difference), self.level
        else:
            step = (abs(difference) * gain + 128) >> 8
            # Deviation of the scale that this count alone suggests, in 1024ths of the scale; a deviation of 1 changes
            # the level (64 per octave) by COMPACT_LEVEL_STEP = 64 / ln 2. Additions before >> round to nearest.
            excess = (min(size, t.COMPACT_CLIP) * t.COMPACT_MEAN_DEVIATION >> 10) - 1024
            level_step = (abs(excess) * gain * t.COMPACT_LEVEL_STEP + (1 << 17)) >> 18
            level = self.level + level_step if excess >= 0 else self.level - level_step
        mean = self.mean + step if difference >= 0 else self.mean - step
        return Taxel(min(max(mean, 0), t.COMPACT_MEAN_MAX), min(max(level, 0), t.COMPACT_LEVEL_MAX))


def quantise(residual: int) -> int:
    """Round the difference between a count and its prediction as a board stores it in one byte.

    residual: count minus prediction. The result is exact below 64, else the middle of a quarter of an octave.
    """
    size = abs(residual)
    if size >= 64:
        quarter = size.bit_length() - 3  # a quarter of the octave of `size` has the width 2^quarter
        size = (size >> quarter << quarter) + (1 << quarter >> 1)
    return size if residual >= 0 else -size


@dataclass(frozen=True)
class KeyFrame:
    """State that board and host share after an acknowledgement; delta frames are coded against it.

    `id`: low 16 bits of the CRC-32 of the snapshot that produced this state. `updates`: number of acknowledged key
    frames since the last packed one. `taxels`: prediction for each taxel.
    """

    id: int
    timestamp_us: int
    updates: int
    taxels: tuple[Taxel, ...]


def start_key_frame(key_frame_id: int, timestamp_us: int, counts: Sequence[int], start: int = 0) -> KeyFrame:
    """Return the key frame that follows from a packed frame marked as key frame: the first predictions of the counts.

    The predicted mean of each taxel, in 64ths of a count, is its count in the frame. start: bits 5 and 6 of the frame's
    format byte, which select the first level of the scale (the logarithm of the predicted spread).
    """
    level = t.COMPACT_LEVEL_START + start * t.COMPACT_LEVEL_START_STEP
    return KeyFrame(key_frame_id, timestamp_us, 1, tuple(Taxel(64 * count, level) for count in counts))


def update_key_frame(previous: KeyFrame, key_frame_id: int, timestamp_us: int, counts: Sequence[int]) -> KeyFrame:
    """Return the key frame that follows from a delta frame marked as key frame.

    previous: the key frame against which the delta frame is coded. counts: decoded counts of the delta frame, by which
    the prediction of each taxel is updated. The gain of the update depends on the number of updates since the last
    packed key frame.
    """
    gain = t.COMPACT_GAINS[previous.updates - 1]
    taxels = tuple(taxel.update(count, gain) for taxel, count in zip(previous.taxels, counts, strict=True))
    return replace(
        previous,
        id=key_frame_id,
        timestamp_us=timestamp_us,
        updates=min(previous.updates + 1, len(t.COMPACT_GAINS)),
        taxels=taxels,
    )


class RangeEncoder:
    """Entropy coder: encodes symbols with given probabilities into bytes (range coder; Martin, 1979).

    Its low end is one large integer, so that carries need no separate handling.
    """

    def __init__(self) -> None:
        """Create a range coder with the full interval and no output."""
        self._low, self._range, self._shifted = 0, 0xFFFFFFFF, 0

    def put(self, first: int, size: int, bits: int) -> None:
        """Encode a symbol of the range coder: narrow its interval to [first, first + size) of 2^bits equal shares."""
        share = self._range >> bits
        self._low += first * share
        self._range = size * share
        while self._range < 1 << 24:  # at least 24 bits of the range are kept, for the precision of the shares
            self._low <<= 8
            self._range <<= 8
            self._shifted += 1

    def finish(self) -> bytes:
        """Return the shortest bytes that identify the interval of the range coder, without trailing zero bytes."""
        for kept in range(5):
            unit = 1 << (32 - 8 * kept)
            # The low end, rounded up to a multiple of `unit`: of its last four bytes, only the first `kept` are output.
            value = -(-self._low // unit) * unit
            if value < self._low + self._range:
                return (value // unit).to_bytes(self._shifted + kept, "big").rstrip(b"\0")
        raise AssertionError("an interval contains its own low end")


class RangeDecoder:
    """Decoder of the bytes of a `RangeEncoder`; bytes after the last one count as zero."""

    def __init__(self, data: bytes) -> None:
        """Create a range decoder for the bytes `data` of a delta frame."""
        self._data, self._position, self._range, self._code = data, 4, 0xFFFFFFFF, 0
        self._code = int.from_bytes(data[:4].ljust(4, b"\0"), "big")

    def peek(self, bits: int) -> int:
        """Return the index of the next encoded share out of 2^bits equal shares, without consuming it."""
        return min(self._code // (self._range >> bits), (1 << bits) - 1)

    def take(self, first: int, size: int, bits: int) -> None:
        """Consume the decoded symbol, the interval [first, first + size) of 2^bits equal shares of the range coder."""
        share = self._range >> bits
        self._code = (self._code - first * share) & 0xFFFFFFFF  # wraps for damaged bytes only
        self._range = size * share
        while self._range < 1 << 24:
            byte = self._data[self._position] if self._position < len(self._data) else 0
            self._code = (self._code << 8 | byte) & 0xFFFFFFFF
            self._range <<= 8
            self._position += 1

    def bits(self, count: int) -> int:
        """Decode and consume a number of `count` bits, all of whose values are equally probable."""
        value = self.peek(count)
        self.take(value, 1, count)
        return value


def encode_counts(taxels: Sequence[Taxel], counts: Sequence[int]) -> bytes:
    """Encode the counts of a delta frame with the predictions of their taxels."""
    coder = RangeEncoder()
    for taxel, count in zip(taxels, counts, strict=True):
        first, size = taxel.interval(count >> taxel.raw_bits)
        if size:
            coder.put(first, size, t.COMPACT_TOTAL_BITS)
            coder.put(count & ((1 << taxel.raw_bits) - 1), 1, taxel.raw_bits)
            continue
        residual = count - taxel.centre
        exponent = abs(residual).bit_length() - 1
        # Escape code, then exponent and sign in 5 bits, then the bits of the residual below its highest bit.
        coder.put(0, t.COMPACT_ESCAPE, t.COMPACT_TOTAL_BITS)
        coder.put(2 * exponent + (residual < 0), 1, 5)
        coder.put(abs(residual) - (1 << exponent), 1, exponent)
    return coder.finish()


def decode_counts(taxels: Sequence[Taxel], data: bytes) -> list[int]:
    """Decode the bytes of `encode_counts`. Raises `CompactError` for bytes that no encoder produces."""
    coder = RangeDecoder(data)
    return [_decode_count(taxel, coder) for taxel in taxels]


def _decode_count(taxel: Taxel, coder: RangeDecoder) -> int:
    """Decode the next count of a delta frame with the prediction of its taxel. Raises `CompactError`.

    A count far from the prediction is an escape, which contains its distance from the centre (SPEC.md).
    """
    target = coder.peek(t.COMPACT_TOTAL_BITS)
    if target < t.COMPACT_ESCAPE:
        coder.take(0, t.COMPACT_ESCAPE, t.COMPACT_TOTAL_BITS)
        exponent, negative = divmod(coder.bits(5), 2)
        size = (1 << exponent) + coder.bits(exponent)
        count = taxel.centre - size if negative else taxel.centre + size
        if not 0 <= count <= _COUNT_MAX:
            raise CompactError(f"a raw count is 0 to {_COUNT_MAX}, found {count}")
        return count
    # Search for the last symbol whose interval begins at or below `target`.
    low, high = 0, _COUNT_MAX >> taxel.raw_bits
    while low < high:
        middle = (low + high + 1) // 2
        low, high = (middle, high) if taxel.interval(middle)[0] <= target else (low, middle - 1)
    first, size = taxel.interval(low)
    if not first <= target < first + size:
        raise CompactError("the coded counts contain a probability share that belongs to no count")
    coder.take(first, size, t.COMPACT_TOTAL_BITS)
    return low << taxel.raw_bits | coder.bits(taxel.raw_bits)


def pack_counts(counts: Sequence[int], width: int) -> bytes:
    """Pack counts of `width` bits each into bytes, lowest bits first."""
    number = sum(count << (width * i) for i, count in enumerate(counts))
    return number.to_bytes((width * len(counts) + 7) // 8, "little")


def _with_crc(address: int, body: bytes) -> bytes:
    """Append the CRC-32 of address and body to a compact frame, after zero bytes up to an encodable length."""
    size = len(body) + 4
    if size >= COMPACT_LENGTH_FINE:
        body += bytes(-size % COMPACT_LENGTH_STEP)
    return body + crc32(body, crc32(bytes([address]))).to_bytes(4, "little")


def encode_packed(
    address: int, sequence: int, timestamp_us: int, counts: Sequence[int], is_key_frame: bool, start: int = 0
) -> bytes:
    """Encode a snapshot as a packed frame, whose counts have a fixed number of bits: bytes from `sequence` to `crc32`.

    is_key_frame: sets the flag COMPACT_KEY_FRAME of the format byte, which requests an acknowledgement. start: value of
    the start bits of the format byte.
    """
    width = max(max(counts).bit_length(), 1)
    format_byte = width | start << COMPACT_START_SHIFT | (COMPACT_KEY_FRAME if is_key_frame else 0)
    header = {"sequence": sequence, "format": format_byte, "timestamp_us": timestamp_us}
    return _with_crc(address, pack(CompactPacked, header, pack_counts(counts, width)))


def encode(
    address: int, sequence: int, timestamp_us: int, counts: Sequence[int], previous: KeyFrame | None, is_key_frame: bool
) -> bytes:
    """Encode a snapshot as the shorter of a packed frame and a delta frame: bytes from `sequence` to `crc32`.

    previous: key frame of the delta frame; None: a packed frame. is_key_frame: request an acknowledgement.
    """
    packed = encode_packed(address, sequence, timestamp_us, counts, is_key_frame)
    # A delta frame contains only the lowest 24 bits of the time, in microseconds.
    if previous is None or (timestamp_us - previous.timestamp_us) % (1 << 32) >= 1 << 24:
        return packed
    coded = encode_counts(previous.taxels, counts)
    width = max(max(counts).bit_length(), 1)
    if COMPACT_OVERHEAD_DELTA + len(coded) > COMPACT_OVERHEAD_PACKED + (width * len(counts) + 7) // 8:
        return packed
    header = {
        "sequence": sequence,
        "format": COMPACT_KEY_FRAME if is_key_frame else 0,
        "key_frame": previous.id,
        "timestamp_low": (timestamp_us & 0xFFFFFF).to_bytes(3, "little"),
    }
    return _with_crc(address, pack(CompactDelta, header, coded))


@dataclass(frozen=True)
class Decoded:
    """A decoded compact snapshot; `key_frame`: the key frame that it produces, None if it is not marked as one."""

    sequence: int
    timestamp_us: int
    counts: list[int]
    key_frame: KeyFrame | None


def decode(address: int, taxel_count: int, data: bytes, key_frames: Sequence[KeyFrame]) -> Decoded:
    """Decode a compact snapshot, the bytes `data` from `sequence` to `crc32`.

    address: I2C address of the board, part of the CRC. key_frames: available key frames of the board. Raises
    `CompactError` if the bytes are damaged or invalid, or if the snapshot is a delta frame whose key frame is not in
    `key_frames`.
    """
    if (
        len(data) < COMPACT_OVERHEAD_DELTA
        or crc32(data[:-4], crc32(bytes([address]))).to_bytes(4, "little") != data[-4:]
    ):
        raise CompactError("the CRC-32 of a compact snapshot is wrong")
    own_id = int.from_bytes(data[-4:-2], "little")  # id of this snapshot as a key frame: low 16 bits of its CRC-32
    format_byte = data[2]
    width = format_byte & COMPACT_WIDTH_MASK
    start = (format_byte & COMPACT_START_MASK) >> COMPACT_START_SHIFT
    is_key_frame = bool(format_byte & COMPACT_KEY_FRAME)
    if width > 16 or (start and not (width and is_key_frame)):
        raise CompactError(f"format 0x{format_byte:02X} of a compact snapshot is not defined")
    if width:
        head, tail = unpack(CompactPacked, data[:-4])
        size = (width * taxel_count + 7) // 8
        if len(tail) < size:
            raise CompactError(f"{taxel_count} counts of {width} bits are {size} bytes, found {len(tail)}")
        number = int.from_bytes(tail[:size], "little")
        counts = [number >> (width * i) & ((1 << width) - 1) for i in range(taxel_count)]
        time = head["timestamp_us"]
        key_frame = start_key_frame(own_id, time, counts, start) if is_key_frame else None
        return Decoded(head["sequence"], time, counts, key_frame)
    head, tail = unpack(CompactDelta, data[:-4])
    matching = [k for k in key_frames if k.id == head["key_frame"] and len(k.taxels) == taxel_count]
    if not matching:
        raise CompactError(f"key frame 0x{head['key_frame']:04X} is not available")
    previous = matching[0]
    counts = decode_counts(previous.taxels, tail)
    low = int.from_bytes(head["timestamp_low"], "little")
    # The first time after the key frame whose lowest 24 bits are `low`; the clock of a board has 32 bits.
    time = (previous.timestamp_us + (low - previous.timestamp_us) % (1 << 24)) % (1 << 32)
    return Decoded(
        head["sequence"],
        time,
        counts,
        update_key_frame(previous, own_id, time, counts) if is_key_frame else None,
    )
