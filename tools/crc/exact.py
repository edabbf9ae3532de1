"""Error patterns that CRC-32 cannot see at the lengths of our frames: counted, not sampled.

python tools/crc/exact.py

An error pattern is invisible to a CRC when its polynomial is a multiple of the generator, whatever the data. A
pattern may be shifted, so it is enough to look at those that contain bit 0, and to count where they fit (Koopman,
"32-bit cyclic redundancy codes for Internet applications", DSN 2002, whose break points are verified here).
"""

import argparse
import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from taxel.types import WordArray
from taxel_protocol.frames import FRAMES
from taxel_protocol.limits import (
    ADDRESS_MAX,
    ADDRESS_MIN,
    BODY_MAX,
    FRAME_CRC_SIZE,
    FRAME_HEADER_SIZE,
    SNAPSHOT_OVERHEAD,
)
from taxel_protocol.names import FrameType

GENERATOR = 0x04C11DB7
"""x^32 is implied (IEEE 802.3, clause 3.2.9)."""

BREAK_POINTS = {9: 67, 8: 90, 7: 124, 6: 204, 5: 301, 4: 3007}
"""Shortest code word, in bits, that hides a pattern of so many (Koopman 2002, table 1: data bits + 32 + 1)."""

LENGTHS = (11, 15, 16, 25, 26, 37, 38, 75, 153, 252, 375, 376, 507)
"""Bodies to print, in bytes: the break points, our shortest, average and longest taxel frame."""

SECONDS_PER_YEAR = 365.25 * 86400

BYTE_RATE = 100_000
"""Bytes a second of a UART at 1 Mbaud with a start and a stop bit."""


def bit_syndromes(count: int) -> WordArray:
    """x^i modulo the generator, for i below `count`; bit 0 is the last one on the wire."""
    values = np.empty(count, np.uint32)
    state = 1
    for i in range(count):
        values[i] = state
        state = (state << 1) ^ ((0x100000000 | GENERATOR) if state & 0x80000000 else 0)
    return values


def sums(syndromes: WordArray, size: int) -> WordArray:
    """XOR of every subset of `size` syndromes, in colexicographic order: by the largest index first."""
    values = syndromes
    for k in range(2, size + 1):
        parts = [values[: math.comb(j, k - 1)] ^ syndromes[j] for j in range(len(syndromes))]
        values = np.concatenate(parts)
    return values


def largest_index(order: int, size: int, count: int) -> int:
    """Largest index of the subset at place `order` of `sums` over `count` syndromes."""
    return next(j for j in range(count) if math.comb(j + 1, size) > order)


def shortest_word(weight: int, bits: int) -> int | None:
    """Bits of the shortest code word with an invisible pattern of `weight` bits, up to `bits`; None if there is none.

    Right only while no pattern of weight - 2 fits into `bits`: two halves that share a bit would pass for one.
    """
    syndromes = bit_syndromes(bits)
    left_size = (weight - 1) // 2
    right_size = weight - 1 - left_size
    left = sums(syndromes[1:], left_size) ^ syndromes[0]
    right = sums(syndromes[1:], right_size)
    common = np.intersect1d(left, right)
    spans = []
    for value in common:
        for i in np.flatnonzero(left == value):
            for j in np.flatnonzero(right == value):
                last = max(largest_index(int(i), left_size, bits), largest_index(int(j), right_size, bits))
                spans.append(last + 2)
    return min(spans, default=None)


def four_bit_spans(bits: int) -> NDArray[np.int64]:
    """spans[n]: invisible four-bit patterns that contain bit 0 and bit n - 1."""
    syndromes = bit_syndromes(bits)
    order = np.argsort(syndromes)
    ordered = syndromes[order]
    spans = np.zeros(bits + 1, np.int64)
    for j in range(2, bits):
        wanted = syndromes[1:j] ^ syndromes[0] ^ syndromes[j]
        place = np.minimum(np.searchsorted(ordered, wanted), bits - 1)
        others = order[place[ordered[place] == wanted]]
        np.add.at(spans, others[others > j] + 1, 1)
    return spans


def burst_rank() -> int:
    """Rank of 32 neighbouring bit syndromes; 32 means that no burst of up to 32 bits is invisible."""
    rows = [int(value) for value in bit_syndromes(32)]
    rank = 0
    for bit in reversed(range(32)):
        pivot = next((row for row in rows if row >> bit & 1), None)
        if pivot is not None:
            rows.remove(pivot)
            rows = [row ^ pivot if row >> bit & 1 else row for row in rows]
            rank += 1
    return rank


def byte_syndromes(count: int) -> WordArray:
    """[d, e]: syndrome of the byte e (1..255, first column unused) at d bytes before the last byte."""
    bits = bit_syndromes(8 * count).reshape(count, 8)
    table = np.zeros((count, 256), np.uint32)
    for bit in range(8):
        chosen = np.flatnonzero(np.arange(256) >> bit & 1)
        table[:, chosen] ^= bits[:, bit, None]
    return table


