"""Compact snapshots, slowly and plainly: the definition of their code, and the oracle for the C implementation.

`Reference` is what board and host know alike; `encode` and `decode` go between a snapshot and its bytes. SPEC.md, "The
code of compact snapshots", explains every step.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from taxel_protocol import compact_tables as t
from taxel_protocol.framing import crc32
from taxel_protocol.layout import pack, unpack
from taxel_protocol.limits import (
    COMPACT_CANDIDATE,
    COMPACT_LENGTH_FINE,
    COMPACT_LENGTH_STEP,
    COMPACT_OVERHEAD_CODED,
    COMPACT_OVERHEAD_MIN,
    COMPACT_START_MASK,
    COMPACT_START_SHIFT,
    COMPACT_WIDTH_MASK,
)
from taxel_protocol.registers import CompactCoded, CompactPacked

_TOTAL = 1 << t.COMPACT_TOTAL_BITS
_MIDDLE = t.COMPACT_ESCAPE + t.COMPACT_CUMULATIVE[-1]
_COUNT_MAX = 0xFFFF


class CompactError(ValueError):
    """Bytes that are no compact snapshot, or none that this reference decodes."""


@dataclass(frozen=True)
class Taxel:
    """What is expected of one taxel: `mean` in 64ths of a count, `level` of its scale."""

    mean: int
    level: int

    @property
    def centre(self) -> int:
        """The count nearest to the mean."""
        return min((self.mean + 32) >> t.COMPACT_FRACTION_BITS, _COUNT_MAX)

    @property
    def octave(self) -> int:
        """Of the scale, from 1/16 count upwards."""
        return self.level >> 6

    @property
    def raw_bits(self) -> int:
        """Low bits of a count that are sent as they are."""
        return max(self.octave - t.COMPACT_COARSE_OCTAVE, 0)

    def distance(self, difference: int) -> int:
        """1024ths of the scale in a difference of 64ths of a count, cut towards zero."""
        size = abs(difference) * t.COMPACT_MULTIPLIERS[(self.level >> 3) & 7] >> self.octave
        return size if difference >= 0 else -size

    def cumulative(self, difference: int) -> int:
        """Probability, in 2^-16, of an escape or of anything below mean + difference."""
        distance = self.distance(difference)
        size = min(abs(distance), t.COMPACT_REACH)
        corner, rest = size >> t.COMPACT_STEP_BITS, size & ((1 << t.COMPACT_STEP_BITS) - 1)
        share = t.COMPACT_CUMULATIVE[corner]
        if rest:
            share += (t.COMPACT_CUMULATIVE[corner + 1] - share) * rest >> t.COMPACT_STEP_BITS
        return _MIDDLE + share if distance >= 0 else _MIDDLE - share

    def interval(self, symbol: int) -> tuple[int, int]:
        """(first, size) of the share of probability of all counts with `symbol` above their raw bits."""
        edge = (symbol << (self.raw_bits + 6)) - 32 - self.mean
        first = self.cumulative(edge)
        return first, self.cumulative(edge + (64 << self.raw_bits)) - first

    def learn(self, count: int, gain: int) -> "Taxel":
        """What is expected after a candidate's `count`; `gain` in 256ths."""
        difference = 64 * (self.centre + coarse(count - self.centre)) - self.mean
        size = abs(self.distance(difference))
        if size >= t.COMPACT_JUMP:
            moved, level = abs(difference), self.level
        else:
            moved = (abs(difference) * gain + 128) >> 8
            excess = (min(size, t.COMPACT_CLIP) * t.COMPACT_MEAN_DEVIATION >> 10) - 1024
            steps = (abs(excess) * gain * t.COMPACT_LEVEL_STEP + (1 << 17)) >> 18
            level = self.level + steps if excess >= 0 else self.level - steps
        mean = self.mean + moved if difference >= 0 else self.mean - moved
        return Taxel(min(max(mean, 0), t.COMPACT_MEAN_MAX), min(max(level, 0), t.COMPACT_LEVEL_MAX))


def coarse(residual: int) -> int:
    """A residual as a board remembers it in one byte: exact below 64, else the middle of a quarter of an octave."""
    size = abs(residual)
    if size >= 64:
        quarter = size.bit_length() - 3
        size = (size >> quarter << quarter) + (1 << quarter >> 1)
    return size if residual >= 0 else -size


@dataclass(frozen=True)
class Reference:
    """What an acknowledged candidate left on both sides. `name`: low 16 bits of its CRC-32; `updates`: candidates since
    the beginning.
    """

    name: int
    timestamp_us: int
    updates: int
    taxels: tuple[Taxel, ...]


def begin(name: int, timestamp_us: int, counts: Sequence[int], start: int = 0) -> Reference:
    """The reference that a packed candidate makes; `start`: bits 5 and 6 of its form."""
    level = t.COMPACT_LEVEL_START + start * t.COMPACT_LEVEL_START_STEP
    return Reference(name, timestamp_us, 1, tuple(Taxel(64 * count, level) for count in counts))


def go_on(reference: Reference, name: int, timestamp_us: int, counts: Sequence[int]) -> Reference:
    """The reference that a coded candidate makes out of its own."""
    gain = t.COMPACT_GAINS[reference.updates - 1]
    taxels = tuple(taxel.learn(count, gain) for taxel, count in zip(reference.taxels, counts, strict=True))
    return replace(
        reference,
        name=name,
        timestamp_us=timestamp_us,
        updates=min(reference.updates + 1, len(t.COMPACT_GAINS)),
        taxels=taxels,
    )


class RangeEncoder:
    """A range coder (Martin, 1979) whose low end is one large number, so that no carry needs care."""

    def __init__(self) -> None:
        self._low, self._range, self._shifted = 0, 0xFFFFFFFF, 0

    def put(self, first: int, size: int, bits: int) -> None:
        """Narrow to [first, first + size) of 2^bits equal shares."""
        share = self._range >> bits
        self._low += first * share
        self._range = size * share
        while self._range < 1 << 24:
            self._low <<= 8
            self._range <<= 8
            self._shifted += 1

    def finish(self) -> bytes:
        """The shortest string of bytes that stands for the interval; zeros at the end are left out."""
        for kept in range(5):
            unit = 1 << (32 - 8 * kept)
            value = -(-self._low // unit) * unit
            if value < self._low + self._range:
                return (value // unit).to_bytes(self._shifted + kept, "big").rstrip(b"\0")
        raise AssertionError("an interval holds its own low end")


class RangeDecoder:
    """Inverse of `RangeEncoder`; zeros follow the last byte."""

    def __init__(self, data: bytes) -> None:
        self._data, self._position, self._range, self._code = data, 4, 0xFFFFFFFF, 0
        self._code = int.from_bytes(data[:4].ljust(4, b"\0"), "big")

    def peek(self, bits: int) -> int:
        """Which of 2^bits equal shares comes next."""
        return min(self._code // (self._range >> bits), (1 << bits) - 1)

    def take(self, first: int, size: int, bits: int) -> None:
        """Take [first, first + size) of 2^bits shares off."""
        share = self._range >> bits
        self._code = (self._code - first * share) & 0xFFFFFFFF  # wraps for damaged bytes only
        self._range = size * share
        while self._range < 1 << 24:
            byte = self._data[self._position] if self._position < len(self._data) else 0
            self._code = (self._code << 8 | byte) & 0xFFFFFFFF
            self._range <<= 8
            self._position += 1

    def bits(self, count: int) -> int:
        """A number of `count` bits."""
        value = self.peek(count)
        self.take(value, 1, count)
        return value


def encode_counts(taxels: Sequence[Taxel], counts: Sequence[int]) -> bytes:
    """The coded counts."""
    coder = RangeEncoder()
    for taxel, count in zip(taxels, counts, strict=True):
        first, size = taxel.interval(count >> taxel.raw_bits)
        if size:
            coder.put(first, size, t.COMPACT_TOTAL_BITS)
            coder.put(count & ((1 << taxel.raw_bits) - 1), 1, taxel.raw_bits)
            continue
        residual = count - taxel.centre
        exponent = abs(residual).bit_length() - 1
        coder.put(0, t.COMPACT_ESCAPE, t.COMPACT_TOTAL_BITS)
        coder.put(2 * exponent + (residual < 0), 1, 5)
        coder.put(abs(residual) - (1 << exponent), 1, exponent)
    return coder.finish()


def decode_counts(taxels: Sequence[Taxel], data: bytes) -> list[int]:
    """Inverse of `encode_counts`. Raises `CompactError` for what no encoder makes."""
    coder = RangeDecoder(data)
    return [_decode_count(taxel, coder) for taxel in taxels]


def _decode_count(taxel: Taxel, coder: RangeDecoder) -> int:
    target = coder.peek(t.COMPACT_TOTAL_BITS)
    if target < t.COMPACT_ESCAPE:
        coder.take(0, t.COMPACT_ESCAPE, t.COMPACT_TOTAL_BITS)
        exponent, negative = divmod(coder.bits(5), 2)
        size = (1 << exponent) + coder.bits(exponent)
        count = taxel.centre - size if negative else taxel.centre + size
        if not 0 <= count <= _COUNT_MAX:
            raise CompactError(f"a count of {count} does not exist")
        return count
    low, high = 0, _COUNT_MAX >> taxel.raw_bits
    while low < high:
        middle = (low + high + 1) // 2
        low, high = (middle, high) if taxel.interval(middle)[0] <= target else (low, middle - 1)
    first, size = taxel.interval(low)
    if not first <= target < first + size:
        raise CompactError("a share of probability that belongs to no count")
    coder.take(first, size, t.COMPACT_TOTAL_BITS)
    return low << taxel.raw_bits | coder.bits(taxel.raw_bits)


def pack_counts(counts: Sequence[int], width: int) -> bytes:
    """Counts of `width` bits each, lowest bits first."""
    number = sum(count << (width * i) for i, count in enumerate(counts))
    return number.to_bytes((width * len(counts) + 7) // 8, "little")


def length_of(size: int) -> int:
    """First byte on the bus for a compact snapshot of at least `size` bytes."""
    if size < COMPACT_LENGTH_FINE:
        return size
    return COMPACT_LENGTH_FINE + -(-size // COMPACT_LENGTH_STEP)


def _sealed(address: int, body: bytes) -> bytes:
    size = len(body) + 4
    if size >= COMPACT_LENGTH_FINE:
        body += bytes(-size % COMPACT_LENGTH_STEP)
    return body + crc32(body, crc32(bytes([address]))).to_bytes(4, "little")


def encode_packed(
    address: int, sequence: int, timestamp_us: int, counts: Sequence[int], candidate: bool, start: int = 0
) -> bytes:
    """A compact snapshot that needs no reference."""
    width = max(max(counts).bit_length(), 1)
    form = width | start << COMPACT_START_SHIFT | (COMPACT_CANDIDATE if candidate else 0)
    head = {"sequence": sequence, "form": form, "timestamp_us": timestamp_us}
    return _sealed(address, pack(CompactPacked, head, pack_counts(counts, width)))


def encode(
    address: int, sequence: int, timestamp_us: int, counts: Sequence[int], reference: Reference | None, candidate: bool
) -> bytes:
    """The shorter of packed and coded, the bytes from `sequence` to `crc32`; `reference` None: packed."""
    packed = encode_packed(address, sequence, timestamp_us, counts, candidate)
    if reference is None or (timestamp_us - reference.timestamp_us) % (1 << 32) >= 1 << 24:
        return packed
    coded = encode_counts(reference.taxels, counts)
    width = max(max(counts).bit_length(), 1)
    if COMPACT_OVERHEAD_CODED + len(coded) > COMPACT_OVERHEAD_MIN + (width * len(counts) + 7) // 8:
        return packed
    head = {
        "sequence": sequence,
        "form": COMPACT_CANDIDATE if candidate else 0,
        "reference": reference.name,
        "timestamp_low": (timestamp_us & 0xFFFFFF).to_bytes(3, "little"),
    }
    return _sealed(address, pack(CompactCoded, head, coded))


@dataclass(frozen=True)
class Decoded:
    """A snapshot, and the reference that it makes if it is a candidate."""

    sequence: int
    timestamp_us: int
    counts: list[int]
    candidate: Reference | None


def decode(address: int, taxel_count: int, data: bytes, references: Sequence[Reference]) -> Decoded:
    """The snapshot in `data` (from `sequence` to `crc32`). Raises `CompactError`: damaged, none, or none of
    `references` is its own.
    """
    if (
        len(data) < COMPACT_OVERHEAD_CODED
        or crc32(data[:-4], crc32(bytes([address]))).to_bytes(4, "little") != data[-4:]
    ):
        raise CompactError("the CRC is wrong")
    name = int.from_bytes(data[-4:-2], "little")
    form = data[2]
    width = form & COMPACT_WIDTH_MASK
    start = (form & COMPACT_START_MASK) >> COMPACT_START_SHIFT
    if width > 16 or (start and not (width and form & COMPACT_CANDIDATE)):
        raise CompactError(f"form 0x{form:02X} does not exist")
    if width:
        head, rest = unpack(CompactPacked, data[:-4])
        size = (width * taxel_count + 7) // 8
        if len(rest) < size:
            raise CompactError(f"{taxel_count} counts of {width} bits are {size} bytes, found {len(rest)}")
        number = int.from_bytes(rest[:size], "little")
        counts = [number >> (width * i) & ((1 << width) - 1) for i in range(taxel_count)]
        time = head["timestamp_us"]
        return Decoded(
            head["sequence"], time, counts, begin(name, time, counts, start) if form & COMPACT_CANDIDATE else None
        )
    head, rest = unpack(CompactCoded, data[:-4])
    known = [r for r in references if r.name == head["reference"] and len(r.taxels) == taxel_count]
    if not known:
        raise CompactError(f"reference 0x{head['reference']:04X} is not known")
    counts = decode_counts(known[0].taxels, rest)
    low = int.from_bytes(head["timestamp_low"], "little")
    time = (known[0].timestamp_us + (low - known[0].timestamp_us) % (1 << 24)) % (1 << 32)
    return Decoded(
        head["sequence"], time, counts, go_on(known[0], name, time, counts) if form & COMPACT_CANDIDATE else None
    )