def byte_pattern_spans(count: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(two, three)[n]: invisible patterns of two and of three changed bytes that take up n bytes, ends included.

    The last byte can cancel any low 8 bits: a pattern is invisible when the rest of it leaves the other 24 bits
    at zero and the low ones not.
    """
    table = byte_syndromes(count)[1:, 1:]
    two = np.zeros(count + 1, np.int64)
    three = np.zeros(count + 1, np.int64)
    places = np.repeat(np.arange(1, count), 255)
    values = table.reshape(-1)
    np.add.at(two, places[(values >> 8) == 0] + 1, 1)
    order = np.argsort(values >> 8, kind="stable")
    keys, places, values = (values >> 8)[order], places[order], values[order]
    step = 1
    while step < len(keys) and (same := keys[step:] == keys[:-step]).any():
        at = np.flatnonzero(same)
        good = (places[at] != places[at + step]) & (values[at] != values[at + step])
        np.add.at(three, np.maximum(places[at], places[at + step])[good] + 1, 1)
        step += 1
    return two, three


def fits(spans: NDArray[np.int64], length: int) -> int:
    """Patterns in a word of `length`, from the number of patterns of each span."""
    return sum(int(spans[n]) * (length - n + 1) for n in range(1, length + 1))


def block_ends(length: int) -> NDArray[np.float64]:
    """[n]: probability that random zero-free bytes, unstuffed, have a block that ends at exactly n bytes."""
    starts = np.zeros(length + 256)
    ends = np.zeros(length + 256)
    starts[0] = 1
    for n in range(length + 1):
        ends[n : n + 255] += starts[n] / 255
        starts[n + 1 : n + 255] += starts[n] / 255
        starts[n + 254] += starts[n] / 255
    return ends[: length + 1]


def allowed_bodies() -> Iterator[tuple[int, float]]:
    """(body length, probability that a random header of that length is allowed) of all that a host believes."""
    for frame_type, spec in FRAMES.items():
        if frame_type & 0x80:
            continue
        for payload in range(spec.minimum, spec.maximum + 1):
            chance = 2.0**-24
            if spec.has_address:
                chance *= (ADDRESS_MAX - ADDRESS_MIN + 1) / 256
            if frame_type == FrameType.TAXELS:
                if (payload - 8 - SNAPSHOT_OVERHEAD) % 2:
                    continue
                chance /= 256
            yield FRAME_HEADER_SIZE + payload + FRAME_CRC_SIZE, chance


def garbage_frame_probability() -> float:
    """Probability that a frame is believed at one position of random zero-free bytes."""
    ends = block_ends(BODY_MAX)
    return float(sum(chance * ends[body] for body, chance in allowed_bodies())) * 2.0**-32


def print_break_points() -> None:
    """The break points, computed and published."""
    print("Shortest code word (bits) with an invisible pattern of so many bits")
    print("  bits   computed  published")
    four = four_bit_spans(8 * BODY_MAX)
    for weight, published in BREAK_POINTS.items():
        found = int(np.flatnonzero(four)[0]) if weight == 4 else shortest_word(weight, published + 4)
        print(f"  {weight:4d}  {found!s:>9}  {published:9d}  {'agrees' if found == published else 'DIFFERS'}")
    three = shortest_word(3, 8 * BODY_MAX)
    print(f"  2 and 3: none up to {8 * BODY_MAX} bits (three: {'none found' if three is None else three})")
    rank = burst_rank()
    print(f"  bursts: rank of 32 neighbouring bits {rank}: every burst of up to {rank} bits is seen\n")


def print_lengths() -> None:
    """Hamming distance and invisible patterns at our lengths."""
    four = four_bit_spans(8 * BODY_MAX)
    two_bytes, three_bytes = byte_pattern_spans(BODY_MAX)
    print("Invisible patterns by body length (bytes, CRC included)")
    print("  body   HD   4 bits    share of them   2 bytes   3 bytes    share of them")
    for length in LENGTHS:
        bits = 8 * length
        distance = min(weight for weight, shortest in BREAK_POINTS.items() if bits >= shortest)
        in_bits, in_two, in_three = fits(four, bits), fits(two_bytes, length), fits(three_bytes, length)
        share_bits = in_bits / math.comb(bits, 4)
        share_bytes = in_three / (math.comb(length, 3) * 255**3)
        print(
            f"  {length:4d} {distance:4d} {in_bits:8d}    {share_bits:13.2e}"
            f" {in_two:9d} {in_three:9d}    {share_bytes:13.2e}"
        )
    print(f"  (2^-32 = {2.0**-32:.2e})\n")


def print_rates(frame_rate: float, body: int) -> None:
    """False frames a year by byte error rate."""
    garbage = garbage_frame_probability()
    wire = body + body // 254 + 1
    print("Random bytes without a zero")
    print(f"  a position has an allowed header          {sum(chance for _, chance in allowed_bodies()):.2e}")
    print(f"  a position is taken for a frame           {garbage:.2e}")
    print(f"  years of random bytes for one, at 1 Mbaud   {1 / (garbage * BYTE_RATE * SECONDS_PER_YEAR):.0f}\n")
    print(f"{frame_rate:.0f} frames a second of {wire} stuffed bytes")
    print("  byte error rate   damaged a year   three or more bytes   believed a year, at most")
    for rate in (1e-9, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3):
        damaged = -math.expm1(wire * math.log1p(-rate))
        up_to_two = sum(math.comb(wire, k) * rate**k * (1 - rate) ** (wire - k) for k in (1, 2))
        many = max(damaged - up_to_two, math.comb(wire, 3) * rate**3 * (1 - rate) ** (wire - 3))
        yearly = frame_rate * SECONDS_PER_YEAR
        believed = damaged * (2.0**-32 + wire * garbage)
        print(f"  {rate:15.0e}   {yearly * damaged:14.3g}   {yearly * many:19.3g}   {yearly * believed:24.2g}")
    print("  at most: as if every damaged frame were a random word; a changed data byte, or two, is always seen")


def main() -> None:
    """Print every table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--frame-rate",
        type=float,
        default=19 * 17,
        help="taxel frames a second (default: 17 boards at 19 Hz)",
    )
    parser.add_argument("--body", type=int, default=153, help="bytes of a body (default: 63 taxels, the average board)")
    arguments = parser.parse_args()
    print_break_points()
    print_lengths()
    print_rates(arguments.frame_rate, arguments.body)


if __name__ == "__main__":
    main()
